//! Updates of the model by exchanges.
//!
//! A register that came back with a working counter above 0 was read from, or written to, the
//! controller that was addressed. Which controller that is, [`address`] knows; what the registers
//! mean, [`registers`], [`sii`] and [`coe`].

mod address;
mod answer;
mod clock;
mod coe;
mod count;
mod mailbox_state;
mod process_data;
mod registers;
mod sii;

use linesman_proto::address::{DeviceId, Path, Position, RegisterAddress, StationAddress};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;

pub use address::Addresses;
pub(crate) use answer::is_register_everywhere;
pub use answer::{Answer, each_answer};
use count::CountDoubt;
pub(super) use mailbox_state::AwaitedBit;

use super::{Cyclic, Device, NetworkModel, Seen, SharedBy};
use crate::observe::{Exchange, FrameCopy};

/// Process RAM begins here: mailboxes and process data.
const FIRST_RAM: RegisterAddress = RegisterAddress(0x1000);

/// Teaches one line.
#[derive(Clone, Default, Debug)]
pub struct Learner {
    addresses: Addresses,
    latest_cyclic: usize,
    broadcast_doubt: CountDoubt,
    transfers: sii::Transfers,
}

impl Learner {
    /// A learner for a line that may have been planned.
    #[must_use]
    pub fn new(model: &NetworkModel) -> Self {
        Self { addresses: Addresses::new(model), ..Self::default() }
    }

    /// Puts controllers that were met in the middle of a run into order, as far as it can be told.
    /// Identities may change: only for a line of which nothing was said yet.
    pub fn settle(&mut self, model: &mut NetworkModel) {
        self.addresses.count_planned(model, None);
        if self.addresses.expect_unanswered(model) | self.addresses.settle(model) {
            // What was under way was noted by the identities of before.
            self.transfers = sii::Transfers::default();
            model.calm_state = None;
        }
    }

    /// Notes that something was said of single controllers: they keep their numbers from now on.
    pub const fn name(&mut self) {
        self.addresses.name();
    }

    /// Whether the order of controllers is known, so that a tree can be made of them.
    #[must_use]
    pub const fn is_settled(&self) -> bool {
        self.addresses.is_settled()
    }

    /// Learns all that an exchange shows.
    pub fn learn(&mut self, model: &mut NetworkModel, exchange: &Exchange<'_>) {
        match (&exchange.request, &exchange.reply) {
            (request, Some(reply)) => self.answered(model, exchange, request.as_ref(), reply),
            (Some(request), None) => lost(model, exchange, request),
            (None, None) => {}
        }
    }

    /// Learns what the answer to a question shows: the registers, but nothing of the MainDevice's own frames.
    pub fn learn_answer(&mut self, model: &mut NetworkModel, exchange: &Exchange<'_>) {
        let Some(reply) = &exchange.reply else {
            model.traffic.questions.lost += u64::from(!exchange.is_cut_off);
            return;
        };
        model.traffic.questions.answered += 1;
        each_answer(exchange, exchange.request.as_ref(), reply, |answer| {
            let Some(answer) = answer else { return };
            let is_single =
                matches!(answer.effect.addressing, Addressing::Position | Addressing::Station);
            // How many answer a broadcast in UDP says how many process UDP.
            if is_single && !answer.effect.writes {
                let (register, len) = (answer.ado, answer.reply.data_len() as u16);
                model.traffic.questions.note_read(register, len);
                self.single(model, answer);
            }
        });
    }

    fn answered(
        &mut self,
        model: &mut NetworkModel,
        exchange: &Exchange<'_>,
        request: Option<&FrameCopy<'_>>,
        reply: &FrameCopy<'_>,
    ) {
        if let Some(request) = request {
            let (sent, back, len) = (request.time, reply.time, reply.bytes.len());
            let leaves = model.round_trips.depart(sent, back, len, exchange.sent_by);
            if exchange.is_last && model.round_trips.record(sent, leaves, back, reply.number, len) {
                model.touch();
            }
        }
        if exchange.is_last
            && !exchange.earlier.is_empty()
            && model.traffic.losses.end_copies_gone()
        {
            model.touch();
        }
        let mut events = None;
        each_answer(exchange, request, reply, |answer| {
            let Some(answer) = answer else {
                if exchange.is_last {
                    model.traffic.datagrams.record_judged();
                }
                return;
            };
            if let Some(added) = answer.added_events() {
                *events.get_or_insert(0) |= added;
            }
            self.datagram(model, answer);
        });
        if let Some(added) = events
            && model.events.record(added, reply.time, reply.number)
        {
            model.touch();
        }
    }

