//! Frames from anywhere: read, shown, built again.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::ethernet::{MAX_LEN, MIN_LEN, MacAddress, locate};
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::frame_size;
use linesman_proto::frame::{DATAGRAM_OVERHEAD, FrameBuilder, FrameView};
use linesman_proto::register::pieces;

/// Any bytes may be a frame. What is read lies within them, and the same datagrams put into a frame
/// of our own are read as the same datagrams.
pub fn frame(data: &[u8]) {
    let _ = locate(data);
    let Ok(view) = FrameView::parse(data) else { return };
    let _ = view.announced_len();
    let mut buffer = [0_u8; MAX_LEN];
    let mut builder = FrameBuilder::new(&mut buffer, view.source());
    let mut kept = Vec::new();
    let mut read = 0;
    for datagram in view.datagrams() {
        // The walk ends at the first datagram that cannot be read.
        let Ok(datagram) = datagram else { break };
        read += DATAGRAM_OVERHEAD + datagram.data_len();
        assert!(read <= data.len(), "datagrams overlap, or reach beyond the frame");
        assert_eq!(datagram.data(), &data[datagram.data_range()]);
        for piece in pieces(datagram.ado(), datagram.data()) {
            let _ = piece.summary();
        }
        let Some(command) = datagram.command() else { continue };
        let address = DatagramAddress::Logical(datagram.logical());
        if let Ok(place) = builder.push(command, datagram.index(), address, datagram.data_len()) {
            place.copy_from_slice(datagram.data());
            kept.push(datagram);
        }
    }
    if kept.is_empty() {
        // A frame without datagrams is nothing to build.
        return;
    }
    let len = builder.finish();
    assert_eq!(len, frame_size(kept.iter().map(|datagram| datagram.data_len())).max(MIN_LEN));
    let again = FrameView::parse(&buffer[..len]).expect("what we build is a frame");
    let read: Vec<_> = again.datagrams().collect();
    assert_eq!(read.len(), kept.len());
    for (read, kept) in read.into_iter().zip(&kept) {
        let read = read.expect("what we build is whole");
        assert_eq!(read.command(), kept.command());
        assert_eq!(read.index(), kept.index());
        assert_eq!((read.adp(), read.ado()), (kept.adp(), kept.ado()));
        assert_eq!(read.data(), kept.data());
    }
}

/// A frame with one broadcast read of the AL state.
pub(crate) fn broadcast_read() -> Vec<u8> {
    let mut buffer = [0_u8; MAX_LEN];
    let source = MacAddress([2, 0, 0, 0, 0, 1]);
    let mut builder = FrameBuilder::new(&mut buffer, source);
    let address = DatagramAddress::Physical(0, RegisterAddress(0x0130));
    builder.push(Command::Brd, 1, address, 2).expect("two bytes fit");
    let len = builder.finish();
    buffer[..len].to_vec()
}
