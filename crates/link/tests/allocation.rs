//! Nothing is allocated per frame: not when reading a capture, not on a socket.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

#[path = "support/namespace.rs"]
mod namespace;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::clock::HostClock;
use linesman_link::direction::FrameDirection;
use linesman_link::socket::{Batch, RawSocket, SocketOptions};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Span;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting for each thread.
struct Counting;

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

#[test]
fn reading_and_writing_frames_allocate_nothing() {
    let sink = Vec::with_capacity(4_000_000);
    let mut writer = PcapngWriter::new(sink, "test").unwrap();
    let interface =
        InterfaceToWrite { name: "eth0", description: "", link_type: LinkType::Ethernet };
    let card = writer.add_interface(&interface).unwrap();
    let bytes = [0xA5; 200];
    let direction = FrameDirection::Incoming;
    let frame = |at| FrameToWrite::new(card, UnixTime::from_nanos(at), direction, &bytes);
    writer.write_frame(&frame(0)).unwrap();
    let before = allocations();
    for at in 1..10_000 {
        writer.write_frame(&frame(at)).unwrap();
    }
    assert_eq!(allocations() - before, 0, "writing");

    let file = std::io::Cursor::new(writer.finish().unwrap());
    let mut reader = CaptureReader::from_source("memory", file).unwrap();
    assert_eq!(reader.next_frame().unwrap().interface, CaptureInterfaceId(0));
    let before = allocations();
    let mut frames = 1;
    while reader.next_frame().is_some() {
        frames += 1;
    }
    assert_eq!((frames, allocations() - before), (10_000, 0), "reading");
}

#[test]
fn sending_and_receiving_allocate_nothing() {
    namespace::with_cable(|| {
        let clock = HostClock::start();
        let options = SocketOptions::default();
        let mut near = RawSocket::open("va", &options).unwrap();
        let mut far = RawSocket::open("vb", &options).unwrap();
        let mut frame = [0xFF; 60];
        frame[12..14].copy_from_slice(&[0x88, 0xA4]);
        let mut batch = Batch::new(16);
        let before = allocations();
        let mut received = 0;
        for _ in 0..100 {
            assert_eq!(near.send_batch([&frame[..]; 5]).unwrap().frames, 5);
            far.wait(&clock, clock.now() + Span::s(1)).unwrap();
            received += far.recv_batch(&mut batch, &clock).unwrap();
            assert!(batch.iter().all(|seen| seen.bytes == frame));
        }
        assert_eq!(allocations() - before, 0);
        assert!(received > 0);
    });
}
