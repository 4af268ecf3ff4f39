//! A running segment asked from outside: politely, by many at once, and by those who send garbage.
//! It has no cards here, so no privilege is needed.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::Duration;

use linesman_config::fault::FaultName;
use linesman_proto::time::Instant;
use linesman_runtime::control::message::{Faults, Request, SignalTable};
use linesman_runtime::control::{Control, ask, listen};
use linesman_runtime::serve::report::Status;
use linesman_runtime::serve::{ServeControls, Server};
use linesman_runtime::stop::Stop;
use linesman_runtime::truth_writer::{EventKind, TruthEvent, TruthWriter};
use linesman_runtime::wiring::Wiring;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::{FaultEntry, SegmentFile};
use tempfile::TempDir;

const PLANT: &str = r#"
    name = "asked"
    [[device]]
    name = "K1"
    type = "EK1100"
    on = "maindevice"
    [[device]]
    name = "I1"
    type = "EL1004"
    on = "K1.B"
    [[device]]
    name = "O1"
    type = "EL2004"
    on = "I1.B"
"#;

/// A segment that runs until it is dropped.
struct Running {
    folder: TempDir,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn start() -> Self {
        let file = SegmentFile::parse(PLANT).unwrap();
        let segment = Segment::build(&file).unwrap();
        let wiring = Wiring::of(&segment, &file.project().unwrap());
        let folder = TempDir::new().unwrap();
        let truth_writer =
            TruthWriter::begin(&segment, Some(&folder.path().join("truth"))).unwrap();
        let mut server = Server::open(segment, wiring, &[]).unwrap();
        let socket = folder.path().join("control");
        let control = Control::open(&socket, server.wake_handle(), truth_writer.reading()).unwrap();
        let stop = Stop::default();
        stop.wakes(&server.wake_handle()).unwrap();
        let mut beside = ServeControls { control: Some(control), truth_writer: Some(truth_writer) };
        let thread = {
            let stop = stop.clone();
            std::thread::spawn(move || {
                server.run(Instant::MAX, &stop, &mut beside).unwrap();
                drop(beside.control);
                beside.truth_writer.unwrap().finish().unwrap();
            })
        };
        Self { folder, stop, thread: Some(thread) }
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("control")
    }

    fn ask<T: serde::de::DeserializeOwned>(&self, request: &Request) -> T {
        ask(&self.socket(), request).unwrap()
    }

