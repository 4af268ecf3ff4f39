//! Server for connections: their number at a time, whom they come from, and for how long one may be silent.

use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::network_access::NetworkAccess;
use crate::part::guard;

/// Connections at a time.
const CONNECTIONS: usize = 64;
/// Memory for the thread of one, in bytes: a run with real-time priority keeps all its memory in RAM.
const STACK: usize = 256 * 1024;
/// Time that the other side may take to read an answer.
const WRITE: Duration = Duration::from_secs(2);
/// Interval at which the server is looked at, whether it is closed.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Reason for which a connection is closed at once.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum ConnectionRefusal {
    /// Too many are open.
    TooMany,
    /// Its host is not allowed.
    NotAllowed,
}

/// Service on connections.
pub(crate) trait TcpService: Send + Sync + 'static {
    /// Name of the thread that takes connections.
    const THREAD: &'static str;
    /// A connection, as failures of this program name it.
    const CONNECTION: &'static str;

    /// Whom it serves.
    fn access(&self) -> &NetworkAccess;

    /// Set when the run has ended.
    fn closed(&self) -> &AtomicBool;

    /// Counts a connection that is refused.
    fn refuse(&self, why: ConnectionRefusal);

    /// Serves a connection until it ends.
    ///
    /// # Errors
    /// When it breaks.
    fn serve(&self, connection: ServedConnection<'_>) -> io::Result<()>;
}

/// Starts the thread that takes connections.
pub(crate) fn start<S: TcpService>(listener: TcpListener, service: S) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let service = Arc::new(service);
    thread::Builder::new().name(S::THREAD.to_owned()).spawn(move || {
        let open = Arc::new(AtomicUsize::default());
        while !service.closed().load(Ordering::Acquire) {
            let Ok((stream, peer)) = listener.accept() else {
                // Nobody is there, or there are too many open files.
                thread::sleep(Duration::from_millis(20));
                continue;
            };
            let Some(place) = ConnectionPlace::take(&open) else {
                service.refuse(ConnectionRefusal::TooMany);
                continue;
            };
            if !service.access().allows(peer.ip()) {
                service.refuse(ConnectionRefusal::NotAllowed);
                continue;
            }
            let service = Arc::clone(&service);
            // Where no thread can be had, the connection is closed.
            let _ = thread::Builder::new().stack_size(STACK).spawn(move || {
                // Whoever asked sees that the connection ends; the next one is served.
                let _ = guard(S::CONNECTION, "it is closed", || {
                    let _ = ServedConnection::new(stream, peer, service.closed())
                        .and_then(|connection| service.serve(connection));
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

/// A connection.
pub(crate) struct ServedConnection<'a> {
    stream: TcpStream,
    peer: SocketAddr,
    closed: &'a AtomicBool,
}

impl<'a> ServedConnection<'a> {
    fn new(stream: TcpStream, peer: SocketAddr, closed: &'a AtomicBool) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(LOOK_EVERY))?;
        stream.set_write_timeout(Some(WRITE))?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, peer, closed })
    }

    /// The computer at the other end.
    pub(crate) fn host(&self) -> IpAddr {
        self.peer.ip()
    }

    /// The address of this computer that was called.
    ///
    /// # Errors
    /// When the connection is gone.
    pub(crate) fn own_address(&self) -> io::Result<IpAddr> {
        Ok(self.stream.local_addr()?.ip())
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// When the other side is gone, or does not read.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    /// Fills a buffer; false when the connection ends, or the time does.
    ///
    /// # Errors
    /// When the connection breaks.
    pub(crate) fn fill(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<bool> {
        let began = Instant::now();
        let mut filled = 0;
        while let Some(room) = buffer.get_mut(filled..).filter(|room| !room.is_empty()) {
            match self.stream.read(room) {
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
            let over = began.elapsed() >= patience || self.closed.load(Ordering::Acquire);
            if over && filled < buffer.len() {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
