//! Faults of a segment while it runs: asked for through a socket in the file system.
//!
//! One connection carries one request, a line of JSON, and its answer, another line. A thread of
//! its own waits for connections; the segment is touched only by the thread that runs it.

use std::fs;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::Duration;

use linesman_config::fault::FaultName;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;
use linesman_proto::topology::End;
use linesman_sim::segment::Segment;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::{FaultId, FaultRecord, Place};
use serde::{Deserialize, Serialize};

/// Name and version of the answer's format.
pub const SCHEMA: &str = "linesman.faults/1";
/// Longest request in bytes.
const MOST: u64 = 64 * 1024;
/// How long the other side may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// Requests that may wait for the segment's thread.
const WAITING: usize = 16;

/// What can be asked.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// Put a fault on the line now.
    Inject {
        /// Its kind, place, parameters and schedule; it begins with the request.
        fault: FaultEntry,
        /// How long it lasts, in ms; until it is healed unless said.
        for_ms: Option<f64>,
    },
    /// End a fault, or all of them.
    Heal {
        /// Its number; all unless said.
        no: Option<u32>,
    },
    /// Only tell what there is.
    List,
}

/// What is said: all faults so far, and why a request was refused.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// `linesman.faults/1`.
    pub schema: String,
    /// Why the request was refused; `null` when it was done.
    pub error: Option<String>,
    /// The faults of the run, oldest first.
    pub faults: Vec<FaultState>,
}

/// A fault and what came of it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaultState {
    /// Its number, from 1, in the order of injection.
    pub no: u32,
    /// What it is.
    pub name: FaultName,
    /// Where: links as `K1.C-B3.A`, directions as `K1.C>B3.A`, devices by name.
    pub places: Vec<String>,
    /// When it began, in ns since the start of the segment; `null` when it has not yet.
    pub began_ns: Option<u64>,
    /// When it ended; `null` while it lasts.
    pub ended_ns: Option<u64>,
    /// Frames it spoiled.
    pub frames_spoiled: u64,
    /// Frames it made vanish.
    pub frames_lost: u64,
}

/// The socket of a segment that runs. It is removed at the end.
pub struct Control {
    path: PathBuf,
    requests: Receiver<(Request, Sender<Answer>)>,
}

impl Control {
    /// Begins to listen at `path`. What an earlier run left there is replaced.
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path) -> io::Result<Self> {
        if path.exists() {
            if UnixStream::connect(path).is_ok() {
                let what = "another segment listens there";
                return Err(io::Error::new(io::ErrorKind::AddrInUse, what));
            }
            let is_socket = {
                use std::os::unix::fs::FileTypeExt as _;
                fs::symlink_metadata(path)?.file_type().is_socket()
            };
            if !is_socket {
                let what = "there is a file that is no socket";
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, what));
            }
            fs::remove_file(path)?;
        }
        let listener = UnixListener::bind(path)?;
        let (sender, requests) = mpsc::sync_channel(WAITING);
        // It ends with the process: nothing hangs on it.
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let relay = |request| {
                    let (reply, answer) = mpsc::channel();
                    sender.try_send((request, reply)).map_err(io::Error::other)?;
                    answer.recv_timeout(PATIENCE).map_err(io::Error::other)
                };
                // Whoever asked and went away needs no answer.
                let _ = answer_one(&stream, relay);
            }
        });
        Ok(Self { path: path.to_owned(), requests })
    }

    /// Does what was asked for since the last call.
    pub fn serve(&self, now: Instant, segment: &mut Segment) {
        while let Ok((request, reply)) = self.requests.try_recv() {
            let error = obey(request, now, segment).err();
            let faults = segment.truth().faults().iter().map(|fault| state(fault, segment));
            let answer = Answer { schema: SCHEMA.to_owned(), error, faults: faults.collect() };
            // Whoever asked may have lost patience.
            let _ = reply.send(answer);
        }
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = fs::remove_file(&self.path);
    }
}

fn answer_one(
    mut stream: &UnixStream,
    relay: impl FnOnce(Request) -> io::Result<Answer>,
) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut line = String::new();
    BufReader::new(stream.take(MOST)).read_line(&mut line)?;
    let answer = match serde_json::from_str(&line) {
        Ok(request) => relay(request)?,
        Err(error) => {
            let error = Some(format!("the request cannot be read: {error}"));
            Answer { schema: SCHEMA.to_owned(), error, faults: Vec::new() }
        }
    };
    let mut text = serde_json::to_string(&answer)?;
    text.push('\n');
    stream.write_all(text.as_bytes())
}

/// Asks the segment whose socket is at `path`.
///
/// # Errors
/// When nobody listens there, or the answer cannot be read.
pub fn ask(path: &Path, request: &Request) -> io::Result<Answer> {
    let mut stream = UnixStream::connect(path)?;
    stream.set_read_timeout(Some(PATIENCE + PATIENCE))?;
    let mut text = serde_json::to_string(request)?;
    text.push('\n');
    stream.write_all(text.as_bytes())?;
    let mut line = String::new();
    BufReader::new(&stream).read_line(&mut line)?;
    Ok(serde_json::from_str(&line)?)
}

fn obey(request: Request, now: Instant, segment: &mut Segment) -> Result<(), String> {
    match request {
        Request::List => Ok(()),
        Request::Inject { mut fault, for_ms } => {
            if for_ms.is_some_and(|ms| !(ms > 0.0 && ms < 1e12)) {
                return Err("for how long: expected a number of ms above 0".to_owned());
            }
            // Times of the segment, which began before the request.
            let now_ms = now.as_nanos() as f64 / 1e6;
            fault.from_ms = for_ms.map(|_| now_ms);
            fault.to_ms = for_ms.map(|ms| now_ms + ms);
            // Its schedule counts from its begin, which is now.
            segment.inject(now, &fault).map(drop).map_err(|error| error.to_string())
        }
        Request::Heal { no } => {
            let count = segment.truth().faults().len() as u32;
            let healed = match no {
                None => 0..count,
                Some(no) if (1..=count).contains(&no) => no - 1..no,
                Some(no) => return Err(format!("there is no fault {no}, there are {count}")),
            };
            for fault in healed {
                segment.heal(now, FaultId(fault));
            }
            Ok(())
        }
    }
}

fn state(fault: &FaultRecord, segment: &Segment) -> FaultState {
    FaultState {
        no: fault.id.0 + 1,
        name: fault.name,
        places: fault.places.iter().map(|place| text(place, segment)).collect(),
        began_ns: fault.began.map(Instant::as_nanos),
        ended_ns: fault.ended.map(Instant::as_nanos),
        frames_spoiled: fault.frames_spoiled,
        frames_lost: fault.frames_lost,
    }
}

fn text(place: &Place, segment: &Segment) -> String {
    let end = |end: &End<DeviceId>| match end {
        End::MainDevice(path) => format!("maindevice.{path}"),
        End::Controller(id, port) => format!("{}.{port}", segment.name(*id)),
    };
    match place {
        Place::Direction(from, to) => format!("{}>{}", end(from), end(to)),
        Place::Link(one, other) => format!("{}-{}", end(one), end(other)),
        Place::Device(id) => segment.name(*id).to_owned(),
        Place::Host(path) => format!("maindevice.{path}"),
    }
}
