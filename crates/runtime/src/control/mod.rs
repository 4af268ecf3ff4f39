//! A running segment from outside: faults, inputs, what happened, how it goes; asked for through a
//! socket in the file system.
//!
//! What can be asked is in [`message`]; the socket itself is that of [`desk`](crate::desk).

pub mod message;
mod obey;
mod signals;

use std::io::{self, BufReader, Lines};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use linesman_link::socket::Bell;
use serde::de::DeserializeOwned;

use self::message::{Answer, Faults, Request};
pub(crate) use self::obey::obey;
pub use crate::desk::DeskWatch;
use crate::desk::{Asked, Desk, Protocol, ask_line, ask_lines};
use crate::journal::Reading;

/// The socket of a segment that runs. It is removed at the end.
pub struct Control(Desk<Faulting>);

/// What a segment is asked.
pub(crate) struct Faulting(Reading);

impl Protocol for Faulting {
    type Request = Request;
    type Given = Answer;
    type Answer = Answer;
    const WHO: &'static str = "segment";
    const EXAMPLE: &'static str = "{\"do\":\"list\"}";
    const PATIENCE: Duration = Duration::from_secs(2);

    fn answer(&self, given: Answer) -> Answer {
        given
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
    /// Begins to listen at `path`. What an earlier run left there is replaced. `bell` wakes the
    /// thread that calls [`Control::poll`]; `reading` tells what happened.
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path, bell: Bell, reading: Reading) -> io::Result<Self> {
        Desk::open(path, bell, Faulting(reading)).map(Self)
    }

    /// For whoever tells that nobody can ask any more.
    #[must_use]
    pub fn watch(&self) -> DeskWatch {
        self.0.watch()
    }

    /// The next request.
    pub(crate) fn poll(&self) -> Option<Asked<Faulting>> {
        self.0.poll()
    }
}

/// Asks the segment whose socket is at `path`. `T` is what the request is answered with.
///
/// # Errors
/// When nobody listens there, or the answer cannot be read; what the segment itself refuses is in
/// the answer.
pub fn ask<T: DeserializeOwned>(path: &Path, request: &Request) -> io::Result<T> {
    let line = ask_line(path, request, Faulting::PATIENCE)?;
    serde_json::from_str(&line).map_err(|error| {
        // A refusal is always of the same form.
        let refusal = serde_json::from_str::<Faults>(&line).ok().and_then(|faults| faults.error);
        refusal.map_or_else(|| error.into(), io::Error::other)
    })
}

/// Asks for what happened; gives line after line until the other side ends.
///
/// # Errors
/// When nobody listens there.
pub fn listen(path: &Path, follow: bool) -> io::Result<Lines<BufReader<UnixStream>>> {
    ask_lines(path, &Request::Events { follow })
}
