//! Lines as long as they can be, and frames that cost no memory.

use linesman_proto::address::{LogicalAddress, Path};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{PlantOptions, SegmentFile, plant};

use super::rig::{answer, at, frame};

const LONGEST: &str = r#"
name = "longest"

[[device]]
name = "K"
type = "EK1100"
on = "maindevice"

[[device]]
name = "T"
type = "EL1008"
on = "K.B"
repeat = 65534
"#;

/// Sends a frame and gives what comes back, within as long as the longest line takes.
fn send(segment: &mut Segment, now: &mut Instant, bytes: &[u8]) -> (Vec<u8>, u16) {
    segment.handle_frame(*now, Path::A, bytes);
    *now += Span::ms(100);
    segment.advance(*now);
    let mut buffer = Vec::new();
    assert!(segment.poll_arrival(&mut buffer).unwrap().intact);
    answer(&buffer)
}

// proves: ESC-01 partial: the segment; the MainDevice is measured by its bench line_growth
#[test]
fn the_longest_line_answers_and_each_of_it_can_be_addressed() {
    let file = SegmentFile::parse(LONGEST).unwrap();
    let mut segment = Segment::build(&file).unwrap();
    let mut now = Instant::from_nanos(1_000_000);
    let all = send(&mut segment, &mut now, &frame(Command::Brd, at(0, 0), &[0]));
    assert_eq!(all.1, 65_535);
    for position in [0u16, 1, 32_768, 65_534] {
        let place = at(0u16.wrapping_sub(position), 0x0010);
        let station = position.wrapping_add(0x1001).to_le_bytes();
        let given = send(&mut segment, &mut now, &frame(Command::Apwr, place, &station));
        assert_eq!(given.1, 1, "position {position}");
        let name = at(position.wrapping_add(0x1001), 0x0010);
        let read = send(&mut segment, &mut now, &frame(Command::Fprd, name, &[0; 2]));
        assert_eq!(read, (station.to_vec(), 1), "position {position}");
    }
    assert!(segment.frames_without_walk() >= 8);
}

#[test]
fn frames_cost_no_memory_once_they_run() {
    let options = PlantOptions { min_devices: 30, max_devices: 30, ..PlantOptions::default() };
    let mut segment = Segment::build(&plant(Seed(1), &options)).unwrap();
    let mut now = Instant::from_nanos(1_000_000);
    let position = frame(Command::Apwr, at(0xFFFF, 0x0010), &[0x02, 0x10]);
    send(&mut segment, &mut now, &position);
    let logical = DatagramAddress::Logical(LogicalAddress(0x1000));
    let frames = [
        frame(Command::Brd, at(0, 0x0130), &[0; 2]),
        frame(Command::Fprd, at(0x1002, 0x0130), &[0; 2]),
        frame(Command::Aprd, at(0xFFF0, 0x0130), &[0; 2]),
        frame(Command::Lrw, logical, &[0; 200]),
        frame(Command::Frmw, at(0x1002, 0x0910), &[0; 8]),
        frame(Command::Bwr, at(0, 0x0300), &[0; 8]),
    ];
    let mut buffer = Vec::with_capacity(1_514);
    let mut round = |walks: bool| {
        segment.set_walks_always(walks);
        for bytes in &frames {
            segment.handle_frame(now, Path::A, bytes);
            now += Span::us(200);
            segment.advance(now);
            assert!(segment.poll_arrival(&mut buffer).is_some());
        }
    };
    for walks in [false, true] {
        (0..50).for_each(|_| round(walks));
        let measured = allocation_counter::measure(|| (0..200).for_each(|_| round(walks)));
        assert_eq!(measured.count_total, 0, "walks: {walks}");
    }
}
