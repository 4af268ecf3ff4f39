//! Answers: the datagrams of a frame that came back, with what is known of their way.

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

/// The same as one bit for each register, as it is asked for each datagram.
const EVERYWHERE_BITS: [u64; 21] = {
    let mut bits = [0; 21];
    let mut index = 0;
    while index < EVERYWHERE.len() {
        let mut register = EVERYWHERE[index].start as usize;
        while register < EVERYWHERE[index].end as usize {
            bits[register / 64] |= 1 << (register % 64);
            register += 1;
        }
        index += 1;
    }
    bits
};

/// Whether every controller has the register at this address.
#[must_use]
#[inline]
pub(crate) fn is_register_everywhere(ado: RegisterAddress) -> bool {
    let bits = EVERYWHERE_BITS.get(usize::from(ado.0) / 64);
    bits.is_some_and(|bits| bits >> (ado.0 % 64) & 1 != 0)
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

/// Hands the datagrams of a frame that came back to `take`, one by one; `None` for one whose command is not known.
#[inline]
pub fn each_answer<'a>(
    exchange: &Exchange<'_>,
    request: Option<&FrameCopy<'a>>,
    reply: &FrameCopy<'a>,
    mut take: impl FnMut(Option<&Answer<'a>>),
) {
    let Ok(view) = FrameView::parse(reply.bytes) else { return };
    let request = request.and_then(|copy| FrameView::parse(copy.bytes).ok());
    let mut requests = request.map(|view| view.datagrams());
    for (index, datagram) in view.datagrams().map_while(Result::ok).enumerate() {
        let request = requests.as_mut().and_then(Iterator::next).and_then(Result::ok);
        // A request may go out with a count in its working counter: what was added matters.
        let sent = request.map_or(0, |request| request.wkc().0);
        let sum = exchange.added(index, sent, datagram.wkc().0);
        let Some(command) = datagram.command() else {
            take(None);
            continue;
        };
        let command = handed(command, request);
        if exchange.is_part && sum == 0 {
            continue;
        }
        take(Some(&Answer {
            command,
            effect: command.effect(),
            request,
            reply: datagram,
            ado: datagram.ado(),
            sum,
            own: datagram.wkc().0.saturating_sub(sent),
            is_last: exchange.is_last,
            is_single: exchange.is_last && exchange.earlier.is_empty(),
            sent_by: exchange.sent_by,
            knows_cards: exchange.request.is_some_and(|request| request.path.is_some()),
            sent_at: exchange.request.map(|request| request.time),
            at: reply.time,
            frame: reply.number,
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_of_every_controller_are_those_of_the_table() {
        for ado in 0..=u16::MAX {
            let is_in_table = EVERYWHERE.iter().any(|range| range.contains(&ado));
            assert_eq!(is_register_everywhere(RegisterAddress(ado)), is_in_table, "{ado:#06x}");
        }
    }
}
