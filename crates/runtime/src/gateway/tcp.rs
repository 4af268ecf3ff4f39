//! Connections: one frame behind the other, each answered before the next is taken.

use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, SyncSender};
use std::time::{Duration, Instant};

use linesman_proto::frame::ETHERCAT_HEADER_LEN;
use linesman_proto::mailbox::gateway;

use super::counts::GatewayRefusal;
use super::server::{GatewayServer, ObjectRequest, ReturnPath};
use crate::network_access::NetworkAccess;
use crate::tcp_server::{self, ConnectionRefusal, ServedConnection, TcpService};

/// How long a connection may be silent.
const IDLE: Duration = Duration::from_secs(60);
/// How long a frame may take from its first byte to its last.
const FRAME: Duration = Duration::from_secs(5);
/// How long an answer is waited for: longer than a SubDevice is kept for the transfer of another client.
const ANSWER: Duration = Duration::from_secs(75);

/// Starts the thread that takes connections.
pub(super) fn start(
    listener: TcpListener,
    server: Arc<GatewayServer>,
    objects: SyncSender<ObjectRequest>,
) -> io::Result<()> {
    tcp_server::start(listener, GatewayConnections { server, objects })
}

struct GatewayConnections {
    server: Arc<GatewayServer>,
    objects: SyncSender<ObjectRequest>,
}

impl TcpService for GatewayConnections {
    const THREAD: &'static str = "gateway accept";
    const CONNECTION: &'static str = "a connection to the mailbox gateway";

    fn access(&self) -> &NetworkAccess {
        &self.server.options
    }

    fn closed(&self) -> &AtomicBool {
        &self.server.closed
    }

    fn refuse(&self, why: ConnectionRefusal) {
        self.server.counts.refuse(match why {
            ConnectionRefusal::TooMany => GatewayRefusal::TooManyConnections,
            ConnectionRefusal::NotAllowed => GatewayRefusal::NotAllowed,
        });
    }

    /// Takes one frame after another, until there is no more, or none that can be told from the next.
    fn serve(&self, mut connection: ServedConnection<'_>) -> io::Result<()> {
        let server = &self.server;
        let client = server.clients.add();
        let mut buffer = [0; gateway::MAX_LEN];
        loop {
            let Some(first) = buffer.get_mut(..1) else { return Ok(()) };
            if !connection.fill(first, IDLE)? {
                return Ok(());
            }
            server.counts.request();
            let Some(frame) = rest(&mut connection, &mut buffer)? else {
                server.counts.refuse(GatewayRefusal::Malformed);
                return Ok(());
            };
            let (answers, given) = mpsc::sync_channel(1);
            let back = ReturnPath { sender: None, answers };
            let frames = match server.take(frame, connection.host(), &client, back, &self.objects) {
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
                connection.send(&frame)?;
                server.counts.answers(1);
            }
        }
    }
}

/// The frame whose first byte is there; `None` for one that ends too early, takes too long, or is none.
fn rest<'a>(
    connection: &mut ServedConnection<'_>,
    buffer: &'a mut [u8; gateway::MAX_LEN],
) -> io::Result<Option<&'a [u8]>> {
    let began = Instant::now();
    let left = || FRAME.saturating_sub(began.elapsed());
    let Some(second) = buffer.get_mut(1..ETHERCAT_HEADER_LEN) else { return Ok(None) };
    if !connection.fill(second, left())? {
        return Ok(None);
    }
    let Ok(len) = gateway::frame_len([buffer[0], buffer[1]]) else { return Ok(None) };
    let Some(rest) = buffer.get_mut(ETHERCAT_HEADER_LEN..len) else { return Ok(None) };
    if !connection.fill(rest, left())? {
        return Ok(None);
    }
    Ok(buffer.get(..len))
}