    fn datagram(&mut self, model: &mut NetworkModel, answer: &Answer<'_>) {
        let is_expected = match answer.effect.addressing {
            Addressing::None => false,
            Addressing::Logical => process_data::returned(model, &mut self.latest_cyclic, answer),
            Addressing::Broadcast => {
                self.broadcast(model, answer);
                answer.is_everywhere()
            }
            Addressing::Position | Addressing::Station => {
                self.single(model, answer);
                answer.is_everywhere()
            }
        };
        if answer.own > 0 {
            model.traffic.record_processed(answer.at);
        }
        if answer.is_last {
            let datagrams = &mut model.traffic.datagrams;
            datagrams.record_judged();
            if is_expected && answer.sum == 0 {
                let seen = Seen::new((), answer.at, Some(answer.frame));
                datagrams.record_unanswered(seen, !model.cyclic.is_empty());
            } else if answer.sum > 0 {
                datagrams.record_answered();
            }
        }
    }

    fn broadcast(&mut self, model: &mut NetworkModel, answer: &Answer<'_>) {
        let passed = answer.passed();
        // A broadcast to an optional register is answered by some only.
        let counts = answer.command == Command::Brd && answer.is_everywhere();
        let is_counted_twice = counts && passed == Some(answer.own);
        if let Some(passed) = passed {
            self.addresses.passed(model, answer.sent_by, passed, is_counted_twice);
        }
        if answer.own > 0 && answer.effect.reads && !answer.effect.writes {
            registers::broadcast_read(model, answer);
        }
        if !answer.is_last {
            return;
        }
        let most = model.traffic.broadcasts.most();
        let is_confirmed = is_counted_twice || passed.is_none();
        if counts && self.broadcast_doubt.is_believed(answer.sum, most, is_confirmed) {
            let broadcasts = &mut model.traffic.broadcasts;
            let split = (answer.sum - answer.own, answer.own);
            let is_split = split.0 > 0 && split.1 > 0;
            if is_split {
                let seen = Seen::new(split, answer.at, Some(answer.frame));
                broadcasts.record_split(seen);
            }
            if !answer.is_single && !is_split && answer.sum > 0 {
                // A guess which card is which proves nothing here.
                let sent_by = answer.sent_by.filter(|_| answer.knows_cards);
                let card = if answer.own > 0 { sent_by } else { sent_by.map(Path::other) };
                let seen = card.map(|card| Seen::new(card, answer.at, Some(answer.frame)));
                broadcasts.record_processed_by_one(seen);
            }
            let seen = Seen::new(answer.sum, answer.at, Some(answer.frame));
            if broadcasts.record(seen, answer.is_single && !model.cyclic.is_empty()) {
                model.touch();
            }
            if passed.is_none() {
                self.addresses.split(answer.sent_by, split);
                self.addresses.count(model, answer.sum);
            }
        }
        if answer.sum == 0 {
            return;
        }
        if answer.effect.writes && !answer.effect.reads {
            self.addresses.broadcast_written(model, answer);
            registers::broadcast_write(model, answer);
        }
    }

    /// A datagram to one controller.
    fn single(&mut self, model: &mut NetworkModel, answer: &Answer<'_>) {
        if let Some(passed) = answer.passed() {
            self.addresses.passed(model, answer.sent_by, passed, false);
        }
        let is_position = answer.effect.addressing == Addressing::Position;
        let station = StationAddress(answer.reply.adp());
        let Some(id) = self.addressed(model, answer, is_position) else {
            if !is_position && answer.is_last && answer.sum == 0 && answer.is_everywhere() {
                self.asked_in_vain(model, answer);
            }
            return;
        };
        if answer.sum > 0 && !is_position {
            self.addresses.answers_at_last(model, station);
        }
        let Some(device) = model.devices.get_mut(id.index()) else { return };
        if answer.effect.multiple_write {
            clock::handed_round(model, id, answer);
        } else if !is_position && answer.sum > answer.command.increment(true, true) {
            // Two controllers have answered: what they say is mixed, and nothing can be learnt of it.
            device.answers(answer.at, Some(answer.frame));
            if answer.is_last {
                let shared = SharedBy::WorkingCounter(answer.sum);
                device.shares_address(station, Seen::new(shared, answer.at, Some(answer.frame)));
                model.touch();
            }
        } else if answer.sum == 0 {
            self.unanswered_by(model, id, answer);
        } else if answer.own > 0 {
            // Otherwise the other copy was answered, and taught what there was to learn.
            self.answered_by(model, id, answer);
        }
    }