    fn end(&mut self) {
        self.stop.set();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

fn connect(socket: &Path) -> UnixStream {
    let stream = UnixStream::connect(socket).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    stream
}

/// Sends bytes and reads all answers.
fn exchange(socket: &Path, bytes: &[u8]) -> Vec<Faults> {
    let mut stream = connect(socket);
    stream.write_all(bytes).unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn cut() -> Request {
    let fault = FaultEntry::new(FaultName::LinkOpen).at("K1.B-I1.A");
    Request::Inject { fault: Box::new(fault), for_ms: None }
}

#[test]
fn garbage_is_told_and_harms_nobody() {
    let running = Running::start();
    let socket = running.socket();
    let rows: [(&[u8], usize, &str); 6] = [
        (b"garbage\n", 1, "cannot be read"),
        (b"{\"do\":\"fly\"}\n", 1, "unknown variant `fly`"),
        (b"\xFF\xFE\x00\n", 1, "cannot be read"),
        (b"{\"do\":\"heal\",\"no\":-1}\n", 1, "cannot be read"),
        (b"{\"do\":\"list\"", 1, "cannot be read"),
        (&[b'x'; 100_000], 1, "longer than"),
    ];
    for (bytes, count, words) in rows {
        let answers = exchange(&socket, bytes);
        assert_eq!(answers.len(), count, "{words}");
        let error = answers[0].error.as_ref().unwrap();
        assert!(error.contains(words), "{error}");
    }
    let several = exchange(&socket, b"\n{\"do\":\"list\"}\nhalf\n{\"do\":\"list\"}\n");
    let refused: Vec<bool> = several.iter().map(|answer| answer.error.is_some()).collect();
    assert_eq!(refused, [false, true, false], "one request after another on one connection");
    // Whoever goes away without reading, or says nothing at all, is no harm to others.
    let _silent = connect(&socket);
    connect(&socket).write_all(b"{\"do\":\"list\"}\n").unwrap();
    assert_eq!(running.ask::<Faults>(&Request::List).faults, []);
}

#[test]
fn many_ask_at_once_and_too_many_are_told() {
    let running = Running::start();
    let socket = running.socket();
    let askers: Vec<_> = (0..8)
        .map(|_| {
            let socket = socket.clone();
            std::thread::spawn(move || {
                let mut stream = connect(&socket);
                let mut lines = BufReader::new(stream.try_clone().unwrap());
                for _ in 0..50 {
                    stream.write_all(b"{\"do\":\"list\"}\n").unwrap();
                    let mut line = String::new();
                    lines.read_line(&mut line).unwrap();
                    let answer: Faults = serde_json::from_str(&line).unwrap();
                    assert_eq!(answer.error, None);
                }
            })
        })
        .collect();
    for asker in askers {
        asker.join().unwrap();
    }
    let open: Vec<_> = (0..100).map(|_| connect(&socket)).collect();
    let mut told = 0;
    for stream in &open {
        stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let mut line = String::new();
        if BufReader::new(stream).read_line(&mut line).is_ok() && line.contains("connections") {
            told += 1;
        }
    }
    assert!((60..=70).contains(&told), "{told} of 100 were refused");
    drop(open);
    let again = (0..50).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        ask::<Faults>(&socket, &Request::List).is_ok_and(|answer| answer.error.is_none())
    });
    assert!(again, "there is room again once they are gone");
}

#[test]
fn inputs_are_held_and_released() {
    let running = Running::start();
    let values = |table: &SignalTable| -> Vec<(String, Option<i32>, bool)> {
        let inputs = table.signals.iter().filter(|one| one.name.starts_with("I1"));
        inputs.map(|one| (one.name.clone(), one.value, one.held)).collect()
    };
    let table: SignalTable = running.ask(&Request::Signals);
    assert_eq!(table.signals.len(), 8);
    let wires: Vec<_> = table.signals.iter().filter_map(|one| one.wired_to.as_deref()).collect();
    assert_eq!(wires, ["O1.1", "O1.2", "O1.3", "O1.4"]);
    let set = Request::Set { input: "I1.2".to_owned(), value: 1 };
    let held = values(&running.ask(&set));
    assert_eq!(held[1], ("I1.2".to_owned(), Some(1), true));
    assert_eq!(held[0], ("I1.1".to_owned(), Some(0), false));
    let released = values(&running.ask(&Request::Release { input: None }));
    assert_eq!(released[1], ("I1.2".to_owned(), Some(0), false));
    let rows = [
        ("I1.5", "inputs 1 to 4"),
        ("I1.0", "inputs 1 to 4"),
        ("O1.1", "no input"),
        ("X9.1", "no device `X9`"),
        ("I1", "expected a device and a channel"),
        ("I1.one", "expected a device and a channel"),
    ];
    for (input, words) in rows {
        let request = Request::Set { input: input.to_owned(), value: 1 };
        let error = running.ask::<SignalTable>(&request).error.unwrap();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn what_happens_is_told_while_it_happens_and_written_down() {
    let mut running = Running::start();
    let mut follow = listen(&running.socket(), true).unwrap();
    assert_eq!(running.ask::<Faults>(&cut()).error, None);
    let first: TruthEvent = serde_json::from_str(&follow.next().unwrap().unwrap()).unwrap();
    assert_eq!((first.event, first.fault), (EventKind::Begin, Some(1)));
    assert_eq!(running.ask::<Faults>(&Request::Heal { no: Some(1) }).error, None);
    let error = running.ask::<Faults>(&Request::Heal { no: Some(2) }).error.unwrap();
    assert!(error.contains("no fault 2"), "{error}");
    let end = follow.by_ref().map(|line| line.unwrap()).find(|line| line.contains("\"end\""));
    assert!(end.is_some());
    let status: Status = running.ask(&Request::Status);
    assert_eq!((status.devices, status.frames.received, status.error), (3, 0, None));
    running.end();
    assert!(follow.next().is_none_or(|line| line.is_ok()), "an end, not an error");
    assert!(!running.socket().exists(), "the socket goes with the segment");
    let written = std::fs::read_to_string(running.folder.path().join("truth")).unwrap();
    let kinds: Vec<EventKind> = written
        .lines()
        .map(|line| serde_json::from_str::<TruthEvent>(line).unwrap().event)
        .filter(|kind| *kind != EventKind::Effect)
        .collect();
    assert_eq!(kinds, [EventKind::Begin, EventKind::End]);
}
