//! Control socket of a running program in the file system: a line of JSON each way.
//!
//! A connection may carry one request after another. Threads of their own talk to those who ask; what
//! is asked is done by the one thread that runs the line, between two frames. What may be asked, and
//! what is answered, is the business of a [`Protocol`].

mod long_line;

use std::fs;
use std::io::{self, BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use linesman_link::socket::WakeHandle;
use serde::Serialize;
use serde::de::DeserializeOwned;

use self::long_line::{SendTime, read_rest};
use crate::part::guard;
use crate::watched_file::WatchedFile;

/// Longest request in bytes that may come on every connection at once.
pub(crate) const MOST: u64 = 64 * 1024;
/// Longer ones at a time.
const LONG_ONES: usize = 4;
/// Bytes that are read and thrown away behind a request that is too long.
const DISCARD_MAX: u64 = 16 * 1024 * 1024;
/// Time for all of a long request: far more than 64 MiB take on a busy computer.
const LONG_TIME: Duration = Duration::from_secs(30);
/// How long the other side may take to read an answer, or to send the next part of a request.
const PATIENCE: Duration = Duration::from_secs(2);
/// Requests that may wait for the thread that does them.
const WAITING: usize = 16;
/// How long no connection is taken after one could not be: there may be too many open files.
const REST: Duration = Duration::from_millis(100);
/// Connections at a time.
const CLIENTS: usize = 32;

/// What is asked and answered.
pub(crate) trait Protocol: Send + Sync + 'static {
    /// What can be asked.
    type Request: DeserializeOwned + Clone;
    /// A request as the thread that runs the line takes it: read to its end.
    type Order: Send;
    /// What the thread that runs the line gives.
    type Reply: Send;
    /// What is answered.
    type Answer: Serialize;
    /// Who is asked, for messages: `segment`.
    const WHO: &'static str;
    /// A request, for messages.
    const EXAMPLE: &'static str;
    /// How long an answer may take.
    const PATIENCE: Duration;
    /// Longest request in bytes.
    const LONGEST: u64;

    /// Reads a request to its end. Threads that talk to those who ask do that, too.
    fn order(request: Self::Request) -> Self::Order;

    /// What is answered when this was given. Threads that talk to those who ask do that, so that the
    /// one that runs the line need not put anything into words.
    fn answer(&self, reply: Self::Reply) -> Self::Answer;

    /// Why a request was not done.
    fn refusal(&self, why: String) -> Self::Answer;

    /// Keeps a connection to itself from here on, instead of answering. Says whether it has.
    fn keep(
        &self,
        request: &Self::Request,
        answer: &Self::Answer,
        stream: &UnixStream,
    ) -> io::Result<bool>;
}

/// The socket. It is removed at the end.
pub(crate) struct ControlSocket<P: Protocol> {
    path: PathBuf,
    requests: Receiver<Asked<P>>,
    watch: ControlSocketWatch,
}

/// Whether a socket can still be asked.
#[derive(Clone, Debug)]
pub struct ControlSocketWatch {
    socket: WatchedFile,
    /// Why nobody listens any more.
    failed: Arc<Mutex<Option<String>>>,
    /// Closed in order: nothing is wrong with that.
    closed: Arc<AtomicBool>,
}

impl ControlSocketWatch {
    /// Why nobody can ask any more, with the next step; `None` while all is well.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        if self.closed.load(Ordering::Acquire) {
            return None;
        }
        let failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let path = self.socket.path().display();
        failed.map(|why| format!("{path}: {why}")).or_else(|| {
            let error = self.socket.check().err()?;
            // It may have been closed between the two.
            if self.closed.load(Ordering::Acquire) {
                return None;
            }
            Some(format!(
                "{path}: the control socket: {error}, so nobody can ask any more. Do: start the command anew, and \
                 leave the socket where it is"
            ))
        })
    }
}

/// A request, and who waits for its answer.
pub(crate) struct Asked<P: Protocol> {
    pub(crate) order: P::Order,
    pub(crate) requester: Requester<P>,
}

/// Way back to whoever waits for an answer.
pub(crate) struct Requester<P: Protocol>(Sender<P::Reply>);

impl<P: Protocol> Requester<P> {
    pub(crate) fn give(self, reply: P::Reply) {
        // Whoever asked may have lost patience.
        let _ = self.0.send(reply);
    }
}

/// Way of requests to the thread that does them.
pub(crate) struct RequestSender<P: Protocol> {
    requests: SyncSender<Asked<P>>,
    wake_handle: WakeHandle,
    protocol: P,
}

/// A way of requests, and its end at the thread that does them, which `wake_handle` wakes.
pub(crate) fn request_queue<P: Protocol>(
    wake_handle: WakeHandle,
    protocol: P,
) -> (RequestSender<P>, Receiver<Asked<P>>) {
    let (requests, receiver) = mpsc::sync_channel(WAITING);
    (RequestSender { requests, wake_handle, protocol }, receiver)
}

