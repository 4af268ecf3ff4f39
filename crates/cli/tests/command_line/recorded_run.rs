//! A run of the published frame plan on 46 SubDevices, recorded and read back: what the frames on the wire hold, sent and
//! come back.

use std::cell::RefCell;
use std::fs::{self, File};
use std::path::Path as FilePath;
use std::process::Command as Program;
use std::rc::Rc;
use std::sync::mpsc::sync_channel;

use crate::ads::{BRIDGE, BRIDGE_NET_ID};
use crate::support::linesman;
use crate::support::running::project_of;
use linesman_diagnosis::HostObservation;
use linesman_link::capture::{
    CaptureInterfaceId, CaptureReader, FrameToWrite, InterfaceToWrite, LinkType, PcapngWriter,
};
use linesman_link::direction::FrameDirection;
use linesman_link::error::LinkError;
use linesman_link::unix_time::UnixTime;
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::frame::FrameView;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::named_files::NamedFiles;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::{Idle, PlanSource, RunControls, SessionOptions, run};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{FrameSink, RxFrame, Transport};
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::SegmentFile;
use tempfile::TempDir;

/// When, which way, and what.
type Seen = (Instant, FrameDirection, Vec<u8>);

/// A segment in virtual time, and all frames at the card.
struct Recorded {
    segment: Segment,
    now: Instant,
    arrival: Vec<u8>,
    seen: Rc<RefCell<Vec<Seen>>>,
}

impl Transport for Recorded {
    type Error = LinkError;

