//! Record of a datagram: a row with plain values, for tables and files of other programs.

use linesman_proto::command::{Addressing, Command};
use serde::Serialize;

use crate::knowledge::DeviceIndex;
use crate::row::{CaptureRow, DatagramRow};

/// A datagram as a row of a table.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "parquet", derive(parquet_derive::ParquetRecordWriter))]
pub struct DatagramRecord {
    /// Number of the frame, from 1.
    pub frame: u64,
    /// Number of the datagram in its frame, from 1.
    pub datagram: u32,
    /// Time since the start of the capture in ns.
    pub time_ns: u64,
    /// Date in ns since 1970 (UTC).
    pub date_ns: Option<i64>,
    /// Time since the frame before in ns.
    pub since_previous_ns: i64,
    /// Time since the cycle began in ns.
    pub cycle_ns: Option<u64>,
    /// Interface of the capture, from 0.
    pub interface: u32,
    /// `out` or `back`.
    pub way: Option<&'static str>,
    /// Length of the frame on the wire in bytes.
    pub frame_len: u32,
    /// Name of the command.
    pub command: String,
    /// Index of the datagram.
    pub index: u8,
    /// Station address or position as in the datagram, but of logical addresses.
    pub adp: Option<u16>,
    /// Register or memory address, but of logical addresses.
    pub ado: Option<u16>,
    /// Logical address.
    pub logical: Option<u32>,
    /// Length of the data in bytes.
    pub data_len: u16,
    /// Working counter; in a ring that of this copy.
    pub wkc: u16,
    /// Working counter that it should come back with.
    pub wkc_expected: Option<u16>,
    /// True if it came back with another one; `None` where none is expected.
    pub wkc_wrong: Option<bool>,
    /// Event field (IRQ).
    pub irq: u16,
    /// Number of the SubDevice that is addressed, from 1.
    pub subdevice: Option<u32>,
    /// Mailbox protocol of the message in it.
    pub mailbox: Option<&'static str>,
    /// Object of an SDO transfer.
    pub object: Option<u16>,
    /// Entry of the object.
    pub subindex: Option<u8>,
    /// True if the check sequence of the frame was right; `None` when nobody looked.
    pub fcs_ok: Option<bool>,
    /// Port of the capture probe.
    pub probe_port: Option<u8>,
    /// Identifier of the VLAN tag.
    pub vlan: Option<u16>,
}

impl DatagramRecord {
    /// The datagram `index` of a frame, counted from 0.
    #[must_use]
    pub fn of(row: &CaptureRow<'_>, index: usize, devices: Option<&DeviceIndex>) -> Option<Self> {
        let datagram_row = row.datagrams.get(index)?;
        let (frame, datagram) = (&row.frame, &datagram_row.datagram);
        let is_logical = datagram_row.is_logical();
        let mailbox = datagram_row.mailbox();
        let coe = mailbox.and_then(|mailbox| mailbox.coe());
        Some(Self {
            frame: frame.number,
            datagram: index as u32 + 1,
            time_ns: frame.time.as_nanos(),
            date_ns: frame.date_ns.and_then(|date| i64::try_from(date).ok()),
            since_previous_ns: i64::try_from(frame.since_previous_ns).unwrap_or(i64::MAX),
            cycle_ns: row.facts.in_cycle.map(|span| span.as_nanos()),
            interface: frame.interface,
            way: row.way().map(|way| way.name()),
            frame_len: frame.original_len,
            command: datagram_row.command_name(),
            index: datagram.index(),
            adp: (!is_logical).then(|| datagram.adp()),
            ado: (!is_logical).then(|| datagram.ado().0),
            logical: is_logical.then(|| datagram.logical().0),
            data_len: datagram.data_len() as u16,
            wkc: datagram.wkc().0,
            wkc_expected: datagram_row.expected_wkc,
            wkc_wrong: datagram_row.expected_wkc.map(|_| datagram_row.is_wkc_wrong()),
            irq: datagram.irq(),
            subdevice: devices.and_then(|devices| addressed(devices, datagram_row, row)),
            mailbox: mailbox.map(|mailbox| mailbox.header.kind.name()),
            object: coe.and_then(|coe| coe.index),
            subindex: coe.and_then(|coe| coe.subindex),
            fcs_ok: frame.fcs,
            probe_port: frame.probe.and_then(|probe| probe.port),
            vlan: row.wrapping().vlan,
        })
    }
}

/// The one SubDevice that is addressed; `None` for broadcasts and process data.
fn addressed(
    devices: &DeviceIndex,
    datagram: &DatagramRow<'_>,
    row: &CaptureRow<'_>,
) -> Option<u32> {
    let addressing = datagram.datagram.command().map(Command::addressing);
    let is_one = matches!(addressing, Some(Addressing::Position | Addressing::Station));
    let concerned = devices.concerned(&datagram.datagram, row);
    concerned.first().copied().filter(|_| is_one)
}
