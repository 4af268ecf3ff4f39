//! Information of a controller about itself: type, size, ports, features (0x0000 to 0x0009).
//!
//! Reference: S2 2.1.

use std::fmt;

use super::bits::bits;
use super::table;
use crate::port::Port;

/// The ten bytes from 0x0000 on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct EscInformation {
    /// Kind of controller.
    pub controller: ControllerType,
    /// Its revision.
    pub revision: u8,
    /// Its build.
    pub build: u16,
    /// How many FMMUs it has.
    pub fmmus: u8,
    /// How many SyncManagers it has.
    pub sync_managers: u8,
    /// Process data RAM in KB.
    pub ram_kb: u8,
    /// How its ports are built.
    pub ports: PortDescriptor,
    /// What it can and cannot do.
    pub features: Features,
}

impl EscInformation {
    /// Length in bytes.
    pub const LEN: usize = 10;

    /// From the ten bytes.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Self::LEN]) -> Self {
        let [controller, revision, b0, b1, fmmus, sync_managers, ram_kb, ports, f0, f1] = bytes;
        Self {
            controller: ControllerType(controller),
            revision,
            build: u16::from_le_bytes([b0, b1]),
            fmmus,
            sync_managers,
            ram_kb,
            ports: PortDescriptor(ports),
            features: Features(u16::from_le_bytes([f0, f1])),
        }
    }

    /// The ten bytes.
    #[must_use]
    pub const fn to_bytes(&self) -> [u8; Self::LEN] {
        let [b0, b1] = self.build.to_le_bytes();
        let [f0, f1] = self.features.0.to_le_bytes();
        [
            self.controller.0,
            self.revision,
            b0,
            b1,
            self.fmmus,
            self.sync_managers,
            self.ram_kb,
            self.ports.0,
            f0,
            f1,
        ]
    }

    /// The controller's name. An ET1150 has the type of an ET1100 and is told by its revision.
    #[must_use]
    pub fn controller_name(&self) -> &'static str {
        match (self.controller, self.revision) {
            (ControllerType::ET1100, 0x50) => "ET1150",
            (ControllerType::ET1100, _) => "ET1100",
            (other, _) => other.name(),
        }
    }
}

/// The type byte, 0x0000.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct ControllerType(pub u8);

impl ControllerType {
    /// ESC10 and ESC20.
    pub const ESC20: Self = Self(0x02);
    /// The IP core for FPGAs.
    pub const IP_CORE: Self = Self(0x04);
    /// ET1100, and ET1150, which has revision 0x50.
    pub const ET1100: Self = Self(0x11);
    /// ET1200.
    pub const ET1200: Self = Self(0x12);
    /// TI PRU-ICSS.
    pub const PRU_ICSS: Self = Self(0x90);
    /// Infineon XMC4300 and XMC4800.
    pub const XMC4X00: Self = Self(0x98);
    /// Microchip LAN925x.
    pub const LAN925X: Self = Self(0xC0);

    /// The name in the register table, or `unknown controller`.
    #[must_use]
    pub fn name(self) -> &'static str {
        let named = table::ESC_TYPE.fields.first().and_then(|kind| kind.value_name(self.0.into()));
        named.unwrap_or("unknown controller")
    }
}

impl fmt::Display for ControllerType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The port descriptor, 0x0007: how each port is built.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct PortDescriptor(pub u8);

impl PortDescriptor {
    /// How a port is built.
    #[must_use]
    pub const fn port(self, port: Port) -> PortType {
        match self.0 >> (2 * port.index()) & 0b11 {
            0 => PortType::NotImplemented,
            1 => PortType::NotConfigured,
            2 => PortType::Ebus,
            _ => PortType::Mii,
        }
    }

    /// This descriptor with another kind of port.
    #[must_use]
    pub const fn with_port(self, port: Port, kind: PortType) -> Self {
        let shift = 2 * port.index();
        let bits: u8 = match kind {
            PortType::NotImplemented => 0,
            PortType::NotConfigured => 1,
            PortType::Ebus => 2,
            PortType::Mii => 3,
        };
        Self(self.0 & !(0b11 << shift) | bits << shift)
    }

    /// The ports that exist, in the order of their numbers.
    pub fn implemented(self) -> impl Iterator<Item = Port> {
        Port::ALL.into_iter().filter(move |port| match self.port(*port) {
            PortType::NotImplemented | PortType::NotConfigured => false,
            PortType::Ebus | PortType::Mii => true,
        })
    }
}

/// How a port is built.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum PortType {
    /// There is no such port.
    NotImplemented,
    /// The SII says what it is, and was not loaded.
    NotConfigured,
    /// E-bus: to the next terminal.
    Ebus,
    /// MII, RMII or RGMII: a cable.
    Mii,
}

impl PortType {
    /// The name of the data sheet.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotImplemented => "not implemented",
            Self::NotConfigured => "not configured",
            Self::Ebus => "E-bus",
            Self::Mii => "MII",
        }
    }
}

impl fmt::Display for PortType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The features, 0x0008.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct Features(pub u16);

