//! Assumptions of foreign MainDevices that other emulators got wrong: each a test on frames.

use linesman_config::fault::FaultName;
use linesman_proto::address::LogicalAddress;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use super::rig::{Bench, at, frame};

// A MainDevice (ethercrab) drops frames whose source address lacks the bit: it takes them for its
// own. S1 3.4, facts 1.2.
#[test]
fn every_processed_frame_bears_the_source_mark() {
    let mut bench = Bench::plant();
    let frames = [
        frame(Command::Brd, at(0, 0x0000), &[0]),
        frame(Command::Fprd, at(0x7777, 0x0130), &[0, 0]),
        frame(Command::Nop, at(0, 0x0900), &[0; 4]),
        frame(Command::Lrw, DatagramAddress::Logical(LogicalAddress(0x1_0000)), &[0; 8]),
        frame(Command::Bwr, at(0, 0x0300), &[0; 8]),
    ];
    for sent in frames {
        let arrived = bench.send_by(Path::A, &sent);
        let [(_, back)] = &arrived[..] else { panic!("one frame, one answer") };
        assert_eq!(sent[6] & 0x02, 0);
        assert_eq!(back[6], sent[6] | 0x02);
        assert_eq!(back[7..12], sent[7..12]);
    }
    // Told otherwise at the first controller, it is still set by the next (facts 10: SOEM).
    bench.send(Command::Apwr, at(0, 0x0100), &[0]);
    let back = bench.send_by(Path::A, &frame(Command::Brd, at(0, 0x0000), &[0]));
    assert_eq!(back[0].1[6] & 0x02, 0x02);
    bench.send(Command::Bwr, at(0, 0x0100), &[0]);
    let back = bench.send_by(Path::A, &frame(Command::Brd, at(0, 0x0000), &[0]));
    assert_eq!(back[0].1[6] & 0x02, 0, "nobody sets it any more");
}

// A MainDevice (SOEM) writes SII control and address in one access of six bytes. facts 2.8.
#[test]
fn sii_control_and_address_come_in_one_access() {
    let mut bench = Bench::plant();
    for position in 0..3u16 {
        let adp = 0u16.wrapping_sub(position);
        let ask = [0x00, 0x01, 0x0A, 0x00, 0x00, 0x00];
        assert_eq!(bench.send(Command::Apwr, at(adp, 0x0502), &ask).unwrap().1, 1);
        let (control, _) = bench.send(Command::Aprd, at(adp, 0x0502), &[0; 2]).unwrap();
        assert_eq!(control[1] & 0x80, 0x80, "busy");
        bench.wait(Span::ms(2));
        let (answer, wkc) = bench.send(Command::Aprd, at(adp, 0x0502), &[0; 14]).unwrap();
        assert_eq!(wkc, 1);
        assert_eq!(answer[1] & 0x80, 0);
        assert_eq!(answer[2..6], [0x0A, 0, 0, 0]);
        let product = u32::from_le_bytes(answer[6..10].try_into().unwrap());
        let expected = [0x044C_2C52, 0x03F0_3052, 0x07D8_3052][usize::from(position)];
        assert_eq!(product, expected, "word 10 is the product code");
    }
}

// Emulators that keep 0x0300 at 0 let no diagnosis be tested. Each counter moves by its cause, and is
// cleared in its group by any write. S1 14, facts 2.6.
#[test]
fn error_counters_really_move() {
    let mut bench = Bench::plant();
    let noise = FaultEntry::new(FaultName::EmcNoise).at("K1.C>K6.A").with("hits_per_s", 20_000.0);
    bench.inject(&noise);
    for _ in 0..200 {
        bench.send_by(Path::A, &frame(Command::Brd, at(0, 0x0000), &[0; 400]));
    }
    let counters =
        |bench: &mut Bench| bench.send(Command::Aprd, at(0u16.wrapping_sub(5), 0x0300), &[0; 20]);
    let moved = std::iter::repeat_with(|| counters(&mut bench)).flatten().next().unwrap();
    assert_eq!(moved.1, 1);
    assert!(moved.0[0] > 0 && moved.0[1] > 0, "frames and symbols at K6.A: {:?}", moved.0);
    assert_eq!(bench.counter("K6", ErrorCounter::InvalidFrame(Port::B)), 0);
    assert!(bench.counter("K6", ErrorCounter::ProcessingUnit) > 0);
    bench.assert_audit();
}

// The MainDevice itself can take a link down: it tells the PHY to negotiate anew. S2 2.12.
#[test]
fn a_phy_that_negotiates_anew_drops_its_link() {
    let mut bench = Bench::plant();
    assert_eq!(bench.count(), Some(8));
    let command = [0x01, 0x02, 0x02, 0x00, 0x00, 0x33];
    assert_eq!(bench.send(Command::Apwr, at(0, 0x0510), &command).unwrap().1, 1);
    bench.wait(Span::ms(2));
    assert_eq!(bench.count(), Some(5), "K6 to K8 are cut off");
    assert_eq!(bench.counter("K1", ErrorCounter::LostLink(Port::C)), 1);
    assert_eq!(bench.counter("K6", ErrorCounter::LostLink(Port::A)), 1);
    bench.wait(Span::s(2));
    assert_eq!(bench.count(), Some(8));
    bench.assert_audit();
}

// Addressed by its alias, once the use of it is on (0x0100, bit 24). A controller passes frames on before it has
// loaded its SII, so the device is counted first and called by its alias later. facts 1.3, 2.2.
#[test]
fn an_alias_is_loaded_anew_after_a_restart() {
    let mut bench = Bench::new(
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"T2\"\ntype = \"EL3104\"\non = \"K1.B\"\nalias = 4711\n",
    );
    let ask = |bench: &mut Bench| {
        bench.send(Command::Bwr, at(0, 0x0103), &[1]).unwrap();
        bench.send(Command::Fprd, at(4711, 0x0012), &[0; 2]).unwrap()
    };
    let loaded = (4711_u16.to_le_bytes().to_vec(), 1);
    assert_eq!(ask(&mut bench), loaded);
    bench.inject(&FaultEntry::new(FaultName::BrownOut).device("T2"));
    bench.wait(Span::ms(20));
    assert_eq!((bench.count(), ask(&mut bench).1), (Some(1), 0), "it is off");
    bench.wait(Span::ms(80));
    assert_eq!(
        (bench.count(), ask(&mut bench).1),
        (Some(2), 0),
        "it forwards, and has loaded nothing yet"
    );
    bench.wait(Span::ms(200));
    assert_eq!(ask(&mut bench), loaded);
    bench.assert_audit();
}