impl<P: Protocol> RequestSender<P> {
    /// Sends a request; `None` when too many wait, or nobody does them any more.
    pub(crate) fn send(&self, request: P::Request) -> Option<SentRequest<P>> {
        let (reply, answer) = mpsc::channel();
        let asked = Asked { order: P::order(request), requester: Requester(reply) };
        let asked = self.requests.try_send(asked);
        self.wake_handle.wake();
        asked.ok().map(|()| SentRequest(answer))
    }

    /// The answer to a request; `None` when there was none within [`Protocol::PATIENCE`].
    pub(crate) fn receive(&self, SentRequest(answer): &SentRequest<P>) -> Option<P::Answer> {
        answer.recv_timeout(P::PATIENCE).ok().map(|reply| self.protocol.answer(reply))
    }
}

/// A request whose answer is waited for.
pub(crate) struct SentRequest<P: Protocol>(Receiver<P::Reply>);

/// Rest of a connection after a request.
enum After {
    /// The next one.
    Next,
    /// Nothing: the protocol keeps the connection.
    Kept,
    /// Nothing: the request was refused, and is not read to its end.
    Unread,
}

/// Shared parts of the threads of connections.
struct Connection<P: Protocol> {
    sender: RequestSender<P>,
    clients: AtomicUsize,
    /// Those of them whose request is a long one.
    long: AtomicUsize,
}

impl<P: Protocol> ControlSocket<P> {
    /// Begins to listen at `path`. What an earlier run left there is replaced. `wake_handle` wakes the
    /// thread that calls [`ControlSocket::poll`].
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub(crate) fn open(path: &Path, wake_handle: WakeHandle, protocol: P) -> io::Result<Self> {
        if fs::symlink_metadata(path).is_ok() {
            make_room(path, P::WHO)?;
        }
        let listener = UnixListener::bind(path)?;
        hand_over(path);
        let (sender, receiver) = request_queue(wake_handle, protocol);
        let connection = Arc::new(Connection {
            sender,
            clients: AtomicUsize::default(),
            long: AtomicUsize::default(),
        });
        let failed = Arc::default();
        let (socket, closed) = (WatchedFile::at(path), Arc::default());
        let watch = ControlSocketWatch { socket, failed: Arc::clone(&failed), closed };
        // It ends with the process: nothing hangs on it.
        thread::Builder::new().name("control".to_owned()).spawn(move || {
            let listened = guard("the control socket", "nobody can ask any more", || {
                listen(&listener, &connection);
            });
            if let Err(failure) = listened {
                *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure.to_string());
            }
        })?;
        Ok(Self { path: path.to_owned(), requests: receiver, watch })
    }

    /// For whoever tells that nobody can ask any more.
    pub(crate) fn watch(&self) -> ControlSocketWatch {
        self.watch.clone()
    }

    /// The next request.
    pub(crate) fn poll(&self) -> Option<Asked<P>> {
        self.requests.try_recv().ok()
    }
}

impl<P: Protocol> Drop for ControlSocket<P> {
    fn drop(&mut self) {
        self.watch.closed.store(true, Ordering::Release);
        // It may be gone already, and what is there now is somebody else's.
        if self.watch.socket.check().is_ok() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Takes one connection after another.
fn listen<P: Protocol>(listener: &UnixListener, connection: &Arc<Connection<P>>) {
    for stream in listener.incoming() {
        let Ok(stream) = stream else {
            thread::sleep(REST);
            continue;
        };
        let connection = Arc::clone(connection);
        // Whoever asked and went away needs no answer; a thread that cannot be had is as good as a full house.
        let _ = thread::Builder::new().spawn(move || connection.welcome(&stream));
    }
}

/// Started with sudo, the socket belongs to whoever called it: asking needs no privilege.
fn hand_over(path: &Path) {
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse().ok());
    if let (Some(user), Some(group)) = (number("SUDO_UID"), number("SUDO_GID")) {
        // Where that is refused it stays root's, and asking needs sudo as well.
        let _ = std::os::unix::fs::chown(path, Some(user), Some(group));
    }
}

/// Removes the socket of a run that ended without doing so.
fn make_room(path: &Path, who: &str) -> io::Result<()> {
    use std::os::unix::fs::FileTypeExt as _;
    if UnixStream::connect(path).is_ok() {
        let what = format!("another {who} listens there");
        return Err(io::Error::new(io::ErrorKind::AddrInUse, what));
    }
    if !fs::symlink_metadata(path)?.file_type().is_socket() {
        let what = "there is a file that is no socket";
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, what));
    }
    fs::remove_file(path)
}

impl<P: Protocol> Connection<P> {
    /// Serves one connection, if there are not too many.
    fn welcome(&self, stream: &UnixStream) -> io::Result<()> {
        let others = self.clients.fetch_add(1, Ordering::Relaxed);
        let served = if others < CLIENTS {
            // Whoever asked sees that the connection ends; the next one is served.
            guard("a connection to the control socket", "it is closed", || self.serve(stream))
                .unwrap_or(Ok(()))
        } else {
            self.refuse(stream, format!("{CLIENTS} connections are open: close one"))
        };
        self.clients.fetch_sub(1, Ordering::Relaxed);
        served
    }

