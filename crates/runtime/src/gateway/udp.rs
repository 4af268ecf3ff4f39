//! Datagrams: one request each, one answer each.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread;
use std::time::Duration;

use linesman_proto::mailbox::gateway;

use super::admission::{DatagramSenders, WAITING};
use super::counts::GatewayRefusal;
use super::server::{GatewayAnswer, GatewayServer, ObjectRequest, ReturnPath};
use crate::part::guard;

/// How often it is looked whether the gateway is closed.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// How long nothing is taken after the socket has failed.
const REST: Duration = Duration::from_millis(100);

/// Starts the thread that takes requests and the one that sends answers.
pub(super) fn start(
    socket: UdpSocket,
    server: Arc<GatewayServer>,
    objects: SyncSender<ObjectRequest>,
) -> io::Result<()> {
    socket.set_read_timeout(Some(LOOK_EVERY))?;
    let replies = socket.try_clone()?;
    replies.set_write_timeout(Some(LOOK_EVERY))?;
    let (answers, given) = mpsc::sync_channel(WAITING);
    let answering = Arc::clone(&server);
    thread::Builder::new().name("gateway answers".to_owned()).spawn(move || {
        send(&replies, &answering, &given);
    })?;
    thread::Builder::new().name("gateway".to_owned()).spawn(move || {
        while !server.closed.load(Ordering::Acquire) {
            let taken = guard("the mailbox gateway", "it goes on with the next datagram", || {
                receive(&socket, &server, &objects, &answers);
            });
            if taken.is_ok() {
                return;
            }
        }
    })?;
    Ok(())
}

/// Takes one datagram after another, until the gateway is closed.
fn receive(
    socket: &UdpSocket,
    server: &GatewayServer,
    objects: &SyncSender<ObjectRequest>,
    answers: &SyncSender<GatewayAnswer>,
) {
    let mut senders = DatagramSenders::new();
    // One that is longer than a frame can be is cut off: what is left of it is padding.
    let mut buffer = [0; gateway::MAX_LEN];
    while !server.closed.load(Ordering::Acquire) {
        let (len, sender) = match socket.recv_from(&mut buffer) {
            Ok(received) => received,
            Err(error) => {
                let waited = matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                );
                // Somebody to whom an answer went has gone: that is reported here, too.
                if !waited && error.kind() != ErrorKind::ConnectionRefused {
                    thread::sleep(REST);
                }
                continue;
            }
        };
        server.counts.request();
        if !server.options.allows(sender.ip()) {
            server.counts.refuse(GatewayRefusal::NotAllowed);
            continue;
        }
        let client = senders.client(sender, server.now(), &server.clients);
        let back = ReturnPath { sender: Some(sender), answers: answers.clone() };
        let frame = buffer.get(..len).unwrap_or_default();
        if let Err(why) = server.take(frame, sender.ip(), &client, back, objects) {
            server.counts.refuse(why);
        }
    }
}

/// Sends one answer after another, until the gateway is closed.
fn send(socket: &UdpSocket, server: &GatewayServer, given: &Receiver<GatewayAnswer>) {
    loop {
        match given.recv_timeout(LOOK_EVERY) {
            Ok(answer) => {
                let Some(sender) = answer.sender else { continue };
                for frame in server.frames(&answer) {
                    // Whoever asked may have gone.
                    if socket.send_to(&frame, sender).is_ok() {
                        server.counts.answers(1);
                    }
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                if server.closed.load(Ordering::Acquire) {
                    return;
                }
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
