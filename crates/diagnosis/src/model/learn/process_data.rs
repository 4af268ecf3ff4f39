//! Process data: logical datagrams and the working counters that they come back with.

use linesman_proto::address::LogicalAddress;
use linesman_proto::time::Span;

use super::{Answer, mailbox_state};
use crate::model::{Cyclic, Device, NetworkModel, Ordered, Owner, Seen, owners};

/// A working counter that falls so soon after the first frame may have been ordered to before.
const JUST_BEGUN: Span = Span::ms(200);
/// A working counter that is lower than planned for so long, while nobody is seen in a lower state than OP, is not on its way up.
const BELOW_PLAN: Span = Span::s(1);
/// Most logical datagrams that are followed.
const MOST_CYCLIC: usize = 256;

/// Whether nobody has been seen to set up a datagram's process data or to ask anybody for a state.
fn is_unordered(devices: &[Device], start: LogicalAddress, len: u16) -> bool {
    devices.iter().all(|device| device.al.requested.is_none())
        && owners(devices, start, len).next().is_none()
}

/// Index of an answer's datagram among those that are followed; `latest` is that of the answer before.
fn known_datagram(cyclic: &[Cyclic], latest: usize, answer: &Answer<'_>) -> Option<usize> {
    let (start, len) = (answer.reply.logical(), answer.reply.data_len() as u16);
    let is_it = |cyclic: &Cyclic| {
        cyclic.start == start && cyclic.len == len && cyclic.command == answer.command
    };
    // They come in the same order each cycle.
    let guess = (latest + 1) % cyclic.len().max(1);
    if cyclic.get(guess).is_some_and(is_it) { Some(guess) } else { cyclic.iter().position(is_it) }
}

/// A datagram to whoever has an FMMU there. Says whether an answer was expected.
pub(super) fn returned(model: &mut NetworkModel, latest: &mut usize, answer: &Answer<'_>) -> bool {
    mailbox_state::look(model, answer);
    if !answer.is_last {
        return true;
    }
    let (start, len) = (answer.reply.logical(), answer.reply.data_len() as u16);
    let seen = Seen::new(answer.sum, answer.at, Some(answer.frame));
    let Some(index) = known_datagram(&model.cyclic, *latest, answer) else {
        if model.cyclic.len() < MOST_CYCLIC {
            *latest = model.cyclic.len();
            let planned = model.planned_exchange.counter(answer.command, start, len);
            model.cyclic.push(Cyclic::new(answer.command, start, len, seen, planned));
            model.touch();
        }
        return false;
    };
    *latest = index;
    let devices = &model.devices;
    let cyclic = &mut model.cyclic[index];
    let cyclic_before = cyclic.returned.last();
    let (traffic, sees_all) = (&model.traffic, model.sees_all_orders);
    let highest = cyclic.wkc.highest().value;
    let ordered = || {
        let lower = |device: &Device| device.al.is_asked_down();
        let owners: Vec<Owner> = owners(devices, start, len).collect();
        let share = |owner: &Owner| answer.command.increment(owner.reads, owner.writes);
        let are_all = owners.iter().map(share).sum::<u16>() >= highest;
        let is_lower = |owner: &Owner| devices.get(owner.device.index()).is_some_and(lower);
        // Whose FMMUs were set before the input began is an owner, too.
        if owners.iter().any(is_lower) || (!are_all && devices.iter().any(lower)) {
            return Ordered::Yes;
        }
        let since = traffic.recording.first().unwrap_or(answer.at);
        let is_early = !are_all && answer.at.since(since) < JUST_BEGUN;
        let was_before = cyclic_before.unwrap_or(answer.at);
        if !sees_all && (is_early || traffic.may_lack(was_before, answer.at)) {
            Ordered::Unseen
        } else {
            Ordered::No
        }
    };
    if !sees_all && seen.value > highest && is_unordered(devices, start, len) {
        cyclic.wkc.note_low_before(seen);
    }
    let mut news = cyclic.wkc.record(seen, ordered);
    if cyclic.wkc.is_below_plan() {
        let since = cyclic.wkc.now().at.max(cyclic.wkc.first().at);
        let is_up = |device: &Device| device.al.may_be_in_op();
        if answer.at.since(since) >= BELOW_PLAN && devices.iter().all(is_up) {
            news |= cyclic.wkc.note_below_plan();
        }
    }
    // In a ring each copy has the inputs of those alone that it came by.
    if answer.effect.reads
        && answer.is_single
        && let Some(request) = answer.request
    {
        let (sent, back) = (request.data(), answer.reply.data());
        news |= cyclic.motion.record(sent, back, answer.at, answer.frame);
    }
    let is_expected = cyclic.wkc.highest().value > 0;
    let sent_off = answer.sent_at.is_some_and(|at| cyclic.sent.tick(at));
    if news | sent_off | cyclic.returned.tick(answer.at) {
        model.touch();
    }
    is_expected
}
