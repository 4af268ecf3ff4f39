//! Answers: the datagrams of a frame that came back, with what is known of their way.

use std::iter;

use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::{Addressing, Command, Effect};
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::time::Instant;

use crate::observe::{Exchange, FrameCopy};

/// Registers that every controller has, without what is reserved between them. Elsewhere, without so many FMMUs and
/// SyncManagers, without distributed clocks, or without a mailbox message to fetch, nobody answers, and nothing is wrong.
/// Reference: S2 chapter 2.
const EVERYWHERE: [std::ops::Range<u16>; 17] = [
    0x0000..0x000A,
    0x0010..0x0014,
    0x0100..0x0104,
    0x0110..0x0112,
    0x0120..0x0122,
    0x0130..0x0132,
    0x0134..0x0136,
    0x0200..0x0202,
    0x0204..0x0208,
    0x0210..0x0212,
    0x0220..0x0224,
    0x0300..0x0314,
    0x0400..0x0402,
    0x0410..0x0412,
    0x0420..0x0422,
    0x0440..0x0444,
    0x0500..0x0510,
];

/// Whether every controller has the register at this address.
#[must_use]
pub(crate) fn is_register_everywhere(ado: RegisterAddress) -> bool {
    // Most that is polled lies behind them all.
    let [.., last] = &EVERYWHERE;
    ado.0 < last.end && EVERYWHERE.iter().any(|range| range.contains(&ado.0))
}

/// One datagram on its way back, with all there is to know of it.
#[derive(Clone, Copy, Debug)]
pub struct Answer<'a> {
    /// Its command.
    pub command: Command,
    /// What that does.
    pub effect: Effect,
    /// As it went out; `None` where that was not seen.
    pub request: Option<Datagram<'a>>,
    /// As it came back.
    pub reply: Datagram<'a>,
    /// The register or memory address.
    pub ado: RegisterAddress,
    /// Its working counter, all copies so far together.
    pub sum: u16,
    /// The working counter of this copy alone.
    pub own: u16,
    /// Whether no other copy of it will come.
    pub is_last: bool,
    /// Whether positions can be counted: there is but one copy.
    pub is_single: bool,
    /// The card by which this copy had gone out, where that is known.
    pub sent_by: Option<Path>,
    /// Whether cards are told apart by more than their addresses.
    pub knows_cards: bool,
    /// When the request went out, where it was seen.
    pub sent_at: Option<Instant>,
    /// When it came back.
    pub at: Instant,
    /// The number of the frame in which it came back.
    pub frame: u64,
}

impl Answer<'_> {
    /// What was written: as it went out if that was seen, since a read may have changed it.
    #[must_use]
    pub fn written(&self) -> &[u8] {
        match (self.request, self.effect.reads) {
            (Some(request), _) => request.data(),
            (None, false) => self.reply.data(),
            (None, true) => &[],
        }
    }

    /// Whether it begins at a register that every controller has.
    #[must_use]
    #[inline]
    pub fn is_everywhere(&self) -> bool {
        is_register_everywhere(self.ado)
    }

    /// The event bits that controllers set in it, where its request was seen; it may go out with some.
    #[must_use]
    #[inline]
    pub fn added_events(&self) -> Option<u16> {
        let request = self.request.filter(|_| self.is_single && self.own > 0)?;
        Some(self.reply.irq() & !request.irq())
    }

    /// How many controllers it passed.
    #[must_use]
    #[inline]
    pub fn passed(&self) -> Option<u16> {
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

/// The command of what came back, of the copy of a ring's frame that hands the system time round if the other one only
/// asks for it.
fn handed(command: Command, request: Option<Datagram<'_>>) -> Command {
    match (command, request.and_then(|request| request.command())) {
        (Command::Aprd, Some(Command::Armw)) => Command::Armw,
        (Command::Fprd, Some(Command::Frmw)) => Command::Frmw,
        _ => command,
    }
}

/// The datagrams of a frame that came back, one by one; `None` for one whose command is not known.
#[inline]
pub fn answers<'a>(
    exchange: &'a Exchange<'_>,
    request: Option<&FrameCopy<'a>>,
    reply: &FrameCopy<'a>,
) -> impl Iterator<Item = Option<Answer<'a>>> {
    let (at, frame) = (reply.time, reply.number);
    let mut replies = FrameView::parse(reply.bytes).ok().map(|view| view.datagrams());
    let mut requests =
        request.and_then(|copy| FrameView::parse(copy.bytes).ok()).map(|view| view.datagrams());
    let mut indexes = 0..;
    iter::from_fn(move || {
        loop {
            let datagram = replies.as_mut()?.next()?.ok()?;
            let index = indexes.next()?;
            let request = requests.as_mut().and_then(Iterator::next).and_then(Result::ok);
            // A request may go out with a count in its working counter: what was added matters.
            let sent = request.map_or(0, |request| request.wkc().0);
            let sum = exchange.added(index, sent, datagram.wkc().0);
            let own = datagram.wkc().0.saturating_sub(sent);
            let Some(command) = datagram.command() else { return Some(None) };
            let command = handed(command, request);
            if exchange.is_part && sum == 0 {
                continue;
            }
            return Some(Some(Answer {
                command,
                effect: command.effect(),
                request,
                reply: datagram,
                ado: datagram.ado(),
                sum,
                own,
                is_last: exchange.is_last,
                is_single: exchange.is_last && exchange.earlier.is_empty(),
                sent_by: exchange.sent_by,
                knows_cards: exchange.request.is_some_and(|request| request.path.is_some()),
                sent_at: exchange.request.map(|request| request.time),
                at,
                frame,
            }));
        }
    })
}
