//! One access to registers or memory, as a datagram and its return show it.

use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::model::learn::{Answer, each_answer};
use linesman_diagnosis::observe::{Exchange, FrameCopy};
use linesman_proto::address::{
    DeviceId, LogicalAddress, Path, Position, RegisterAddress, StationAddress,
};
use linesman_proto::command::{Addressing, Command, Effect};
use linesman_proto::frame::FrameView;
use linesman_proto::time::Instant;

/// Whom a datagram means.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum DatagramTarget {
    /// Nobody: NOP.
    Nobody,
    /// All SubDevices.
    All,
    /// The SubDevice at a position.
    Position(Position),
    /// The SubDevice with a station address.
    Station(StationAddress),
    /// Whoever has an FMMU there.
    Logical(LogicalAddress),
}

impl DatagramTarget {
    /// The SubDevice that it means, as far as it is known at the end of the capture.
    #[must_use]
    pub fn device(self, model: &NetworkModel) -> Option<DeviceId> {
        match self {
            Self::Position(position) => model.by_position(position),
            Self::Station(station) => model.by_station(station),
            Self::Nobody | Self::All | Self::Logical(_) => None,
        }
    }
}

/// A datagram as it went out and came back.
#[derive(Clone, Copy, Debug)]
pub struct DatagramAccess<'a> {
    /// Its command.
    pub command: Command,
    /// Effect of the command.
    pub effect: Effect,
    /// Whom it means.
    pub target: DatagramTarget,
    /// The register or memory address; of logical commands the high word of the address.
    pub address: RegisterAddress,
    /// Its length in bytes.
    pub len: u16,
    /// The data that it writes; `None` where it writes none, or they were not seen.
    pub written: Option<&'a [u8]>,
    /// The data that it read; `None` where nobody has answered.
    pub read: Option<&'a [u8]>,
    /// What SubDevices have added to its working counter; `None` where it did not come back.
    pub wkc: Option<u16>,
    /// The part of the working counter that SubDevices have added to this copy alone.
    pub own: u16,
    /// The card of a ring by which this copy had gone out; `None` where that is not known.
    pub sent_by: Option<Path>,
    /// True if another copy of it came back before: in a ring each request goes out by both cards.
    pub is_further_copy: bool,
    /// When it came back, or went out if it did not.
    pub at: Instant,
    /// The number of that frame.
    pub frame: u64,
}

impl<'a> DatagramAccess<'a> {
    /// The bytes that were read at `address`, if it covers all of them.
    #[must_use]
    pub fn read_at(&self, address: u16, len: usize) -> Option<&'a [u8]> {
        part(self.read?, self.address, address, len)
    }

    /// The bytes that were written at `address`, if it covers all of them.
    #[must_use]
    pub fn written_at(&self, address: u16, len: usize) -> Option<&'a [u8]> {
        part(self.written?, self.address, address, len)
    }

    fn answered(answer: &Answer<'a>, counted: u16, is_further_copy: bool) -> Self {
        let (effect, reply) = (answer.effect, answer.reply);
        let written = match (effect.writes, answer.request, effect.reads) {
            (false, _, _) | (true, None, true) => None,
            (true, Some(request), _) => Some(request.data()),
            (true, None, false) => Some(reply.data()),
        };
        let sent = answer.request.map(|request| request.adp());
        // Each SubDevice on the way has added one.
        let adp = sent.unwrap_or_else(|| reply.adp().wrapping_sub(counted));
        Self {
            command: answer.command,
            effect,
            target: target(effect.addressing, adp, reply.adp(), reply.logical()),
            address: answer.ado,
            len: reply.data_len() as u16,
            written,
            read: (effect.reads && answer.own > 0).then(|| reply.data()),
            wkc: Some(answer.sum),
            own: answer.own,
            sent_by: answer.sent_by,
            is_further_copy,
            at: answer.at,
            frame: answer.frame,
        }
    }
}

fn part(data: &[u8], start: RegisterAddress, address: u16, len: usize) -> Option<&[u8]> {
    let offset = usize::from(address.checked_sub(start.0)?);
    data.get(offset..offset + len)
}

const fn target(
    addressing: Addressing,
    adp: u16,
    back: u16,
    logical: LogicalAddress,
) -> DatagramTarget {
    match addressing {
        Addressing::None => DatagramTarget::Nobody,
        Addressing::Broadcast => DatagramTarget::All,
        Addressing::Position => DatagramTarget::Position(Position::from_auto_increment(adp)),
        Addressing::Station => DatagramTarget::Station(StationAddress(back)),
        Addressing::Logical => DatagramTarget::Logical(logical),
    }
}

/// The datagrams of an exchange, one by one. `counted` is how many SubDevices there are, by which positions are found
/// of datagrams that were seen on their way back only.
pub fn accesses<'a>(
    exchange: &'a Exchange<'_>,
    counted: u16,
    mut take: impl FnMut(&DatagramAccess<'a>),
) {
    match (&exchange.request, &exchange.reply) {
        (request, Some(reply)) => {
            let is_further = !exchange.earlier.is_empty();
            each_answer(exchange, request.as_ref(), reply, |answer| {
                if let Some(answer) = answer {
                    take(&DatagramAccess::answered(answer, counted, is_further));
                }
            });
        }
        (Some(request), None) => lost(request, take),
        (None, None) => {}
    }
}

/// The datagrams of a request that did not come back.
fn lost<'a>(request: &FrameCopy<'a>, mut take: impl FnMut(&DatagramAccess<'a>)) {
    let Ok(view) = FrameView::parse(request.bytes) else { return };
    for datagram in view.datagrams().map_while(Result::ok) {
        let Some(command) = datagram.command() else { continue };
        let (effect, adp) = (command.effect(), datagram.adp());
        take(&DatagramAccess {
            command,
            effect,
            target: target(effect.addressing, adp, adp, datagram.logical()),
            address: datagram.ado(),
            len: datagram.data_len() as u16,
            written: effect.writes.then(|| datagram.data()),
            read: None,
            wkc: None,
            own: 0,
            sent_by: None,
            is_further_copy: false,
            at: request.time,
            frame: request.number,
        });
    }
}
