//! A running segment from outside: faults, inputs, what happened, how it goes; asked for through a
//! socket in the file system.
//!
//! A request is a line of JSON, and so is its answer ([`message`]); a connection may carry one after
//! another. Threads of their own talk to those who ask; the segment is touched only by the thread
//! that runs it, between two frames.

pub mod message;
mod obey;
mod signals;

use std::fs;
use std::io::{self, BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::thread;
use std::time::Duration;

use linesman_link::socket::Bell;
use serde::de::DeserializeOwned;

use self::message::{Answer, Faults, Request};
pub(crate) use self::obey::obey;
use crate::journal::Reading;

/// Longest request in bytes.
const MOST: u64 = 64 * 1024;
/// Bytes that are read and thrown away behind a request that is too long.
const RUBBISH: u64 = 16 * 1024 * 1024;
/// How long the other side may take to read an answer, and the segment to give it.
const PATIENCE: Duration = Duration::from_secs(2);
/// Requests that may wait for the segment's thread.
const WAITING: usize = 16;
/// Connections at a time.
const CLIENTS: usize = 32;

/// The socket of a segment that runs. It is removed at the end.
pub struct Control {
    path: PathBuf,
    requests: Receiver<Asked>,
}

/// A request, and who waits for its answer.
pub(crate) struct Asked {
    pub(crate) request: Request,
    reply: Sender<Answer>,
}

impl Asked {
    pub(crate) fn answer(self, answer: Answer) {
        // Whoever asked may have lost patience.
        let _ = self.reply.send(answer);
    }
}

/// What a connection's thread needs.
#[derive(Clone)]
struct Desk {
    requests: SyncSender<Asked>,
    bell: Bell,
    reading: Reading,
    clients: Arc<AtomicUsize>,
}

impl Control {
    /// Begins to listen at `path`. What an earlier run left there is replaced. `bell` wakes the
    /// thread that calls [`Control::poll`]; `reading` tells what happened.
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path, bell: Bell, reading: Reading) -> io::Result<Self> {
        if fs::symlink_metadata(path).is_ok() {
            make_room(path)?;
        }
        let listener = UnixListener::bind(path)?;
        hand_over(path);
        let (requests, receiver) = mpsc::sync_channel(WAITING);
        let desk = Desk { requests, bell, reading, clients: Arc::default() };
        // It ends with the process: nothing hangs on it.
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let desk = desk.clone();
                // Whoever asked and went away needs no answer; a thread that cannot be had is as
                // good as a full house.
                let _ = thread::Builder::new().spawn(move || desk.welcome(&stream));
            }
        });
        Ok(Self { path: path.to_owned(), requests: receiver })
    }

    /// The next request.
    pub(crate) fn poll(&self) -> Option<Asked> {
        self.requests.try_recv().ok()
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = fs::remove_file(&self.path);
    }
}

/// Started with sudo, the socket belongs to whoever called it: faults need no privilege.
fn hand_over(path: &Path) {
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse().ok());
    if let (Some(user), Some(group)) = (number("SUDO_UID"), number("SUDO_GID")) {
        // Where that is refused it stays root's, and asking needs sudo as well.
        let _ = std::os::unix::fs::chown(path, Some(user), Some(group));
    }
}

/// Removes the socket of a run that ended without doing so.
fn make_room(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::FileTypeExt as _;
    if UnixStream::connect(path).is_ok() {
        return Err(io::Error::new(io::ErrorKind::AddrInUse, "another segment listens there"));
    }
    if !fs::symlink_metadata(path)?.file_type().is_socket() {
        let what = "there is a file that is no socket";
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, what));
    }
    fs::remove_file(path)
}

impl Desk {
    /// Serves one connection, if there are not too many.
    fn welcome(&self, stream: &UnixStream) -> io::Result<()> {
        let others = self.clients.fetch_add(1, Ordering::Relaxed);
        let served = if others < CLIENTS {
            self.serve(stream)
        } else {
            let error = format!("{CLIENTS} connections are open: close one");
            reply(stream, &Answer::Faults(Faults::refusal(error)))
        };
        self.clients.fetch_sub(1, Ordering::Relaxed);
        served
    }

    /// One request after another, until there is no more.
    fn serve(&self, stream: &UnixStream) -> io::Result<()> {
        stream.set_write_timeout(Some(PATIENCE))?;
        let mut lines = BufReader::new(stream);
        loop {
            let mut line = Vec::new();
            let len = lines.by_ref().take(MOST + 1).read_until(b'\n', &mut line)?;
            if len == 0 {
                return Ok(());
            }
            if len as u64 > MOST {
                let error = format!("the request is longer than {MOST} bytes");
                reply(stream, &Answer::Faults(Faults::refusal(error)))?;
                // Whoever still writes would be cut off, and not read why.
                stream.set_read_timeout(Some(PATIENCE))?;
                return io::copy(&mut lines.take(RUBBISH), &mut io::sink()).map(drop);
            }
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            match serde_json::from_slice::<Request>(&line) {
                Ok(request) => {
                    let answer = self.relay(request.clone());
                    if let (Answer::Events, Request::Events { follow }) = (&answer, request) {
                        self.reading.send_to(stream.try_clone()?, follow);
                        return Ok(());
                    }
                    reply(stream, &answer)?;
                }
                Err(error) => {
                    let error = format!(
                        "the request cannot be read: {error}; expected one line of JSON such as \
                         {{\"do\":\"list\"}}"
                    );
                    reply(stream, &Answer::Faults(Faults::refusal(error)))?;
                }
            }
        }
    }

    /// Asks the thread that runs the segment.
    fn relay(&self, request: Request) -> Answer {
        let (reply, answer) = mpsc::channel();
        let asked = self.requests.try_send(Asked { request, reply });
        self.bell.ring();
        let refused = |why: &str| Answer::Faults(Faults::refusal(why.to_owned()));
        match asked {
            Ok(()) => answer
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|_| refused("the segment gave no answer within 2 s: ask again")),
            Err(_) => refused("too many requests at once, or the segment has ended: ask again"),
        }
    }
}

fn reply(mut stream: &UnixStream, answer: &Answer) -> io::Result<()> {
    let mut text = serde_json::to_string(answer)?;
    text.push('\n');
    stream.write_all(text.as_bytes())
}

/// Asks the segment whose socket is at `path`. `T` is what the request is answered with.
///
/// # Errors
/// When nobody listens there, or the answer cannot be read; what the segment itself refuses is in
/// the answer.
pub fn ask<T: DeserializeOwned>(path: &Path, request: &Request) -> io::Result<T> {
    let mut lines = send(path, request, Some(PATIENCE + PATIENCE))?;
    let mut line = String::new();
    lines.read_line(&mut line)?;
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
    Ok(send(path, &Request::Events { follow }, None)?.lines())
}

fn send(
    path: &Path,
    request: &Request,
    patience: Option<Duration>,
) -> io::Result<BufReader<UnixStream>> {
    let mut stream = UnixStream::connect(path)?;
    stream.set_read_timeout(patience)?;
    let mut text = serde_json::to_string(request)?;
    text.push('\n');
    stream.write_all(text.as_bytes())?;
    Ok(BufReader::new(stream))
}
