//! How exchanges teach the line.
//!
//! A register that came back with a working counter above 0 was read from, or written to, the
//! controller that was addressed. Which controller that is, [`address`] knows; what the registers
//! mean, [`registers`], [`sii`] and [`coe`].

mod address;
mod answer;
mod clock;
mod coe;
mod count;
mod process_data;
mod registers;
mod sii;

use linesman_proto::address::{DeviceId, Path, Position, RegisterAddress, StationAddress};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;

pub use address::Addresses;
use answer::{Answer, answers};
use count::CountDoubt;

use super::{CountRise, Cyclic, Device, Line, Seen, SharedBy};
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
    pub fn new(line: &Line) -> Self {
        Self { addresses: Addresses::new(line), ..Self::default() }
    }

    /// Puts controllers that were met in the middle of a run into order, as far as it can be told.
    /// Identities may change: only for a line of which nothing was said yet.
    pub fn settle(&mut self, line: &mut Line) {
        self.addresses.count_planned(line, None);
        if self.addresses.expect_unanswered(line) | self.addresses.settle(line) {
            // What was under way was noted by the identities of before.
            self.transfers = sii::Transfers::default();
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
    pub fn learn(&mut self, line: &mut Line, exchange: &Exchange<'_>) {
        match (&exchange.request, &exchange.reply) {
            (request, Some(reply)) => self.answered(line, exchange, request.as_ref(), reply),
            (Some(request), None) => lost(line, exchange, request),
            (None, None) => {}
        }
    }

    /// Learns what the answer to a question shows: the registers, but nothing of the MainDevice's own frames.
    pub fn learn_answer(&mut self, line: &mut Line, exchange: &Exchange<'_>) {
        let Some(reply) = &exchange.reply else {
            line.traffic.questions.lost += u64::from(!exchange.is_cut_off);
            return;
        };
        line.traffic.questions.answered += 1;
        for answer in answers(exchange, exchange.request.as_ref(), reply).flatten() {
            let is_single =
                matches!(answer.effect.addressing, Addressing::Position | Addressing::Station);
            // How many answer a broadcast in UDP says how many process UDP.
            if is_single && !answer.effect.writes {
                let (register, len) = (answer.ado, answer.reply.data_len() as u16);
                line.traffic.questions.note_read(register, len);
                self.single(line, &answer);
            }
        }
    }

    fn answered(
        &mut self,
        line: &mut Line,
        exchange: &Exchange<'_>,
        request: Option<&FrameCopy<'_>>,
        reply: &FrameCopy<'_>,
    ) {
        if let Some(request) = request.filter(|_| exchange.is_last) {
            let (sent, back, len) = (request.time, reply.time, reply.bytes.len());
            if line.trips.record(sent, back, reply.number, len) {
                line.touch();
            }
        }
        let mut events = None;
        for answer in answers(exchange, request, reply) {
            let Some(answer) = answer else {
                line.traffic.datagrams += u64::from(exchange.is_last);
                continue;
            };
            if let Some(added) = answer.added_events() {
                *events.get_or_insert(0) |= added;
            }
            self.datagram(line, &answer);
        }
        if let Some(added) = events
            && line.events.record(added, reply.time, reply.number)
        {
            line.touch();
        }
    }

    fn datagram(&mut self, line: &mut Line, answer: &Answer<'_>) {
        let is_expected = match answer.effect.addressing {
            Addressing::None => false,
            Addressing::Logical => process_data::returned(line, &mut self.latest_cyclic, answer),
            Addressing::Broadcast => {
                self.broadcast(line, answer);
                answer.is_everywhere()
            }
            Addressing::Position | Addressing::Station => {
                self.single(line, answer);
                answer.is_everywhere()
            }
        };
        if answer.own > 0 {
            line.traffic.record_processed(answer.at);
        }
        if answer.is_last {
            line.traffic.datagrams += 1;
            if is_expected && answer.sum == 0 {
                line.traffic.unanswered += 1;
                line.traffic.unanswered_alone += u64::from(!line.cyclic.is_empty());
                let seen = Seen::new((), answer.at, Some(answer.frame));
                line.traffic.first_unanswered.get_or_insert(seen);
            } else if answer.sum > 0 {
                line.traffic.answered += 1;
            }
        }
    }

    fn broadcast(&mut self, line: &mut Line, answer: &Answer<'_>) {
        let passed = answer.passed();
        // A broadcast to an optional register is answered by some only.
        let counts = answer.command == Command::Brd && answer.is_everywhere();
        let is_counted_twice = counts && passed == Some(answer.own);
        if let Some(passed) = passed {
            self.addresses.passed(line, answer.sent_by, passed, is_counted_twice);
        }
        if !answer.is_last {
            return;
        }
        let most = line.traffic.broadcast_answers;
        let is_confirmed = is_counted_twice || passed.is_none();
        if counts && self.broadcast_doubt.is_believed(answer.sum, most, is_confirmed) {
            if answer.is_single && answer.sum > most && !line.cyclic.is_empty() {
                let more = Seen::new(answer.sum, answer.at, Some(answer.frame));
                let fewer = line.traffic.broadcast_now.filter(|now| now.value == most && most > 0);
                let rise = fewer.map(|fewer| CountRise { fewer, more });
                line.traffic.broadcast_rose = rise.or(line.traffic.broadcast_rose);
            }
            line.traffic.broadcast_answers = most.max(answer.sum);
            line.traffic.broadcast_read = line.traffic.broadcast_read.max(Some(answer.at));
            let split = (answer.sum - answer.own, answer.own);
            let is_split = split.0 > 0 && split.1 > 0;
            if is_split {
                let seen = Seen::new(split, answer.at, Some(answer.frame));
                line.traffic.broadcast_split = Some(seen);
            }
            if !answer.is_single && !is_split && answer.sum > 0 {
                line.traffic.was_processed_by_one = true;
                // A guess which card is which proves nothing here.
                let sent_by = answer.sent_by.filter(|_| answer.knows_cards);
                let card = if answer.own > 0 { sent_by } else { sent_by.map(Path::other) };
                line.traffic.processed_alone =
                    card.map(|card| Seen::new(card, answer.at, Some(answer.frame)));
            }
            let is_news = line.traffic.broadcast_now.is_none_or(|known| known.value != answer.sum);
            if is_news {
                let seen = Seen::new(answer.sum, answer.at, Some(answer.frame));
                if line.traffic.broadcast_first_low.is_none()
                    && answer.sum < line.traffic.broadcast_answers
                {
                    line.traffic.broadcast_first_low = Some(seen);
                }
                line.traffic.broadcast_now = Some(seen);
                line.touch();
            }
            if passed.is_none() {
                self.addresses.split(answer.sent_by, split);
                self.addresses.count(line, answer.sum);
            }
        }
        if answer.sum == 0 {
            return;
        }
        if answer.effect.reads && !answer.effect.writes {
            registers::broadcast_read(line, answer);
        }
        if answer.effect.writes && !answer.effect.reads {
            self.addresses.broadcast_written(line, answer);
            registers::broadcast_write(line, answer);
        }
    }

    /// A datagram to one controller.
    fn single(&mut self, line: &mut Line, answer: &Answer<'_>) {
        if let Some(passed) = answer.passed() {
            self.addresses.passed(line, answer.sent_by, passed, false);
        }
        let is_position = answer.effect.addressing == Addressing::Position;
        let device = if is_position {
            let adp = match (answer.request, self.addresses.present()) {
                (Some(request), _) => Some(request.adp()),
                (None, Some(present)) => Some(answer.reply.adp().wrapping_sub(present)),
                (None, None) => None,
            };
            let position = adp.map(Position::from_auto_increment);
            position.and_then(|position| self.addresses.at_position(line, position, answer))
        } else {
            let station = StationAddress(answer.reply.adp());
            self.addresses.at_station(line, station, answer.sum > 0)
        };
        let Some(id) = device else {
            if !is_position && answer.is_last && answer.sum == 0 && answer.is_everywhere() {
                let seen = Seen::new((), answer.at, Some(answer.frame));
                let station = StationAddress(answer.reply.adp());
                self.addresses.asked_in_vain(line, station, seen);
                line.touch();
            }
            return;
        };
        if answer.sum > 0 && !is_position {
            self.addresses.answers_at_last(line, StationAddress(answer.reply.adp()));
        }
        let Some(device) = line.devices.get_mut(id.index()) else { return };
        if answer.effect.multiple_write {
            clock::handed_round(line, id, answer);
            return;
        }
        if !is_position && answer.sum > answer.command.increment(true, true) {
            // Two controllers have answered: what they say is mixed, and nothing can be learnt of it.
            device.answers(answer.at, Some(answer.frame));
            if answer.is_last {
                let shared = SharedBy::WorkingCounter(answer.sum);
                let station = StationAddress(answer.reply.adp());
                device.shares_address(station, Seen::new(shared, answer.at, Some(answer.frame)));
                line.touch();
            }
            return;
        }
        if answer.sum == 0 {
            if answer.is_last && answer.ado >= FIRST_RAM && answer.effect.writes {
                coe::written(line, id, answer, false);
                return;
            }
            if answer.ado >= FIRST_RAM && answer.effect.reads {
                device.mailbox.polled = Some(answer.at);
                return;
            }
            if answer.is_last && registers::untaken(device, answer) {
                // Whether it is there, others tell: who does not fetch requests takes no new one.
                return;
            }
            let is_asked = answer.is_last && answer.is_everywhere();
            if is_asked && device.answered.is_none() && !is_position {
                let seen = Seen::new((), answer.at, Some(answer.frame));
                let station = StationAddress(answer.reply.adp());
                self.addresses.asked_in_vain(line, station, seen);
                line.touch();
                return;
            }
            if is_asked && device.answered.is_some() {
                let is_news = device.silent.is_none();
                device.is_silent(answer.at, Some(answer.frame));
                if is_news {
                    line.touch();
                }
            }
            return;
        }
        if answer.own == 0 {
            // The other copy was answered, and taught what there was to learn.
            return;
        }
        if is_position && !self.addresses.is_settled() {
            // Who is where is a guess so far: only that counts which puts it right.
            if answer.effect.reads {
                self.addresses.read(line, id, answer);
            }
            if answer.effect.writes {
                self.addresses.written(line, id, answer);
            }
            return;
        }
        let is_news = device.answered.is_none() || device.silent.is_some();
        if line.cyclic.iter().any(Cyclic::has_deficit) {
            device.heard_short = Some(answer.at);
        }
        device.answers(answer.at, Some(answer.frame));
        if is_news {
            line.touch();
        }
        if answer.ado >= FIRST_RAM {
            if answer.effect.reads {
                coe::read(line, id, answer);
            } else if answer.effect.writes {
                coe::written(line, id, answer, true);
            }
            return;
        }
        if answer.effect.reads {
            self.addresses.read(line, id, answer);
            registers::read(line, id, answer);
            self.transfers.read(line, id, answer);
        }
        if answer.effect.writes {
            self.addresses.written(line, id, answer);
            registers::written(line, id, answer);
            self.transfers.written(id, answer);
        }
    }
}

/// A request that never came back, or of which only some copies did.
fn lost(line: &mut Line, exchange: &Exchange<'_>, request: &FrameCopy<'_>) {
    let Ok(view) = FrameView::parse(request.bytes) else { return };
    if exchange.is_part {
        return;
    }
    if exchange.earlier.is_empty() && !exchange.is_cut_off {
        let by_order = line.is_lost_by_order(request.time);
        line.traffic.record_lost(request.time, request.number, exchange.returns_before, by_order);
        line.touch();
    }
    if !exchange.earlier.is_empty() && exchange.earlier.iter().all(|wkc| *wkc == 0) {
        line.traffic.record_swallowed(request.time, request.number);
        line.touch();
    }
    if let Some(card) = exchange.copy_lost.filter(|_| !line.is_lost_by_order(request.time)) {
        line.traffic.copies_lost[card.index()].add(1, request.time);
        line.touch();
    }
    if exchange.is_copy_gone && !line.is_lost_by_order(request.time) {
        line.traffic.copies_gone.add(1, request.time);
        line.touch();
    }
    for (index, datagram) in view.datagrams().enumerate() {
        let Ok(datagram) = datagram else { break };
        let traffic = &mut line.traffic;
        traffic.datagrams += 1;
        let sent = datagram.wkc().0;
        if exchange.added(index, sent, sent) == 0 && datagram.command() != Some(Command::Nop) {
            traffic.unanswered += 1;
            let seen = Seen::new((), request.time, Some(request.number));
            traffic.first_unanswered.get_or_insert(seen);
        }
        let addressing = datagram.command().map(Command::addressing);
        if addressing == Some(Addressing::Logical) {
            let (start, len) = (datagram.logical(), datagram.data_len() as u16);
            let same = |cyclic: &&mut Cyclic| {
                cyclic.start == start
                    && cyclic.len == len
                    && Some(cyclic.command) == datagram.command()
            };
            if let Some(cyclic) = line.cyclic.iter_mut().find(same) {
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
            let write = line.devices.iter().find(is_it).and_then(|device| {
                registers::loop_write(device, (datagram.ado(), datagram.data()), seen)
            });
            if let Some(write) = write {
                line.note_loops(write);
            } else if registers::is_dl_control(datagram.ado(), datagram.data()) {
                line.loops_ordered = Some(request.time);
            }
        }
        if datagram.command().is_some_and(|command| command.effect().writes) {
            let ids = concerned(line, addressing, datagram.adp());
            registers::may_be_cleared(line, &ids, (datagram.ado(), datagram.data()), request.time);
        }
        let traffic = &mut line.traffic;
        if matches!(addressing, Some(Addressing::Station | Addressing::Logical)) {
            traffic.lost_addressed += 1;
            traffic.lost_logical += u64::from(addressing == Some(Addressing::Logical));
        }
    }
}

/// The controllers that a datagram with this address is for, as far as they are known.
fn concerned(line: &Line, addressing: Option<Addressing>, adp: u16) -> Vec<DeviceId> {
    match addressing {
        Some(Addressing::Station) => line.by_station(StationAddress(adp)).into_iter().collect(),
        Some(Addressing::Position) => {
            line.by_position(Position::from_auto_increment(adp)).into_iter().collect()
        }
        Some(Addressing::Broadcast) => line.devices.iter().map(|device| device.id).collect(),
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