    fn options(&self) -> Options {
        Options::default().on_line(self.segment.tree().len(), self.segment.longest_way())
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn receive(&mut self, now: Instant, intake: &mut dyn FrameSink) -> Result<usize, LinkError> {
        self.segment.advance(now);
        let mut count = 0;
        while let Some(came) = self.segment.poll_arrival(&mut self.arrival) {
            count += 1;
            let len = self.arrival.len();
            let frame = (came.at, FrameDirection::Incoming, self.arrival.clone());
            self.seen.borrow_mut().push(frame);
            intake.room()[..len].copy_from_slice(&self.arrival);
            intake.frame_received(RxFrame { at: came.at, path: came.path, len, truncated: false });
        }
        Ok(count)
    }

    fn send(&mut self, path: Path, frame: &[u8]) -> Result<(), LinkError> {
        self.seen.borrow_mut().push((self.now, FrameDirection::Outgoing, frame.to_vec()));
        self.segment.handle_frame(self.now, path, frame);
        Ok(())
    }

    fn look_at_host(
        &mut self,
        _: Instant,
        _: &mut dyn FnMut(&HostObservation),
    ) -> Result<(), LinkError> {
        Ok(())
    }

    fn wait(&mut self, deadline: Instant) -> Result<(), LinkError> {
        let due = self.segment.poll_timeout().map_or(deadline, |at| at.min(deadline));
        self.now = self.now.max(due);
        Ok(())
    }

    fn note_late(&mut self, _: Span) {}
}

/// Runs a project on the segment that is made of it, and writes what was seen to a file.
fn record(folder: &FilePath, project: &str) -> std::path::PathBuf {
    let path = |name: &str| folder.join(name);
    let (plan, segment, capture) = (path("plan.toml"), path("segment.toml"), path("run.pcapng"));
    fs::write(&plan, project).unwrap();
    let made = linesman(["plan", plan.to_str().unwrap(), "--segment", segment.to_str().unwrap()]);
    assert!(made.status <= 1, "{}", made.all());
    let text = fs::read_to_string(&segment).unwrap();
    let file = SegmentFile::parse_with(&text, &NamedFiles::of(&segment)).unwrap();
    let seen = Rc::default();
    let line = Recorded {
        segment: Segment::build(&file).unwrap(),
        now: Instant::ZERO,
        arrival: Vec::new(),
        seen: Rc::clone(&seen),
    };
    let plan = PlanSource::Plan(Box::new(PlanFile::open(&plan).unwrap().plan));
    let options = SessionOptions {
        on: "recorded".to_owned(),
        leave: AlState::Init,
        lasts: Some(Span::s(3)),
        real_time: None,
        allowed_misses: Some(2),
        hold: false,
        diagnose: None,
        group: None,
    };
    let (notes, _told) = sync_channel(1);
    let stop = Stop::default();
    let beside = RunControls::new(&stop, notes);
    let ended = run(line, plan, Idle, &options, beside).unwrap();
    assert!(ended.error.is_none() && ended.report.reached_ns.is_some());
    let mut writer = PcapngWriter::new(File::create(&capture).unwrap(), "linesman").unwrap();
    let link_type = LinkType::Ethernet;
    writer.add_interface(&InterfaceToWrite { name: "card", description: "", link_type }).unwrap();
    for (at, direction, bytes) in seen.take() {
        let at = UnixTime::from_nanos(i128::from(at.as_nanos()));
        writer
            .write_frame(&FrameToWrite::new(CaptureInterfaceId(0), at, direction, &bytes))
            .unwrap();
    }
    writer.finish().unwrap();
    capture
}

/// The published project.
fn published() -> String {
    let path = format!("{}/tests/data/plan/516-bytes.toml", env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(path).unwrap()
}

/// The same in which the twentieth SubDevice is the first with a clock.
fn with_the_twentieth_as_reference() -> String {
    let clock = "clock = { assign_activate = 0x0300 }\n";
    let text = published().replace(clock, "");
    let (at, _) = text.match_indices("[device.description]").nth(19).unwrap();
    format!("{}{clock}{}", &text[..at], &text[at..])
}

/// One datagram: command, index, address as its two words, length, round trip, more follows, events, working counter.
type Header = (u8, u8, u16, u16, usize, bool, bool, u16, u16);

/// The last two frames of the full size, as they went out and came back: the frame and its datagrams' headers.
fn last_cycle(capture: &FilePath) -> [(Vec<u8>, Vec<Header>); 2] {
    let mut reader = CaptureReader::open(capture).unwrap();
    let mut last: [Option<Vec<u8>>; 2] = [None, None];
    while let Some(frame) = reader.next_frame() {
        if frame.bytes.len() == 516 {
            last[usize::from(frame.direction == FrameDirection::Incoming)] =
                Some(frame.bytes.to_vec());
        }
    }
    last.map(|bytes| {
        let bytes = bytes.expect("a frame of 516 bytes");
        let view = FrameView::parse(&bytes).unwrap();
        let headers = view.datagrams().map(|datagram| {
            let datagram = datagram.unwrap();
            let command = datagram.code();
            let (adp, ado) = (datagram.adp(), datagram.ado().0);
            (
                command,
                datagram.index(),
                adp,
                ado,
                datagram.data().len(),
                datagram.circulated(),
                datagram.more_follow(),
                datagram.irq(),
                datagram.wkc().value(),
            )
        });
        let headers = headers.collect();
        (bytes, headers)
    })
}

// S0 L131-137, L2721-2751.
// proves: FRM-06 (P), FRM-11 (P), FRM-13 (P)
#[test]
fn recorded_frame_of_516_bytes_has_the_seven_published_datagrams() {
    let folder = TempDir::new().unwrap();
    let capture = record(folder.path(), &published());
    let [(sent, out), (_, back)] = last_cycle(&capture);
    // 500 bytes of datagrams, 416 of them data; type 1.
    assert_eq!(sent[14..16], [0xF4, 0x11]);
    assert_eq!(out.iter().map(|header| header.4).sum::<usize>(), 416);
    // Those that have a clock take the time.
    let with_clock = back[1].8;
    assert!((7..=46).contains(&with_clock), "{with_clock}");
    let commands: Vec<(u8, u16, usize, u16)> =
        back.iter().map(|header| (header.0, header.3, header.4, header.8)).collect();
    assert_eq!(
        commands,
        [
            (0, 0x0900, 4, 0),
            (13, 0x0910, 4, with_clock),
            (10, 0x0900, 3, 18),
            (12, 0x0100, 150, 21),
            (11, 0x0100, 33, 17),
            (10, 0x0100, 220, 19),
            (7, 0x0130, 2, 46),
        ]
    );
    assert!(out.iter().all(|header| header.8 == 0), "working counters begin at 0: {out:?}");
    let more: Vec<bool> = out.iter().map(|header| header.6).collect();
    assert_eq!(more, [true, true, true, true, true, true, false]);
    assert!(back.iter().all(|header| !header.5), "none has circulated");
    referee(&capture, &back);
}

/// tshark reads the same from the last frame of that size that came back, where it is installed.
fn referee(capture: &FilePath, back: &[Header]) {
    let fields = ["ecat.cmd", "ecat.idx", "ecat.subframe.length", "ecat.subframe.more", "ecat.cnt"];
    let mut tshark = Program::new("tshark");
    tshark.arg("-r").arg(capture).args(["-Y", "frame.len == 516", "-T", "fields"]);
    for field in fields {
        tshark.args(["-e", field]);
    }
    let Ok(output) = tshark.output() else {
        eprintln!("SKIPPED: tshark is not here to judge the recorded frame");
        return;
    };
    let text = String::from_utf8(output.stdout).unwrap();
    let number = |word: &str| match word.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).unwrap(),
        None => match word {
            "True" => 1,
            "False" => 0,
            word => word.parse().unwrap(),
        },
    };
    let row = text.lines().last().unwrap();
    let columns: Vec<Vec<u64>> =
        row.split('\t').map(|column| column.split(',').map(number).collect()).collect();
    let ours: Vec<Vec<u64>> = [
        back.iter().map(|header| header.0.into()).collect(),
        back.iter().map(|header| header.1.into()).collect(),
        back.iter().map(|header| header.4 as u64).collect(),
        back.iter().map(|header| header.6.into()).collect(),
        back.iter().map(|header| header.8.into()).collect(),
    ]
    .into();
    assert_eq!(columns, ours, "{row}");
}

