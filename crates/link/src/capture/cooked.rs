//! Linux "cooked" headers, made Ethernet headers again.
//!
//! Reference: LINKTYPE_LINUX_SLL and LINKTYPE_LINUX_SLL2 at <https://www.tcpdump.org/linktypes>.
//! A cooked header has source address, type and direction, but no destination; broadcast stands in
//! for it, which is what EtherCAT uses. The Ethernet header is shorter than either cooked header,
//! so it is written over the end of the cooked one, right before the payload.

use linesman_proto::ethernet::HEADER_LEN;

use super::frame::FrameDirection;

/// Length of a cooked header, version 1.
const SLL_LEN: usize = 16;
/// Length of a cooked header, version 2.
const SLL2_LEN: usize = 20;
/// The smallest protocol number that is an EtherType; those below name other framings.
const FIRST_ETHERTYPE: u16 = 0x0600;

/// What a cooked header said that an Ethernet header cannot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Cooked {
    /// Where the rebuilt Ethernet frame begins.
    pub(super) start: usize,
    pub(super) direction: FrameDirection,
    /// The number that the capturing host gave to the card (version 2 only).
    pub(super) host_interface: Option<u32>,
}

/// Rebuilds the frame behind a version 1 header, in place. `None` when it is no Ethernet frame.
pub(super) fn rebuild(bytes: &mut [u8]) -> Option<Cooked> {
    let header: [u8; SLL_LEN] = *bytes.first_chunk()?;
    let [_, packet_type, _, _, _, address_len, a, b, c, d, e, g, _, _, t1, t2] = header;
    let source = Source { address: [a, b, c, d, e, g], len: address_len };
    let start = write_header(bytes, SLL_LEN, source, [t1, t2])?;
    Some(Cooked { start, direction: direction(packet_type), host_interface: None })
}

/// Rebuilds the frame behind a version 2 header, in place. `None` when it is no Ethernet frame.
pub(super) fn rebuild2(bytes: &mut [u8]) -> Option<Cooked> {
    let header: [u8; SLL2_LEN] = *bytes.first_chunk()?;
    let [t1, t2, _, _, i1, i2, i3, i4, _, _, packet_type, address_len, a, b, c, d, e, g, _, _] =
        header;
    let source = Source { address: [a, b, c, d, e, g], len: address_len };
    let start = write_header(bytes, SLL2_LEN, source, [t1, t2])?;
    let host_interface = Some(u32::from_be_bytes([i1, i2, i3, i4]));
    Some(Cooked { start, direction: direction(packet_type), host_interface })
}

struct Source {
    address: [u8; 6],
    len: u8,
}

fn write_header(
    bytes: &mut [u8],
    cooked_len: usize,
    source: Source,
    ethertype: [u8; 2],
) -> Option<usize> {
    if u16::from_be_bytes(ethertype) < FIRST_ETHERTYPE {
        return None;
    }
    let start = cooked_len - HEADER_LEN;
    let header = bytes.get_mut(start..cooked_len)?;
    header[..6].fill(0xFF);
    header[6..12].copy_from_slice(&if source.len == 6 { source.address } else { [0; 6] });
    header[12..].copy_from_slice(&ethertype);
    Some(start)
}

/// Packet types of Linux: 4 left this host, 0 to 2 came to it; 3, between other hosts, came too,
/// since the card heard it.
fn direction(packet_type: u8) -> FrameDirection {
    match packet_type {
        0..=3 => FrameDirection::Incoming,
        4 => FrameDirection::Outgoing,
        _ => FrameDirection::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cooked_frame_becomes_an_ethernet_frame() {
        let mut bytes = vec![0, 4, 0, 1, 0, 6, 2, 1, 5, 0x10, 0x11, 0x12, 0, 0, 0x88, 0xA4];
        bytes.extend([0x0D, 0x10, 7]);
        let cooked = rebuild(&mut bytes).unwrap();
        assert_eq!(cooked.direction, FrameDirection::Outgoing);
        let frame = &bytes[cooked.start..];
        assert_eq!(frame[..6], [0xFF; 6]);
        assert_eq!(frame[6..], [2, 1, 5, 0x10, 0x11, 0x12, 0x88, 0xA4, 0x0D, 0x10, 7]);
    }

    #[test]
    fn version_2_tells_the_interface() {
        let mut bytes = vec![0x88, 0xA4, 0, 0, 0, 0, 0, 9, 0, 1, 1, 6, 0, 1, 2, 3, 4, 5, 0, 0];
        bytes.extend([0x0D, 0x10]);
        let cooked = rebuild2(&mut bytes).unwrap();
        assert_eq!(cooked.direction, FrameDirection::Incoming);
        assert_eq!(cooked.host_interface, Some(9));
        assert_eq!(bytes[cooked.start + 6..], [0, 1, 2, 3, 4, 5, 0x88, 0xA4, 0x0D, 0x10]);
    }

    #[test]
    fn what_is_no_ethernet_frame_is_left_alone() {
        // Protocol 0x0004: an 802.2 frame, whose length field the cooked header does not keep.
        let bytes = vec![0, 0, 0, 1, 0, 6, 0, 1, 2, 3, 4, 5, 0, 0, 0x00, 0x04, 1, 2];
        assert_eq!(rebuild(&mut bytes.clone()), None);
        assert_eq!(rebuild(&mut bytes[..15].to_vec()), None);
        assert_eq!(rebuild2(&mut bytes[..15].to_vec()), None);
    }
}
