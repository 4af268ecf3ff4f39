//! Control of a running segment from outside, through a socket in the file system: faults, inputs,
//! events, status.
//!
//! Requests and answers are in [`message`]; the socket itself is that of [`control_socket`].

mod apply;
pub mod message;
mod signals;

use std::io::{self, BufReader, Lines};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use linesman_link::socket::WakeHandle;
use serde::de::DeserializeOwned;

pub(crate) use self::apply::apply;
use self::message::{Answer, Faults, Request};
pub use crate::control_socket::ControlSocketWatch;
use crate::control_socket::{
    self, Asked, ControlSocket, Protocol, ask_line, ask_lines, foreign_answer,
};
use crate::truth_writer::TruthReader;

/// The socket of a segment that runs. It is removed at the end.
pub struct Control(ControlSocket<SegmentProtocol>);

/// What a segment is asked.
pub(crate) struct SegmentProtocol(TruthReader);

impl Protocol for SegmentProtocol {
    type Request = Request;
    type Order = Request;
    type Reply = Answer;
    type Answer = Answer;
    const WHO: &'static str = "segment";
    const EXAMPLE: &'static str = "{\"do\":\"list\"}";
    const PATIENCE: Duration = Duration::from_secs(2);
    const LONGEST: u64 = control_socket::MOST;

    fn order(request: Request) -> Request {
        request
    }

    fn answer(&self, reply: Answer) -> Answer {
        reply
    }

    fn refusal(&self, why: String) -> Answer {
        Answer::Faults(Faults::refusal(why))
    }

    fn keep(&self, request: &Request, answer: &Answer, stream: &UnixStream) -> io::Result<bool> {
        let (Answer::Events, Request::Events { follow }) = (answer, request) else {
            return Ok(false);
        };
        self.0.send_to(stream.try_clone()?, *follow);
        Ok(true)
    }
}

impl Control {
    /// Begins to listen at `path`. What an earlier run left there is replaced. `wake_handle` wakes the
    /// thread that calls [`Control::poll`]; `reading` tells what happened.
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path, wake_handle: WakeHandle, reading: TruthReader) -> io::Result<Self> {
        ControlSocket::open(path, wake_handle, SegmentProtocol(reading)).map(Self)
    }

    /// For whoever tells that nobody can ask any more.
    #[must_use]
    pub fn watch(&self) -> ControlSocketWatch {
        self.0.watch()
    }

    /// The next request.
    pub(crate) fn poll(&self) -> Option<Asked<SegmentProtocol>> {
        self.0.poll()
    }
}

/// Asks the segment whose socket is at `path`. `T` is what the request is answered with.
///
/// # Errors
/// When nobody listens there, or the answer cannot be read; what the segment itself refuses is in
/// the answer.
pub fn ask<T: DeserializeOwned>(path: &Path, request: &Request) -> io::Result<T> {
    let line = ask_line(path, request, SegmentProtocol::PATIENCE)?;
    serde_json::from_str(&line).map_err(|error| {
        // A refusal is always of the same form.
        let refusal = serde_json::from_str::<Faults>(&line).ok().and_then(|faults| faults.error);
        refusal.map_or_else(|| foreign_answer("a segment", "a run", &error), io::Error::other)
    })
}

/// Asks for what happened; gives line after line until the other side ends.
///
/// # Errors
/// When nobody listens there.
pub fn listen(path: &Path, follow: bool) -> io::Result<Lines<BufReader<UnixStream>>> {
    ask_lines(path, &Request::Events { follow })
}
