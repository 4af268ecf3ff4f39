//! Web page of a virtual device: HTTP/1.0 over TCP port 80.
//!
//! `GET /` is a page that says who answers; `GET /bytes/N` so many letters, for whoever wants to know how fast it goes.

use smoltcp::iface::{SocketHandle, SocketSet};
use smoltcp::socket::tcp;

/// Connections at once.
const CONNECTIONS: usize = 4;
/// The longest request, in bytes.
const LONGEST_REQUEST: usize = 2_048;
/// Most bytes of an answer.
const MOST_BYTES: u64 = 1 << 30;
/// Buffers of a connection, in bytes.
const RECEIVE_BUFFER: usize = 8_192;
const SEND_BUFFER: usize = 32_768;
/// The port of HTTP.
const PORT: u16 = 80;

/// What is still to be sent.
#[derive(Debug)]
struct WebAnswer {
    text: Vec<u8>,
    sent: usize,
    /// Bytes of no meaning behind the text.
    filling: u64,
}

#[derive(Debug)]
struct WebConnection {
    handle: SocketHandle,
    request: Vec<u8>,
    answer: Option<WebAnswer>,
}

/// The server.
#[derive(Debug)]
pub(super) struct WebPage {
    connections: Vec<WebConnection>,
}

impl WebPage {
    pub(super) fn new(sockets: &mut SocketSet<'static>) -> Self {
        let one = |_| {
            let buffer = |len| tcp::SocketBuffer::new(vec![0; len]);
            let socket = tcp::Socket::new(buffer(RECEIVE_BUFFER), buffer(SEND_BUFFER));
            WebConnection { handle: sockets.add(socket), request: Vec::new(), answer: None }
        };
        Self { connections: (0..CONNECTIONS).map(one).collect() }
    }

    /// Does what can be done now. `name` is who answers. True if there is something to send.
    pub(super) fn serve(&mut self, sockets: &mut SocketSet<'static>, name: &str) -> bool {
        let mut any = false;
        for connection in &mut self.connections {
            any |= connection.serve(sockets.get_mut(connection.handle), name);
        }
        any
    }

    /// All connections end.
    pub(super) fn restart(&mut self, sockets: &mut SocketSet<'static>) {
        for connection in &mut self.connections {
            sockets.get_mut::<tcp::Socket<'_>>(connection.handle).abort();
            connection.request.clear();
            connection.answer = None;
        }
    }
}

impl WebConnection {
    fn serve(&mut self, socket: &mut tcp::Socket<'_>, name: &str) -> bool {
        if !socket.is_open() {
            self.request.clear();
            self.answer = None;
            // A socket that is closed can listen.
            let _ = socket.listen(PORT);
            return false;
        }
        while self.answer.is_none() && socket.can_recv() {
            let taken = socket.recv(|bytes| (bytes.len(), bytes.to_vec()));
            self.request.extend_from_slice(&taken.unwrap_or_default());
            if self.request.windows(4).any(|four| four == b"\r\n\r\n") {
                self.answer = Some(answer(&self.request, name));
            } else if self.request.len() > LONGEST_REQUEST {
                socket.abort();
                return true;
            }
        }
        let Some(answer) = &mut self.answer else {
            // Whoever has closed without a question wants no answer.
            if !socket.may_recv() && socket.may_send() {
                socket.close();
                return true;
            }
            return false;
        };
        let mut any = false;
        while socket.can_send() && !answer.is_done() {
            let sent = socket.send(|room| {
                let len = answer.fill(room);
                (len, len)
            });
            if !matches!(sent, Ok(1..)) {
                break;
            }
            any = true;
        }
        if answer.is_done() && socket.may_send() {
            socket.close();
            any = true;
        }
        any
    }
}

impl WebAnswer {
    const fn is_done(&self) -> bool {
        self.sent >= self.text.len() && self.filling == 0
    }

    /// Fills a buffer with what comes next; gives its length.
    fn fill(&mut self, room: &mut [u8]) -> usize {
        let rest = self.text.get(self.sent..).unwrap_or_default();
        if !rest.is_empty() {
            let len = rest.len().min(room.len());
            room[..len].copy_from_slice(&rest[..len]);
            self.sent += len;
            return len;
        }
        let len = usize::try_from(self.filling).unwrap_or(usize::MAX).min(room.len());
        // Letters by how many are left, so that whoever gets them sees one that is missing or doubled.
        for slot in &mut room[..len] {
            *slot = b'a' + (self.filling % 26) as u8;
            self.filling -= 1;
        }
        len
    }
}

/// The answer to a request, which is whole.
fn answer(request: &[u8], name: &str) -> WebAnswer {
    let line = request.split(|byte| *byte == b'\r').next().unwrap_or_default();
    let line = String::from_utf8_lossy(line);
    let mut words = line.split(' ');
    let (verb, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let bytes = path.strip_prefix("/bytes/").and_then(|count| count.parse::<u64>().ok());
    let (status, kind, page, filling) = match (verb, path, bytes) {
        ("GET", "/", _) => {
            let page = format!(
                "<!doctype html>\n<title>{name}</title>\n<h1>{name}</h1>\n<p>A virtual device behind EtherCAT.</p>\n"
            );
            ("200 OK", "text/html; charset=utf-8", page, 0)
        }
        ("GET", _, Some(count)) if count <= MOST_BYTES => {
            ("200 OK", "application/octet-stream", String::new(), count)
        }
        ("GET", ..) => ("404 Not Found", "text/plain", "There is / and /bytes/N.\n".to_owned(), 0),
        _ => ("501 Not Implemented", "text/plain", "There is GET.\n".to_owned(), 0),
    };
    let length = page.len() as u64 + filling;
    let text = format!(
        "HTTP/1.0 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{page}"
    );
    WebAnswer { text: text.into_bytes(), sent: 0, filling }
}