impl Features {
    bits! {
        u16;
        /// Whether FMMUs map whole bytes only.
        0 bytewise_fmmus with_bytewise_fmmus;
        /// Whether registers that are not there must not be read.
        1 no_unused_registers with_no_unused_registers;
        /// Whether there are distributed clocks.
        2 distributed_clocks with_distributed_clocks;
        /// Whether the clocks have 64 bits; otherwise 32.
        3 clock_64_bit with_clock_64_bit;
        /// Whether E-bus ports can run with little jitter.
        4 low_jitter_ebus with_low_jitter_ebus;
        /// Whether E-bus ports have enhanced link detection.
        5 enhanced_link_ebus with_enhanced_link_ebus;
        /// Whether MII ports have enhanced link detection.
        6 enhanced_link_mii with_enhanced_link_mii;
        /// Whether frames that an earlier controller marked are counted as forwarded errors.
        7 separate_forwarded_errors with_separate_forwarded_errors;
        /// Whether the activation register of the SYNC unit has its enhanced bits.
        8 enhanced_sync_activation with_enhanced_sync_activation;
        /// Whether LRW is not processed.
        9 no_lrw with_no_lrw;
        /// Whether BRW, APRW and FPRW are not processed.
        10 no_read_write with_no_read_write;
        /// Whether FMMUs and SyncManagers have a fixed configuration.
        11 fixed_configuration with_fixed_configuration;
        /// Whether SyncManagers have a sequential mode.
        12 sequential_mode with_sequential_mode;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_et1100_as_in_a_coupler() {
        let bytes = [0x11, 0x00, 0x02, 0x00, 0x08, 0x08, 0x08, 0x3B, 0xFC, 0x00];
        let information = EscInformation::from_bytes(bytes);
        assert_eq!(information.controller_name(), "ET1100");
        assert_eq!((information.fmmus, information.sync_managers, information.ram_kb), (8, 8, 8));
        let ports = Port::ALL.map(|port| information.ports.port(port));
        use PortType::{Ebus, Mii, NotImplemented};
        assert_eq!(ports, [Mii, Ebus, Mii, NotImplemented]);
        let implemented: Vec<Port> = information.ports.implemented().collect();
        assert_eq!(implemented, [Port::A, Port::B, Port::C]);
        let features = information.features;
        assert!(features.distributed_clocks() && features.clock_64_bit());
        assert!(features.separate_forwarded_errors() && !features.no_lrw());
        assert_eq!(information.to_bytes(), bytes);
    }

    #[test]
    fn an_et1150_is_told_by_its_revision() {
        let et1150 = EscInformation {
            controller: ControllerType::ET1100,
            revision: 0x50,
            ..EscInformation::default()
        };
        assert_eq!(et1150.controller_name(), "ET1150");
        assert_eq!(ControllerType::LAN925X.name(), "LAN925x");
        assert_eq!(ControllerType(0x77).to_string(), "unknown controller");
    }

    /// The register table and this type number the bits alike.
    #[test]
    fn features_agree_with_the_register_table() {
        let bit = |name: &str| 1u16 << table::ESC_FEATURES.field(name).unwrap().low;
        let none = Features::default();
        assert_eq!(none.with_bytewise_fmmus(true).0, bit("FMMU operation"));
        assert_eq!(none.with_no_unused_registers(true).0, bit("unused register access"));
        assert_eq!(none.with_distributed_clocks(true).0, bit("distributed clocks"));
        assert_eq!(none.with_clock_64_bit(true).0, bit("clock width"));
        assert_eq!(none.with_low_jitter_ebus(true).0, bit("low jitter E-bus"));
        assert_eq!(none.with_enhanced_link_ebus(true).0, bit("enhanced link detection E-bus"));
        assert_eq!(none.with_enhanced_link_mii(true).0, bit("enhanced link detection MII"));
        let forwarded = none.with_separate_forwarded_errors(true);
        assert_eq!(forwarded.0, bit("separate FCS error handling"));
        let sync = none.with_enhanced_sync_activation(true);
        assert_eq!(sync.0, bit("enhanced DC SYNC activation"));
        assert_eq!(none.with_no_lrw(true).0, bit("LRW not supported"));
        assert_eq!(none.with_no_read_write(true).0, bit("BRW, APRW, FPRW not supported"));
        let fixed = none.with_fixed_configuration(true);
        assert_eq!(fixed.0, bit("fixed FMMU and SyncManager configuration"));
        assert_eq!(none.with_sequential_mode(true).0, bit("SyncManager sequential mode"));
    }

    proptest! {
        #[test]
        fn any_ten_bytes_go_both_ways(bytes: [u8; 10]) {
            prop_assert_eq!(EscInformation::from_bytes(bytes).to_bytes(), bytes);
        }

        #[test]
        fn port_descriptors_are_rebuilt_from_their_ports(bits: u8) {
            let descriptor = PortDescriptor(bits);
            let rebuilt = Port::ALL.into_iter().fold(PortDescriptor(!bits), |rebuilt, port| {
                rebuilt.with_port(port, descriptor.port(port))
            });
            prop_assert_eq!(rebuilt, descriptor);
        }
    }
}
