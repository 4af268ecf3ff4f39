//! Connections: one frame behind the other, each answered before the next is taken.

use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{IpAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, SyncSender};
use std::thread;
use std::time::{Duration, Instant};

use linesman_proto::frame::ETHERCAT_HEADER_LEN;
use linesman_proto::mailbox::gateway;

use super::counts::GatewayRefusal;
use super::server::{GatewayServer, ObjectRequest, ReturnPath};
use crate::part::guard;

/// Connections at a time.
const CONNECTIONS: usize = 64;
/// Memory for the thread of one, in bytes: a run with real-time priority keeps all its memory in RAM.
const STACK: usize = 256 * 1024;
/// How long a connection may be silent.
const IDLE: Duration = Duration::from_secs(60);
/// How long a frame may take from its first byte to its last.
const FRAME: Duration = Duration::from_secs(5);
/// How long the other side may take to read an answer.
const WRITE: Duration = Duration::from_secs(2);
/// How long an answer is waited for: longer than a SubDevice is kept for the transfer of another client.
const ANSWER: Duration = Duration::from_secs(75);
/// How often it is looked whether the gateway is closed.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Starts the thread that takes connections.
pub(super) fn start(
    listener: TcpListener,
    server: Arc<GatewayServer>,
    objects: SyncSender<ObjectRequest>,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    thread::Builder::new().name("gateway accept".to_owned()).spawn(move || {
        let open = Arc::new(AtomicUsize::default());
        while !server.closed.load(Ordering::Acquire) {
            let Ok((stream, peer)) = listener.accept() else {
                // Nobody is there, or there are too many open files.
                thread::sleep(Duration::from_millis(20));
                continue;
            };
            let Some(place) = ConnectionPlace::take(&open) else {
                server.counts.refuse(GatewayRefusal::TooManyConnections);
                continue;
            };
            if !server.options.allows(peer.ip()) {
                server.counts.refuse(GatewayRefusal::NotAllowed);
                continue;
            }
            let connection = Connected { server: Arc::clone(&server), objects: objects.clone() };
            // Where no thread can be had, the connection is closed.
            let _ = thread::Builder::new().stack_size(STACK).spawn(move || {
                let host = peer.ip();
                // Whoever asked sees that the connection ends; the next one is served.
                let _ = guard("a connection to the mailbox gateway", "it is closed", || {
                    let _ = connection.serve(stream, host);
                });
                drop(place);
            });
        }
    })?;
    Ok(())
}

/// A place among the connections; free again when it is dropped.
struct ConnectionPlace(Arc<AtomicUsize>);

impl ConnectionPlace {
    fn take(open: &Arc<AtomicUsize>) -> Option<Self> {
        let more = |count: usize| (count < CONNECTIONS).then_some(count + 1);
        open.fetch_update(Ordering::AcqRel, Ordering::Acquire, more).ok()?;
        Some(Self(Arc::clone(open)))
    }
}

impl Drop for ConnectionPlace {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

struct Connected {
    server: Arc<GatewayServer>,
    objects: SyncSender<ObjectRequest>,
}

impl Connected {
    /// Takes one frame after another, until there is no more, or none that can be told from the next.
    fn serve(&self, mut stream: TcpStream, host: IpAddr) -> io::Result<()> {
        let server = &self.server;
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(LOOK_EVERY))?;
        stream.set_write_timeout(Some(WRITE))?;
        stream.set_nodelay(true)?;
        let client = server.clients.add();
        let mut buffer = [0; gateway::MAX_LEN];
        loop {
            let Some(first) = buffer.get_mut(..1) else { return Ok(()) };
            if !self.fill(&mut stream, first, IDLE)? {
                return Ok(());
            }
            server.counts.request();
            let Some(frame) = self.rest(&mut stream, &mut buffer)? else {
                server.counts.refuse(GatewayRefusal::Malformed);
                return Ok(());
            };
            let (answers, given) = mpsc::sync_channel(1);
            let back = ReturnPath { sender: None, answers };
            let frames = match server.take(frame, host, &client, back, &self.objects) {
                Ok(()) => match given.recv_timeout(ANSWER) {
                    Ok(answer) => server.frames(&answer),
                    Err(_) => Vec::new(),
                },
                Err(why) => {
                    server.counts.refuse(why);
                    Vec::new()
                }
            };
            for frame in frames {
                stream.write_all(&frame)?;
                server.counts.answers(1);
            }
        }
    }

    /// The frame whose first byte is there; `None` for one that ends too early, takes too long, or is none.
    fn rest<'a>(
        &self,
        stream: &mut TcpStream,
        buffer: &'a mut [u8; gateway::MAX_LEN],
    ) -> io::Result<Option<&'a [u8]>> {
        let began = Instant::now();
        let left = || FRAME.saturating_sub(began.elapsed());
        let Some(second) = buffer.get_mut(1..ETHERCAT_HEADER_LEN) else { return Ok(None) };
        if !self.fill(stream, second, left())? {
            return Ok(None);
        }
        let Ok(len) = gateway::frame_len([buffer[0], buffer[1]]) else { return Ok(None) };
        let Some(rest) = buffer.get_mut(ETHERCAT_HEADER_LEN..len) else { return Ok(None) };
        if !self.fill(stream, rest, left())? {
            return Ok(None);
        }
        Ok(buffer.get(..len))
    }

    /// Fills a buffer; false when the connection ends, or the time does.
    fn fill(
        &self,
        stream: &mut TcpStream,
        buffer: &mut [u8],
        patience: Duration,
    ) -> io::Result<bool> {
        let began = Instant::now();
        let mut filled = 0;
        while let Some(room) = buffer.get_mut(filled..).filter(|room| !room.is_empty()) {
            match stream.read(room) {
                Ok(0) => return Ok(false),
                Ok(count) => filled += count,
                Err(error) => {
                    let waited = matches!(
                        error.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    );
                    if !waited {
                        return Err(error);
                    }
                }
            }
            let over = began.elapsed() >= patience || self.server.closed.load(Ordering::Acquire);
            if over && filled < buffer.len() {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
