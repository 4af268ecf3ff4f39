//! Nothing is allocated per frame, not when writing or reading a capture, not on a socket; only the
//! options of a frame that is read take a list.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

#[path = "support/namespace.rs"]
mod namespace;
mod support;

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
    /// Bytes held now, and the most there have been.
    static HELD: Cell<(i64, i64)> = const { Cell::new((0, 0)) };
}

/// The system's allocator, counting for each thread.
struct Counting;

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        hold(layout.size() as i64);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        hold(-(layout.size() as i64));
        // SAFETY: the pointer came from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

fn hold(bytes: i64) {
    HELD.with(|held| {
        let (now, most) = held.get();
        held.set((now + bytes, most.max(now + bytes)));
    });
}

/// The most bytes that `run` holds at once beyond what is held before.
fn peak(run: impl FnOnce()) -> i64 {
    let before = HELD.with(Cell::get).0;
    HELD.with(|held| held.set((before, before)));
    run();
    HELD.with(Cell::get).1 - before
}

/// A capture of 10,000 frames that go in `direction`, written without allocating for each.
fn written(direction: FrameDirection) -> Vec<u8> {
    let sink = Vec::with_capacity(4_000_000);
    let mut writer = PcapngWriter::new(sink, "test").unwrap();
    let interface =
        InterfaceToWrite { name: "eth0", description: "", link_type: LinkType::Ethernet };
    let card = writer.add_interface(&interface).unwrap();
    let bytes = [0xA5; 200];
    let frame = |at| FrameToWrite::new(card, UnixTime::from_nanos(at), direction, &bytes);
    writer.write_frame(&frame(0)).unwrap();
    let before = allocations();
    for at in 1..10_000 {
        writer.write_frame(&frame(at)).unwrap();
    }
    assert_eq!(allocations() - before, 0, "writing");
    writer.finish().unwrap()
}

#[test]
fn reading_and_writing_frames_allocate_nothing() {
    // A frame with a direction has an option.
    for direction in [FrameDirection::Unknown, FrameDirection::Incoming] {
        let file = std::io::Cursor::new(written(direction));
        let mut reader = CaptureReader::from_source("memory", file).unwrap();
        assert_eq!(reader.next_frame().unwrap().interface, CaptureInterfaceId(0));
        let before = allocations();
        let mut frames = 1;
        while reader.next_frame().is_some() {
            frames += 1;
        }
        assert_eq!((frames, allocations() - before), (10_000, 0), "{direction:?}");
    }
}

#[test]
fn a_block_full_of_empty_options_costs_a_bounded_multiple_of_its_length() {
    let m = support::Maker { big: false };
    let longest = 16 * 1024 * 1024 - 32;
    // The option 1, a comment, without a text: four bytes each.
    let options = m.option(1, &[]).repeat(longest / 4);
    for (block, frames) in [
        (m.packet(0, 1, 0, &[], std::slice::from_ref(&options)), 1),
        (m.interface(1, 0, std::slice::from_ref(&options)), 0),
    ] {
        let len = block.len() as i64;
        let file = [m.section(), m.interface(1, 0, &[]), block].concat();
        let source = std::io::Cursor::new(file);
        let most = peak(|| {
            let mut reader = CaptureReader::from_source("memory", source).unwrap();
            assert_eq!(std::iter::from_fn(|| reader.next_frame().map(|_| ())).count(), frames);
            assert!(reader.end().unwrap().complete());
        });
        assert!(most < 16 * len, "{most} bytes for a block of {len}");
    }
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
