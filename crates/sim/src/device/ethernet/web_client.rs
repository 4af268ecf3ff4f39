//! A transfer over TCP that a virtual computer begins: it asks a web page (HTTP/1.0, port 80), and keeps what comes.

use std::net::Ipv4Addr;

use smoltcp::iface::{Interface, SocketHandle, SocketSet};
use smoltcp::socket::tcp;

/// The port of HTTP.
const PORT: u16 = 80;
/// The first port of its own; each transfer takes the next one.
const OWN_PORT: u16 = 49_152;
/// Buffers of a connection, in bytes.
const RECEIVE_BUFFER: usize = 32_768;
const SEND_BUFFER: usize = 2_048;

/// A transfer.
#[derive(Debug)]
pub(super) struct WebClient {
    handle: SocketHandle,
    request: Vec<u8>,
    sent: usize,
    answer: Vec<u8>,
    /// The other side has sent all, or the connection is broken.
    is_over: bool,
}

impl WebClient {
    /// Begins a transfer: asks the host at `server` for the page at `path`.
    pub(super) fn new(
        interface: &mut Interface,
        sockets: &mut SocketSet<'static>,
        (server, path): ([u8; 4], &str),
        number: u16,
    ) -> Self {
        let buffer = |len| tcp::SocketBuffer::new(vec![0; len]);
        let mut socket = tcp::Socket::new(buffer(RECEIVE_BUFFER), buffer(SEND_BUFFER));
        let own = OWN_PORT | number;
        let began =
            socket.connect(interface.context(), (Ipv4Addr::from(server), PORT), own).is_ok();
        Self {
            handle: sockets.add(socket),
            request: format!("GET {path} HTTP/1.0\r\n\r\n").into_bytes(),
            sent: 0,
            answer: Vec::new(),
            is_over: !began,
        }
    }

    /// Does what can be done now. True if there is something to send.
    pub(super) fn serve(&mut self, sockets: &mut SocketSet<'static>) -> bool {
        if self.is_over {
            return false;
        }
        let socket = sockets.get_mut::<tcp::Socket<'_>>(self.handle);
        let mut any = false;
        if socket.can_send() && self.sent < self.request.len() {
            let rest = self.request.get(self.sent..).unwrap_or_default();
            self.sent += socket.send_slice(rest).unwrap_or(0);
            any = true;
        }
        while socket.can_recv() {
            let taken = socket.recv(|bytes| (bytes.len(), bytes.to_vec()));
            self.answer.extend_from_slice(&taken.unwrap_or_default());
            any = true;
        }
        if self.sent == self.request.len() && !socket.may_recv() {
            self.is_over = true;
            socket.close();
            any = true;
        }
        any
    }

    /// The answer behind its head, once all of it is there; nothing where there was no answer.
    pub(super) fn body(&self) -> Option<&[u8]> {
        let head = self.answer.windows(4).position(|four| four == b"\r\n\r\n").map(|at| at + 4);
        self.is_over.then(|| self.answer.get(head?..)).flatten().or(self.is_over.then_some(&[]))
    }

    /// The transfer is over: its connection is forgotten.
    pub(super) fn end(self, sockets: &mut SocketSet<'static>) {
        sockets.remove(self.handle);
    }
}
