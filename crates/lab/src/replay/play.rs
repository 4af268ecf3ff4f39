//! Plays the requests of a recording.

use linesman_diagnosis::observe::Fingerprint;
use linesman_proto::address::{DeviceId, Path, RegisterAddress};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::register::{self as r, FmmuConfig, SyncManagerConfig};
use linesman_proto::time::{Instant, Span};
use linesman_sim::controller::Controller;
use linesman_sim::device::Signals;
use linesman_sim::segment::Segment;

use super::compare::{Difference, Outcome, What, compare};
use super::exception::Reasons;
use super::firmware::input_areas;
use super::model::{Inputs, Model};
use super::recording::{Datagram, Recording, Turn, datagrams};
use super::report::Report;

/// The run begins this long after the supply came.
const BEFORE: Span = Span::s(1);
/// The last frames are waited for this long.
const AFTER: Span = Span::ms(10);

/// A request that has not come back.
struct Outstanding {
    turn: usize,
    print: u64,
    /// For each datagram that fetches a mailbox, the length of that in bytes.
    mailboxes: Vec<Option<u16>>,
}

/// Plays all requests at their times, and compares what comes back.
#[must_use]
pub fn play(recording: &Recording, model: &mut Model) -> Report {
    let mut report = Report::of(recording, model);
    let reasons = Reasons::of(recording);
    let mut outstanding: Vec<Outstanding> = Vec::new();
    let start = recording.turns.first().map_or(Instant::ZERO, |turn| turn.request.at);
    let mut now = Instant::ZERO + BEFORE;
    for (index, turn) in recording.turns.iter().enumerate() {
        // Time stamps of several cards may run backwards; the segment's time does not.
        now = now.max(Instant::ZERO + BEFORE + turn.request.at.since(start));
        model.segment.advance(now);
        collect(recording, &reasons, &mut model.segment, &mut outstanding, &mut report);
        feed(turn, model);
        let mailboxes = turn
            .request
            .datagrams()
            .iter()
            .map(|one| fetched_mailbox(one, &model.segment))
            .collect();
        let print = lasting(&turn.request.bytes);
        outstanding.push(Outstanding { turn: index, print, mailboxes });
        model.segment.handle_frame(now, Path::A, &turn.request.bytes);
    }
    model.segment.advance(now + AFTER);
    collect(recording, &reasons, &mut model.segment, &mut outstanding, &mut report);
    for lost in outstanding {
        missing(&recording.turns[lost.turn], &reasons, &mut report);
    }
    report
}

fn lasting(frame: &[u8]) -> u64 {
    FrameView::parse(frame).map_or(0, |view| Fingerprint::of(&view).lasting)
}

/// Takes what came back.
fn collect(
    recording: &Recording,
    reasons: &Reasons,
    segment: &mut Segment,
    outstanding: &mut Vec<Outstanding>,
    report: &mut Report,
) {
    let mut buffer = Vec::new();
    while let Some(arrival) = segment.poll_arrival(&mut buffer) {
        let print = lasting(&buffer);
        let Some(at) = outstanding.iter().position(|one| one.print == print) else { continue };
        let one = outstanding.remove(at);
        let turn = &recording.turns[one.turn];
        if !arrival.intact {
            missing(turn, reasons, report);
            continue;
        }
        let Some(reply) = &turn.reply else {
            report.unanswered += 1;
            continue;
        };
        if turn.is_rebuilt {
            continue;
        }
        let ours = datagrams(&buffer);
        for (number, recorded) in reply.datagrams().iter().enumerate() {
            let outcome = match ours.get(number) {
                Some(ours) => compare(recorded, ours, one.mailboxes.get(number).copied().flatten()),
                None => not_there(recorded),
            };
            report.add(turn, number, recorded, outcome, reasons);
        }
    }
}

fn missing(turn: &Turn, reasons: &Reasons, report: &mut Report) {
    match &turn.reply {
        Some(_) if turn.is_rebuilt => {}
        None => report.unanswered += 1,
        Some(reply) => {
            for (number, recorded) in reply.datagrams().iter().enumerate() {
                report.add(turn, number, recorded, not_there(recorded), reasons);
            }
        }
    }
}

fn not_there(recorded: &Datagram<'_>) -> Outcome {
    Outcome::Differs(Difference {
        what: What::Missing,
        expected: format!("working counter {}", recorded.wkc),
        received: "nothing".to_owned(),
    })
}

// ---- what the segment's registers say ----

fn controllers(segment: &Segment) -> impl Iterator<Item = (DeviceId, &Controller)> {
    segment.devices().filter_map(|id| Some((id, segment.controller(id)?)))
}

fn bytes<const N: usize>(controller: &Controller, at: RegisterAddress) -> [u8; N] {
    std::array::from_fn(|offset| {
        controller.register(RegisterAddress(at.0.saturating_add(offset as u16)))
    })
}

