//! Header fields in front of the EtherCAT data: Ethernet, VLAN tag, UDP.

use linesman_proto::ethernet::{
    ETHERTYPE_ETHERCAT, ETHERTYPE_IPV4, ETHERTYPE_QINQ, ETHERTYPE_VLAN, Wrapping, locate,
};

/// Header fields of a frame, as far as it has them.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct WrappingFields {
    /// EtherType behind the addresses.
    pub ethertype: Option<u16>,
    /// Identifier of the outermost VLAN tag.
    pub vlan: Option<u16>,
    /// True if EtherCAT is carried in UDP.
    pub is_udp: bool,
    /// The EtherCAT header: bits 0 to 10 length, 12 to 15 type.
    pub ethercat_header: Option<u16>,
}

impl WrappingFields {
    /// Those of a frame.
    #[must_use]
    pub fn of(frame: &[u8]) -> Self {
        let word = |at: usize| Some(u16::from_be_bytes([*frame.get(at)?, *frame.get(at + 1)?]));
        let ethertype = word(12);
        let is_tagged = matches!(ethertype, Some(ETHERTYPE_VLAN | ETHERTYPE_QINQ));
        let vlan = word(14).filter(|_| is_tagged).map(|tag| tag & 0x0FFF);
        let located = locate(frame);
        let header = located.and_then(|(_, at)| frame.get(at..at + 2)?.first_chunk().copied());
        Self {
            ethertype,
            vlan,
            is_udp: located.is_some_and(|(wrapping, _)| wrapping == Wrapping::Udp),
            ethercat_header: header.map(u16::from_le_bytes),
        }
    }

    /// True if the frame is IPv4, tagged or not.
    #[must_use]
    pub const fn is_ipv4(&self) -> bool {
        matches!(self.ethertype, Some(ETHERTYPE_IPV4)) || self.is_udp
    }

    /// True if the frame is EtherCAT of any type.
    #[must_use]
    pub const fn is_ethercat(&self) -> bool {
        self.ethercat_header.is_some() || matches!(self.ethertype, Some(ETHERTYPE_ETHERCAT))
    }
}
