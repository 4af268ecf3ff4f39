//! Virtual Ethernet switch of a MainDevice: its ports are this computer and the SubDevices that speak EoE.
//!
//! Reference: S0 L2865-2881 (EOE-02: ports, table of addresses, frame buffer); IEEE 802.1D for learning, ageing, and
//! addresses that are never passed on. An engine without I/O: frames go in with the time, and wait at the ports that they
//! leave by. [`SubDevicePort`] puts fragments of a SubDevice together.

mod flood;
mod mac_table;
mod sub_device_port;
mod switch;

pub use flood::FloodLimit;
pub use mac_table::MacTable;
pub use sub_device_port::{FragmentCounts, SubDevicePort};
pub use switch::{SwitchCounts, SwitchLimits, SwitchPort, VirtualSwitch};

/// The shortest frame, in bytes: two addresses and a type.
pub const SHORTEST_FRAME: usize = 14;
/// The longest frame, in bytes: with a VLAN tag, without check sequence.
pub const LONGEST_FRAME: usize = 1_518;
