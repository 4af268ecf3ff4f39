//! Same seed, same bytes: the captures of two runs are equal to the last bit.

use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::Direction;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_link::capture::{
    CaptureInterfaceId, FrameDirection, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::segment_file::{PlantOptions, plant};

/// The capture of a run of a seed, with a fault in it.
fn capture(seed: u64) -> Vec<u8> {
    let writer = PcapngWriter::new(Vec::new(), "linesman test").unwrap();
    let writer = Arc::new(Mutex::new(Some(writer)));
    let interface =
        InterfaceToWrite { name: "lab0", description: "", link_type: LinkType::Ethernet };
    writer.lock().unwrap().as_mut().unwrap().add_interface(&interface).unwrap();
    let mut file = plant(Seed(seed), &PlantOptions::default());
    let first = file.devices[0].name.clone();
    file.faults.push(
        FaultEntry::new(FaultName::EmcNoise)
            .at(format!("maindevice-{first}.A"))
            .with("hits_per_s", 2_000.0)
            .from_to(100.0, None),
    );
    let mut lab = Lab::new(&file, LabOptions::default()).unwrap();
    let sink = Arc::clone(&writer);
    lab.set_tap(Box::new(move |seen| {
        let frame = FrameToWrite {
            interface: CaptureInterfaceId(0),
            time: UnixTime::from_nanos(seen.time.as_nanos().into()),
            direction: match seen.direction {
                Direction::Sent => FrameDirection::Outgoing,
                Direction::Received => FrameDirection::Incoming,
                Direction::Unknown => FrameDirection::Unknown,
            },
            with_fcs: false,
            crc_error: false,
            original_len: None,
            bytes: seen.bytes,
        };
        if let Some(writer) = sink.lock().unwrap().as_mut() {
            writer.write_frame(&frame).unwrap();
        }
    }));
    lab.run_until(Instant::ZERO + Span::s(2)).unwrap();
    let writer = writer.lock().unwrap().take().unwrap();
    writer.finish().unwrap()
}

#[test]
fn the_same_seed_gives_the_same_capture() {
    let (one, again, other) = (capture(5), capture(5), capture(6));
    assert!(one.len() > 100_000, "{} bytes: the line was not at work", one.len());
    assert!(one == again, "two runs of seed 5 differ");
    assert!(one != other, "seeds 5 and 6 give the same");
}