    fn refuse(&self, stream: &UnixStream, why: String) -> io::Result<()> {
        reply(stream, &self.sender.protocol.refusal(why))
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
            let after = match len as u64 <= MOST {
                true => self.answer(stream, &line)?,
                false => {
                    let others = self.long.fetch_add(1, Ordering::Relaxed);
                    let answered = self.answer_long(stream, &mut lines, line, others);
                    self.long.fetch_sub(1, Ordering::Relaxed);
                    answered?
                }
            };
            match after {
                After::Next => {}
                After::Kept => return Ok(()),
                After::Unread => {
                    // Whoever still writes would be cut off, and not read why.
                    stream.set_read_timeout(Some(PATIENCE))?;
                    return io::copy(&mut lines.take(DISCARD_MAX), &mut io::sink()).map(drop);
                }
            }
        }
    }

    /// Reads the rest of a long request, while `others` are under way, and answers it.
    fn answer_long(
        &self,
        stream: &UnixStream,
        lines: &mut BufReader<&UnixStream>,
        mut line: Vec<u8>,
        others: usize,
    ) -> io::Result<After> {
        if P::LONGEST > MOST {
            if others >= LONG_ONES {
                self.refuse(stream, format!("{LONG_ONES} long requests are under way: ask again"))?;
                return Ok(After::Unread);
            }
            // Whoever has begun may not keep others waiting.
            let time = SendTime { pause: PATIENCE, whole: LONG_TIME };
            if !read_rest(stream, lines, &mut line, P::LONGEST, time)? {
                let (pause, whole) = (PATIENCE.as_secs(), LONG_TIME.as_secs());
                let why = format!(
                    "the request did not end: {} bytes of it came, expected all of it within {whole} s, without a pause of \
                     {pause} s: send it anew",
                    line.len()
                );
                self.refuse(stream, why)?;
                return Ok(After::Unread);
            }
        }
        if line.len() as u64 > P::LONGEST {
            self.refuse(stream, format!("the request is longer than {} bytes", P::LONGEST))?;
            return Ok(After::Unread);
        }
        self.answer(stream, &line)
    }

    /// Does what a line asks for.
    fn answer(&self, stream: &UnixStream, line: &[u8]) -> io::Result<After> {
        if line.iter().all(u8::is_ascii_whitespace) {
            return Ok(After::Next);
        }
        match serde_json::from_slice::<P::Request>(line) {
            Ok(request) => {
                let answer = self.relay(request.clone());
                if self.sender.protocol.keep(&request, &answer, stream)? {
                    return Ok(After::Kept);
                }
                reply(stream, &answer)?;
            }
            Err(error) => {
                let example = P::EXAMPLE;
                self.refuse(
                    stream,
                    format!(
                        "the request cannot be read: {error}; expected one line of JSON such as \
                         {example}"
                    ),
                )?;
            }
        }
        Ok(After::Next)
    }

    /// Asks the thread that runs the line.
    fn relay(&self, request: P::Request) -> P::Answer {
        let (who, seconds) = (P::WHO, P::PATIENCE.as_secs());
        let why = match self.sender.send(request) {
            Some(sent) => match self.sender.receive(&sent) {
                Some(answer) => return answer,
                None => format!("the {who} gave no answer within {seconds} s: ask again"),
            },
            None => format!("too many requests at once, or the {who} has ended: ask again"),
        };
        self.sender.protocol.refusal(why)
    }
}

fn reply<T: Serialize>(mut stream: &UnixStream, answer: &T) -> io::Result<()> {
    let mut text = serde_json::to_string(answer)?;
    text.push('\n');
    stream.write_all(text.as_bytes())
}

/// Asks whoever listens at `path`; gives the line that is answered.
///
/// # Errors
/// When nobody listens there, or nothing is answered in time.
pub(crate) fn ask_line<Q: Serialize>(
    path: &Path,
    request: &Q,
    patience: Duration,
) -> io::Result<String> {
    let mut lines = send(path, request, Some(patience + PATIENCE))?;
    let mut line = String::new();
    lines.read_line(&mut line)?;
    Ok(line)
}

/// An answer that is not of the form that `who` gives; `other` has a socket, too.
pub(crate) fn foreign_answer(who: &str, other: &str, error: &serde_json::Error) -> io::Error {
    let text = format!(
        "what listens there does not answer as {who} does: is it the socket of {other}? ({error})"
    );
    io::Error::new(io::ErrorKind::InvalidData, text)
}

/// Asks, and gives line after line until the other side ends.
///
/// # Errors
/// When nobody listens there.
pub(crate) fn ask_lines<Q: Serialize>(
    path: &Path,
    request: &Q,
) -> io::Result<Lines<BufReader<UnixStream>>> {
    Ok(send(path, request, None)?.lines())
}

fn send<Q: Serialize>(
    path: &Path,
    request: &Q,
    patience: Option<Duration>,
) -> io::Result<BufReader<UnixStream>> {
    let mut stream = UnixStream::connect(path)?;
    stream.set_read_timeout(patience)?;
    let mut text = serde_json::to_string(request)?;
    text.push('\n');
    stream.write_all(text.as_bytes())?;
    Ok(BufReader::new(stream))
}