    /// The controller that a datagram is for.
    fn addressed(
        &mut self,
        model: &mut NetworkModel,
        answer: &Answer<'_>,
        is_position: bool,
    ) -> Option<DeviceId> {
        if !is_position {
            let station = StationAddress(answer.reply.adp());
            return self.addresses.at_station(model, station, answer.sum > 0);
        }
        let adp = match (answer.request, self.addresses.present()) {
            (Some(request), _) => request.adp(),
            (None, Some(present)) => answer.reply.adp().wrapping_sub(present),
            (None, None) => return None,
        };
        self.addresses.at_position(model, Position::from_auto_increment(adp), answer)
    }

    /// Nobody answers to the station address of a datagram.
    fn asked_in_vain(&mut self, model: &mut NetworkModel, answer: &Answer<'_>) {
        let seen = Seen::new((), answer.at, Some(answer.frame));
        self.addresses.asked_in_vain(model, StationAddress(answer.reply.adp()), seen);
        model.touch();
    }

    /// A datagram to a controller came back as it went out.
    fn unanswered_by(&mut self, model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
        let Some(device) = model.devices.get_mut(id.index()) else { return };
        if answer.is_last && answer.ado >= FIRST_RAM && answer.effect.writes {
            coe::written(model, id, answer, false);
            return;
        }
        if answer.ado >= FIRST_RAM && answer.effect.reads {
            device.mailbox.polled = Some(answer.at);
            device.mailbox.looked(false, answer.at);
            return;
        }
        if answer.is_last && registers::untaken(device, answer) {
            // Whether it is there, others tell: who does not fetch requests takes no new one.
            return;
        }
        if !answer.is_last || !answer.is_everywhere() {
            return;
        }
        if device.answered.is_some() {
            let is_news = device.silent.is_none();
            device.is_silent(answer.at, Some(answer.frame));
            if is_news {
                model.touch();
            }
        } else if answer.effect.addressing != Addressing::Position {
            self.asked_in_vain(model, answer);
        }
    }

    /// A controller has processed a datagram.
    fn answered_by(&mut self, model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
        if answer.effect.addressing == Addressing::Position && !self.addresses.is_settled() {
            // Who is where is a guess so far: only that counts which puts it right.
            if answer.effect.reads {
                self.addresses.read(model, id, answer);
            }
            if answer.effect.writes {
                self.addresses.written(model, id, answer);
            }
            return;
        }
        let Some(device) = model.devices.get_mut(id.index()) else { return };
        let is_news = device.answered.is_none() || device.silent.is_some();
        if model.cyclic.iter().any(|cyclic| cyclic.wkc.has_deficit()) {
            device.heard_short = Some(answer.at);
        }
        device.answers(answer.at, Some(answer.frame));
        if is_news {
            model.touch();
        }
        if answer.ado >= FIRST_RAM {
            if answer.effect.reads {
                coe::read(model, id, answer);
            } else if answer.effect.writes {
                coe::written(model, id, answer, true);
            }
            return;
        }
        if answer.effect.reads {
            self.addresses.read(model, id, answer);
            registers::read(model, id, answer);
            self.transfers.read(model, id, answer);
        }
        if answer.effect.writes {
            self.addresses.written(model, id, answer);
            registers::written(model, id, answer);
            self.transfers.written(id, answer);
        }
    }
}