// S0 L2736, S1 L1483-1492: 46 SubDevices each add 1 to the address; the reference clock is the twentieth.
// proves: FRM-03 (P), DC-03 (P)
#[test]
fn recorded_addresses_have_grown_by_46_and_name_the_twentieth_as_reference_clock() {
    let folder = TempDir::new().unwrap();
    let capture = record(folder.path(), &with_the_twentieth_as_reference());
    let [(_, out), (_, back)] = last_cycle(&capture);
    let addresses = |headers: &[Header], command: u8| -> Vec<u16> {
        headers.iter().filter(|header| header.0 == command).map(|header| header.2).collect()
    };
    // BRD, then ARMW.
    assert_eq!((addresses(&out, 7), addresses(&back, 7)), (vec![0], vec![0x2E]));
    assert_eq!((addresses(&out, 13), addresses(&back, 13)), (vec![0xFFED], vec![0x001B]));
}

// proves: WS-05 (P)
#[test]
fn recorded_run_of_46_subdevices_is_surveyed_from_its_frames() {
    let folder = TempDir::new().unwrap();
    let path = record(folder.path(), &with_the_twentieth_as_reference());
    let info = crate::capture_info::info(&path);
    assert_eq!(info["network"]["devices"], 46);
    assert_eq!(info["network"]["reference_clock"]["no"], 20);
    assert_eq!(info["network"]["mailboxes"]["count"], 18);
    assert_eq!(info["links"].as_array().unwrap().len(), 46);
    let frame = info["cyclic"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|frame| frame["bytes"] == 516)
        .max_by_key(|frame| frame["count"].as_u64())
        .unwrap();
    let expected: Vec<u64> = frame["datagrams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["expected"].as_u64().unwrap())
        .collect();
    assert_eq!((expected[2], expected[3], expected[4], expected[5]), (18, 21, 17, 19));
    // Who adds to a working counter has an FMMU there.
    let owners = frame["datagrams"][5]["owners"].as_array().unwrap();
    assert_eq!(owners.len(), 19, "{frame}");
    let states = info["states"].as_array().unwrap();
    let reached = states.iter().any(|one| one["what"] == "read" && one["state"] == "OP");
    assert!(reached, "{states:?}");
}

#[test]
fn recorded_request_of_ads_and_its_answer_are_dissected_alike() {
    let folder = TempDir::new().unwrap();
    let project = project_of(BRIDGE, BRIDGE_NET_ID);
    let capture = record(folder.path(), &project);
    let fields = [
        "ams.targetnetid",
        "ams.targetport",
        "ams.sendernetid",
        "ams.senderport",
        "ams.cmdid",
        "ams.stateflags",
        "ams.cbdata",
        "ams.errorcode",
        "ams.invokeid",
        "ams.ads_indexgroup",
        "ams.ads_indexoffset",
        "ams.adsresult",
    ];
    let mut tshark = Program::new("tshark");
    tshark.arg("-r").arg(&capture).args(["-Y", "ams", "-T", "fields", "-E", "separator=|"]);
    for field in fields {
        tshark.args(["-e", field]);
    }
    let Ok(output) = tshark.output() else {
        eprintln!("SKIPPED: tshark is not here to judge the recorded messages");
        return;
    };
    let text = String::from_utf8(output.stdout).unwrap();
    let mut rows: Vec<&str> = text.lines().collect();
    // A message is seen where it goes out, and where the frame comes back with it.
    rows.dedup();
    let request = "10.0.0.7.3.1|65535|127.0.0.1.2.1|65535|3|0x0004|18|0x00000000|0x00000001|0x00000001|0x00000003|";
    let answer =
        "127.0.0.1.2.1|65535|10.0.0.7.3.1|65535|3|0x0005|4|0x00000000|0x00000001|||0x00000000";
    assert_eq!(rows, [request, answer], "{text}");
}
