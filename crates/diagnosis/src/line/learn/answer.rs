//! Answers: the datagrams of a frame that came back, with what is known of their way.

use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::{Addressing, Command, Effect};
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::time::Instant;

use crate::observe::{Exchange, FrameCopy};

/// One datagram on its way back, with all there is to know of it.
pub(super) struct Answer<'a> {
    pub(super) command: Command,
    pub(super) effect: Effect,
    pub(super) request: Option<Datagram<'a>>,
    pub(super) reply: Datagram<'a>,
    pub(super) ado: RegisterAddress,
    /// Its working counter, all copies so far together.
    pub(super) sum: u16,
    /// The working counter of this copy alone.
    pub(super) own: u16,
    pub(super) is_last: bool,
    /// Whether positions can be counted: there is but one copy.
    pub(super) is_single: bool,
    /// The card by which this copy had gone out, where that is known.
    pub(super) sent_by: Option<Path>,
    /// Whether cards are told apart by more than their addresses.
    pub(super) knows_cards: bool,
    /// When the request went out, where it was seen.
    pub(super) sent_at: Option<Instant>,
    pub(super) at: Instant,
    pub(super) frame: u64,
}

impl Answer<'_> {
    /// What was written: as it went out if that was seen, since a read may have changed it.
    pub(super) fn written(&self) -> &[u8] {
        match (self.request, self.effect.reads) {
            (Some(request), _) => request.data(),
            (None, false) => self.reply.data(),
            (None, true) => &[],
        }
    }

    /// How many controllers it passed.
    pub(super) fn passed(&self) -> Option<u16> {
        if !self.is_single || !self.command.increments_position() {
            return None;
        }
        match self.request {
            Some(request) => Some(self.reply.adp().wrapping_sub(request.adp())),
            None if self.effect.addressing == Addressing::Broadcast => Some(self.reply.adp()),
            None => None,
        }
    }
}

/// The datagrams of a frame that came back, one by one; `None` for one whose command is not known.
pub(super) fn answers<'a>(
    exchange: &'a Exchange<'_>,
    request: Option<&FrameCopy<'a>>,
    reply: &FrameCopy<'a>,
) -> impl Iterator<Item = Option<Answer<'a>>> {
    let (at, frame) = (reply.time, reply.number);
    let view = FrameView::parse(reply.bytes).ok();
    let datagrams = view.into_iter().flat_map(|view| view.datagrams()).map_while(Result::ok);
    let mut requests =
        request.and_then(|copy| FrameView::parse(copy.bytes).ok()).map(|view| view.datagrams());
    let answer = move |(index, datagram): (usize, Datagram<'a>)| {
        let request = requests.as_mut().and_then(Iterator::next).and_then(Result::ok);
        let sum = exchange.sum(index, datagram.wkc().0);
        let Some(command) = datagram.command() else { return Some(None) };
        if exchange.is_part && sum == 0 {
            return None;
        }
        Some(Some(Answer {
            command,
            effect: command.effect(),
            request,
            reply: datagram,
            ado: datagram.ado(),
            sum,
            own: datagram.wkc().0,
            is_last: exchange.is_last,
            is_single: exchange.is_last && exchange.earlier.is_empty(),
            sent_by: exchange.sent_by,
            knows_cards: exchange.request.is_some_and(|request| request.path.is_some()),
            sent_at: exchange.request.map(|request| request.time),
            at,
            frame,
        }))
    };
    datagrams.enumerate().filter_map(answer)
}