/// A request that never came back, or of which only some copies did.
fn lost(model: &mut NetworkModel, exchange: &Exchange<'_>, request: &FrameCopy<'_>) {
    let Ok(view) = FrameView::parse(request.bytes) else { return };
    if exchange.is_part {
        return;
    }
    if exchange.is_cut_off {
        model.traffic.in_flight.record_unsettled();
        model.touch();
    }
    if exchange.earlier.is_empty() && !exchange.is_cut_off {
        let by_order = model.is_lost_by_order(request.time);
        model.traffic.record_lost(request.time, request.number, exchange.returns_before, by_order);
        model.touch();
    }
    if !exchange.earlier.is_empty() && exchange.earlier.iter().all(|wkc| *wkc == 0) {
        model.traffic.record_swallowed(request.time, request.number);
        model.touch();
    }
    if let Some(card) = exchange.copy_lost.filter(|_| !model.is_lost_by_order(request.time)) {
        model.traffic.losses.record_copy(card, request.time);
        model.touch();
    }
    if let Some(card) = exchange.copy_gone.filter(|_| !model.is_lost_by_order(request.time)) {
        model.traffic.losses.record_copy_gone(card, request.time);
        model.touch();
    }
    for (index, datagram) in view.datagrams().enumerate() {
        let Ok(datagram) = datagram else { break };
        let counts = &mut model.traffic.datagrams;
        counts.record_judged();
        let sent = datagram.wkc().0;
        if exchange.added(index, sent, sent) == 0 && datagram.command() != Some(Command::Nop) {
            counts.record_unanswered(Seen::new((), request.time, Some(request.number)), false);
        }
        let addressing = datagram.command().map(Command::addressing);
        if addressing == Some(Addressing::Logical) {
            let (start, len) = (datagram.logical(), datagram.data_len() as u16);
            let same = |cyclic: &&mut Cyclic| {
                cyclic.start == start
                    && cyclic.len == len
                    && Some(cyclic.command) == datagram.command()
            };
            if let Some(cyclic) = model.cyclic.iter_mut().find(same) {
                cyclic.sent.tick(request.time);
                cyclic.returned.skip();
            }
        }
        if addressing == Some(Addressing::Station)
            && datagram.command().is_some_and(|command| command.effect().writes)
        {
            // It may have been written all the same: who lies before the place where frames vanish gets them.
            let (station, seen) =
                (datagram.adp(), Seen::new((), request.time, Some(request.number)));
            let is_it = |device: &&Device| device.station.is_some_and(|own| own.0 == station);
            let write = model.devices.iter().find(is_it).and_then(|device| {
                registers::loop_write(device, (datagram.ado(), datagram.data()), seen)
            });
            if let Some(write) = write {
                model.note_loops(write);
            } else if registers::is_dl_control(datagram.ado(), datagram.data()) {
                model.note_order(request.time);
            }
        }
        if datagram.command().is_some_and(|command| command.effect().writes) {
            let ids = concerned(model, addressing, datagram.adp());
            registers::may_be_cleared(model, &ids, (datagram.ado(), datagram.data()), request.time);
        }
        if matches!(addressing, Some(Addressing::Station | Addressing::Logical)) {
            model.traffic.datagrams.record_lost(addressing == Some(Addressing::Logical));
        }
    }
}

/// The controllers that a datagram with this address is for, as far as they are known.
fn concerned(model: &NetworkModel, addressing: Option<Addressing>, adp: u16) -> Vec<DeviceId> {
    match addressing {
        Some(Addressing::Station) => model.by_station(StationAddress(adp)).into_iter().collect(),
        Some(Addressing::Position) => {
            model.by_position(Position::from_auto_increment(adp)).into_iter().collect()
        }
        Some(Addressing::Broadcast) => model.devices.iter().map(|device| device.id).collect(),
        Some(_) | None => Vec::new(),
    }
}

/// The part of `data`, which lies at `start`, that is `len` bytes at `address`.
fn part(data: &[u8], start: RegisterAddress, address: u16, len: usize) -> Option<&[u8]> {
    let offset = usize::from(address.checked_sub(start.0)?);
    data.get(offset..offset + len)
}

/// The word at `address`, as [`part`].
fn word_at(data: &[u8], start: RegisterAddress, address: u16) -> Option<u16> {
    let bytes = part(data, start, address, 2)?;
    Some(u16::from_le_bytes([bytes[0], bytes[1]]))
}
