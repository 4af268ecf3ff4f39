//! Frames as SOEM sends and awaits them: one request a frame, one of sixteen indexes for each frame that is out, no
//! padding, and the same frame again every 2 ms until the time of the call is over.
//!
//! A reply is recognised by its index alone, and its data are where those of the request were, as in SOEM's
//! `ecx_inframe`: a frame of somebody else with an index that is out is taken for the answer.
//! With two cards the second one sends a broadcast read with the same index; a ring that is open is closed by sending
//! the frame as it came back once more by the second card (`ecx_waitinframe_red`).

use std::collections::VecDeque;
use std::future::poll_fn;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;

use linesman_maindevice::{DatagramData, Reply, Request, Target};
use linesman_proto::address::{Path, RegisterAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::ethernet::{ETHERTYPE_ETHERCAT, HEADER_LEN, MIN_LEN, MacAddress};
use linesman_proto::frame::{
    DATAGRAM_HEADER_LEN, DATAGRAM_OVERHEAD, ETHERCAT_HEADER_LEN, FrameBuilder, FrameView,
};
use linesman_proto::register;
use linesman_proto::time::{Instant, Span};

/// Source address of the frames of the first card, and of the second one.
const SOURCES: [MacAddress; 2] = [MacAddress([1, 1, 1, 1, 1, 1]), MacAddress([1, 1, 4, 4, 1, 1])];
/// Where the source address of a frame is.
const SOURCE_AT: usize = 6;
/// The byte of it in which the cards differ.
const DIFFERS: usize = 2;
/// The first datagram's index.
const FIRST_INDEX: usize = HEADER_LEN + ETHERCAT_HEADER_LEN + 1;
/// Buffers, and so many indexes: `EC_MAXBUF`.
const BUFFERS: usize = 16;
/// How long a frame is waited for before it is sent again: `EC_TIMEOUTRET`.
pub(super) const RETURN: Span = Span::us(2_000);
/// Three times as long, for what must arrive: `EC_TIMEOUTRET3`.
pub(super) const SURELY: Span = Span::us(6_000);
/// Between two looks at something that takes its time: `EC_LOCALDELAY`.
pub(super) const SHORTLY: Span = Span::us(200);

/// A frame that has come back.
#[derive(Default)]
struct Returned {
    bytes: Vec<u8>,
    /// The second card had sent it.
    of_second: bool,
}

/// A frame that is out.
#[derive(Default)]
struct Buffer {
    is_awaited: bool,
    sent: Vec<u8>,
    /// What has come back to each card.
    returned: [Option<Returned>; 2],
}

/// What the engine and its procedures share.
#[derive(Default)]
struct BusState {
    now: Instant,
    /// When the first of those who wait is to be asked again.
    next: Option<Instant>,
    ring: bool,
    last_index: usize,
    buffers: [Buffer; BUFFERS],
    outgoing: VecDeque<(Path, Vec<u8>)>,
}

/// The way of procedures to the line.
#[derive(Clone, Default)]
pub(super) struct Bus(Arc<Mutex<BusState>>);

impl Bus {
    pub(super) fn new(now: Instant, ring: bool) -> Self {
        Self(Arc::new(Mutex::new(BusState { now, ring, ..BusState::default() })))
    }

    fn lock(&self) -> MutexGuard<'_, BusState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    // ---- for the engine ----

    pub(super) fn advance(&self, now: Instant) {
        let mut board = self.lock();
        board.now = now;
        board.next = None;
    }

    pub(super) fn next(&self) -> Option<Instant> {
        self.lock().next
    }

    pub(super) fn take_outgoing(&self) -> Option<(Path, Vec<u8>)> {
        self.lock().outgoing.pop_front()
    }

    /// Takes a frame, whoever has sent it, if its index is out.
    pub(super) fn take(&self, path: Path, frame: &[u8]) {
        let mut board = self.lock();
        let index = frame.get(FIRST_INDEX).map_or(BUFFERS, |index| usize::from(*index));
        let is_ours = frame.get(12..HEADER_LEN) == Some(&ETHERTYPE_ETHERCAT.to_be_bytes());
        let Some(buffer) = board.buffers.get_mut(index).filter(|one| one.is_awaited && is_ours)
        else {
            return;
        };
        let of_second = frame[SOURCE_AT + DIFFERS] == SOURCES[1].0[DIFFERS];
        let returned = Returned { bytes: frame.to_vec(), of_second };
        buffer.returned[path.index()].get_or_insert(returned);
    }

    // ---- time ----

    pub(super) fn now(&self) -> Instant {
        self.lock().now
    }

    pub(super) async fn sleep(&self, span: Span) {
        self.sleep_until(self.now() + span).await;
    }

    pub(super) async fn sleep_until(&self, until: Instant) {
        self.until(until, |_| false).await;
    }

    /// Waits for something, at most until then; says whether it has come about.
    async fn until(&self, end: Instant, done: impl Fn(&BusState) -> bool) -> bool {
        poll_fn(|_| {
            let mut board = self.lock();
            if done(&board) {
                return Poll::Ready(true);
            }
            if board.now >= end {
                return Poll::Ready(false);
            }
            board.next = Some(board.next.map_or(end, |next| next.min(end)));
            Poll::Pending
        })
        .await
    }

    // ---- one request a frame ----

    /// Reads a register; what does not come back is as if nobody had answered.
    pub(super) async fn read(&self, from: Target, at: u16, len: usize, timeout: Span) -> Reply {
        let request = Request::read(from, RegisterAddress(at), len as u16);
        self.ask(request, timeout).await
    }

    /// Writes a register. Says whether anybody took it.
    pub(super) async fn write(&self, to: Target, at: u16, data: &[u8], timeout: Span) -> bool {
        let request = Request::write(to, RegisterAddress(at), data);
        self.ask(request, timeout).await.answered()
    }

    async fn ask(&self, request: Request, timeout: Span) -> Reply {
        self.ask_together(&[request], timeout).await.pop().unwrap_or_else(nothing)
    }

    /// Several requests in one frame, sent until it comes back or the time is over (`ecx_srconfirm`). Empty when it
    /// has not come back.
    pub(super) async fn ask_together(&self, requests: &[Request], timeout: Span) -> Vec<Reply> {
        let end = self.now() + timeout;
        let index = self.take_index(requests);
        loop {
            self.send(index);
            let came = self.wait(index, timeout.min(RETURN)).await;
            if came || self.now() >= end {
                return self.take_replies(index, requests);
            }
        }
    }

    /// Sends requests in a frame of their own and gives its index, for [`Bus::receive`].
    pub(super) fn start(&self, requests: &[Request]) -> usize {
        let index = self.take_index(requests);
        self.send(index);
        index
    }

    /// What has come back of a frame that was started, within a time from now. Empty when it has not.
    pub(super) async fn receive(
        &self,
        index: usize,
        requests: &[Request],
        timeout: Span,
    ) -> Vec<Reply> {
        self.wait(index, timeout).await;
        self.take_replies(index, requests)
    }

    /// The next index that is free, with a frame of these requests in its buffer.
    fn take_index(&self, requests: &[Request]) -> usize {
        let mut board = self.lock();
        let next = |index: usize| (index + 1) % BUFFERS;
        let mut index = next(board.last_index);
        for _ in 0..BUFFERS {
            if !board.buffers[index].is_awaited {
                break;
            }
            index = next(index);
        }
        board.last_index = index;
        board.buffers[index] = Buffer {
            is_awaited: true,
            sent: frame(requests, index, SOURCES[0]),
            ..Buffer::default()
        };
        index
    }

    fn send(&self, index: usize) {
        let mut board = self.lock();
        let bytes = board.buffers[index].sent.clone();
        board.outgoing.push_back((Path::A, bytes));
        if board.ring {
            let companion = Request::read(Target::All, register::ESC_TYPE.address, 2);
            let bytes = frame(&[companion], index, SOURCES[1]);
            board.outgoing.push_back((Path::B, bytes));
        }
    }

    /// Waits for a frame; in a ring for both, and closes one that is open. Says whether there is a reply, which is
    /// then that of card A.
    async fn wait(&self, index: usize, timeout: Span) -> bool {
        let end = self.now() + timeout;
        let wanted = if self.lock().ring { 2 } else { 1 };
        let all = |board: &BusState| {
            board.buffers[index].returned.iter().take(wanted).all(Option::is_some)
        };
        self.until(end, all).await;
        if wanted == 1 {
            return self.lock().buffers[index].returned[0].is_some();
        }
        let (first, second) = self.origins(index);
        if second == Some(true) && first != Some(true) {
            self.send_again_by_second(index);
            let end = self.now() + RETURN;
            self.until(end, |board| board.buffers[index].returned[1].is_some()).await;
        }
        let mut board = self.lock();
        let returned = &mut board.buffers[index].returned;
        if let Some(by_second) = returned[1].take() {
            returned[0] = Some(by_second);
        }
        returned[0].is_some()
    }

    /// Whether what came to each card was sent by the second one.
    fn origins(&self, index: usize) -> (Option<bool>, Option<bool>) {
        let board = self.lock();
        let [first, second] = &board.buffers[index].returned;
        let of_second = |one: &Option<Returned>| one.as_ref().map(|one| one.of_second);
        (of_second(first), of_second(second))
    }

    /// What the first half of an open ring has processed goes through the second half.
    fn send_again_by_second(&self, index: usize) {
        let mut board = self.lock();
        let buffer = &mut board.buffers[index];
        let mut bytes = buffer.sent.clone();
        if let Some(half) = buffer.returned[0].as_ref().and_then(|one| one.bytes.get(HEADER_LEN..))
        {
            let len = (bytes.len() - HEADER_LEN).min(half.len());
            bytes[HEADER_LEN..HEADER_LEN + len].copy_from_slice(&half[..len]);
        }
        bytes[SOURCE_AT..SOURCE_AT + 6].copy_from_slice(&SOURCES[1].0);
        buffer.returned[1] = None;
        board.outgoing.push_back((Path::B, bytes));
    }

    fn take_replies(&self, index: usize, requests: &[Request]) -> Vec<Reply> {
        let buffer = std::mem::take(&mut self.lock().buffers[index]);
        let Some(returned) = buffer.returned.into_iter().next().flatten() else {
            return Vec::new();
        };
        let mut at = HEADER_LEN + ETHERCAT_HEADER_LEN;
        let reply = |request: &Request| {
            let data = at + DATAGRAM_HEADER_LEN;
            let wkc = data + request.data.len();
            at = wkc + 2;
            let (data, wkc) = (returned.bytes.get(data..wkc)?, returned.bytes.get(wkc..wkc + 2)?);
            let wkc = WorkingCounter(u16::from_le_bytes(wkc.try_into().ok()?));
            Some(Reply { wkc, data: DatagramData::from_slice(data) })
        };
        requests.iter().map_while(reply).collect()
    }
}

/// Whether a frame, sent or come back, is what the second card sends beside one of the first.
pub(crate) fn is_companion(view: &FrameView<'_>) -> bool {
    view.source().marked() == SOURCES[1].marked()
        && view.datagrams().map_while(Result::ok).all(|datagram| {
            datagram.command() == Some(Command::Brd) && datagram.ado() == register::ESC_TYPE.address
        })
}

/// A datagram that nobody has answered.
fn nothing() -> Reply {
    Reply { wkc: WorkingCounter(0), data: DatagramData::new() }
}

/// A frame of these requests, all with the same index, as long as they are.
fn frame(requests: &[Request], index: usize, source: MacAddress) -> Vec<u8> {
    let data: usize = requests.iter().map(|one| one.data.len() + DATAGRAM_OVERHEAD).sum();
    let len = HEADER_LEN + ETHERCAT_HEADER_LEN + data;
    let mut bytes = vec![0; len.max(MIN_LEN)];
    let mut builder = FrameBuilder::new(&mut bytes, source);
    for request in requests {
        let Request { command, address, data, .. } = request;
        // The buffer is as long as all of them together.
        if let Ok(slot) = builder.push(*command, index as u8, *address, data.len()) {
            slot.copy_from_slice(data);
        }
    }
    builder.finish();
    bytes.truncate(len);
    bytes
}
