//! Index groups of an EtherCAT MainDevice and of its SubDevices.
//!
//! Reference: Beckhoff Information System, library Tc2_EtherCAT (function blocks `FB_Ec...`), and public clients of it:
//! Beckhoff/ADS (`adstool`), kimblad/TwinSharp, DiamondLightSource/fastcs-catio.

use crate::mailbox::coe::{ObjectAddress, ObjectIndex};

/// Settings of an AoE SubDevice's own address.
///
/// The index and [`OWN_NET_ID_OFFSET`] are those of ETG.1020 (AoE, "Set NetId"), taken from memory: no public text was
/// found that names them (`docs/SOURCES.md`).
pub const OWN_NET_ID: u32 = 0x01;
/// Offset of [`OWN_NET_ID`] at which the NetId, six bytes, is written.
pub const OWN_NET_ID_OFFSET: u32 = 0x03;
/// State of the MainDevice: read at offset [`MASTER_STATE_OFFSET`]; written, the offset is the state.
pub const MASTER_STATE: u32 = 0x03;
/// Offset at which [`MASTER_STATE`] is read.
pub const MASTER_STATE_OFFSET: u32 = 0x100;
/// Number of SubDevices.
pub const DEVICE_COUNT: u32 = 0x06;
/// Station addresses of all SubDevices, a word each.
pub const STATION_ADDRESSES: u32 = 0x07;
/// States of SubDevices, two bytes each: of all at offset 0, else of the station address; written, the state wanted.
pub const DEVICE_STATES: u32 = 0x09;
/// Counts of frames; written without data they begin at 0.
pub const FRAME_COUNTS: u32 = 0x0C;
/// Identity of the SubDevice at a station address.
pub const IDENTITY: u32 = 0x11;
/// Damaged frames: sums of all SubDevices at offset 0, else by port of a station address; written without data they
/// begin at 0.
pub const CRC_COUNTS: u32 = 0x12;
/// Number of times that each SubDevice left a state by itself.
pub const ABNORMAL_CHANGES: u32 = 0x13;
/// Number of times that each SubDevice stopped answering or came back.
pub const PRESENCE_CHANGES: u32 = 0x14;
/// Topology, 64 bytes for each SubDevice.
pub const TOPOLOGY: u32 = 0x22;
/// A datagram sent beside the cycle (as `adstool` does).
pub const DATAGRAM: u32 = 0x2C;
/// State word of the network.
pub const NETWORK_STATE: u32 = 0x45;
/// Number of cyclic frames.
pub const FRAME_COUNT: u32 = 0x48;
/// A datagram sent beside the cycle (as ports of `FB_EcPhysicalReadCmd` do).
pub const DATAGRAM_OF_BLOCKS: u32 = 0x500;
/// Objects by CoE: index in bits 16 to 31 of the offset, subindex in bits 0 to 7, [`SDO_COMPLETE`] for all entries.
pub const SDO: u32 = 0xF302;
/// Bit of the offset of [`SDO`]: complete access.
pub const SDO_COMPLETE: u32 = 0x100;
/// The abort code of the last access to an object that failed.
pub const LAST_SDO_ERROR: u32 = 0xF303;
/// Elements of identification numbers by SoE: number in bits 0 to 15 of the offset, element in bits 16 to 23, drive in
/// bits 24 to 26.
pub const IDN: u32 = 0xF420;

/// The object of an offset of [`SDO`], and whether all its entries are meant.
#[must_use]
pub const fn object(offset: u32) -> (ObjectAddress, bool) {
    let [subindex, flags, low, high] = offset.to_le_bytes();
    let index = ObjectIndex(u16::from_le_bytes([low, high]));
    let complete = (flags as u32) << 8 & SDO_COMPLETE != 0;
    (ObjectAddress { index, subindex }, complete)
}