fn sync_manager(controller: &Controller, index: u8) -> Option<SyncManagerConfig> {
    let count = controller.hardware().sync_managers;
    let at = r::SYNC_MANAGER.at(u16::from(index)).filter(|_| index < count)?;
    Some(SyncManagerConfig::from_bytes(bytes(controller, at)))
}

/// Which device a datagram is for, in the segment as it is.
fn addressed(datagram: &Datagram<'_>, segment: &Segment) -> Option<DeviceId> {
    match datagram.command?.addressing() {
        Addressing::Position => segment.devices().nth(usize::from(0u16.wrapping_sub(datagram.adp))),
        Addressing::Station => controllers(segment)
            .find(|(_, controller)| controller.station_address().0 == datagram.adp)
            .map(|(id, _)| id),
        Addressing::Broadcast | Addressing::Logical | Addressing::None => None,
    }
}

/// The length of the mailbox that a datagram fetches.
fn fetched_mailbox(datagram: &Datagram<'_>, segment: &Segment) -> Option<u16> {
    let reads = datagram.command.is_some_and(|command| command.effect().reads);
    let device = addressed(datagram, segment).filter(|_| reads)?;
    let mailbox = sync_manager(segment.controller(device)?, 1)?;
    (mailbox.is_active() && mailbox.start == datagram.ado).then_some(mailbox.length)
}

// ---- the world outside ----

/// The inputs are as the recorded answer shows them: what they are is the world's affair.
fn feed(turn: &Turn, model: &mut Model) {
    for (request, reply) in turn.pairs() {
        if reply.wkc == 0 {
            continue;
        }
        match request.command {
            Some(Command::Lrd | Command::Lrw) => {
                for (device, inputs) in model.inputs.iter().enumerate() {
                    feed_mapped(device, &reply, inputs, &mut model.segment);
                }
            }
            Some(command) if command.effect().reads => feed_direct(&reply, model),
            Some(_) | None => {}
        }
    }
}

fn feed_mapped(device: usize, reply: &Datagram<'_>, inputs: &Inputs, segment: &mut Segment) {
    let mut values: Vec<(usize, u8, bool)> = Vec::new();
    {
        let Some(controller) = segment.controller(DeviceId(device as u32)) else { return };
        let areas = input_areas(|index| sync_manager(controller, index));
        for index in 0..u16::from(controller.hardware().fmmus) {
            let Some(at) = r::FMMU.at(index) else { break };
            let fmmu = FmmuConfig::from_bytes(bytes(controller, at));
            if !fmmu.active || !fmmu.reads {
                continue;
            }
            let Some(overlap) = fmmu.overlap(reply.logical, reply.data.len() as u16) else {
                continue;
            };
            let from = usize::from(overlap.datagram_offset);
            for offset in from..from + usize::from(overlap.length) {
                let logical =
                    linesman_proto::address::LogicalAddress(reply.logical.0 + offset as u32);
                for bit in 0..8 {
                    let Some((place, place_bit)) = fmmu.locate_bit(logical, bit) else { continue };
                    let area = areas.iter().find(|(_, manager, _)| manager.touches(place, 1));
                    if let Some((_, manager, first)) = area {
                        let byte = first + usize::from(place.0 - manager.start.0);
                        values.push((byte, place_bit, reply.data[offset] >> bit & 1 != 0));
                    }
                }
            }
        }
    }
    for (byte, bit, high) in values {
        set(inputs, byte, bit, high, segment.signals_mut());
    }
}

/// A bit of a device's inputs is high or low in the world outside.
fn set(inputs: &Inputs, byte: usize, bit: u8, high: bool, signals: &mut Signals) {
    match inputs {
        Inputs::Bytes(list) => {
            if let Some(signal) = list.get(byte) {
                let before = signals.value(*signal);
                signals.set(*signal, before & !(1 << bit) | i32::from(high) << bit);
            }
        }
        Inputs::Bits(list) => {
            if let Some(signal) = list.get(byte * 8 + usize::from(bit)) {
                signals.set(*signal, i32::from(high));
            }
        }
    }
}

fn feed_direct(reply: &Datagram<'_>, model: &mut Model) {
    let mut request = *reply;
    if reply.command.is_some_and(|command| command.addressing() == Addressing::Position) {
        // It came back with the number of all devices added.
        request.adp = reply.adp.wrapping_sub(model.inputs.len() as u16);
    }
    let Some(device) = addressed(&request, &model.segment) else { return };
    let Some(controller) = model.segment.controller(device) else { return };
    let areas = input_areas(|index| sync_manager(controller, index));
    for (offset, value) in reply.data.iter().enumerate() {
        let place = RegisterAddress(reply.ado.0.wrapping_add(offset as u16));
        let area = areas.iter().find(|(_, manager, _)| manager.touches(place, 1));
        if let Some((_, manager, first)) = area {
            let byte = first + usize::from(place.0 - manager.start.0);
            for bit in 0..8 {
                let high = value >> bit & 1 != 0;
                set(&model.inputs[device.index()], byte, bit, high, model.segment.signals_mut());
            }
        }
    }
}
