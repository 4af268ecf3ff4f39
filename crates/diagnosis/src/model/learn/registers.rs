//! Registers that were read: states, ports, counters, receive times, FMMUs.

use linesman_proto::address::{DeviceId, RegisterAddress, StationAlias};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{
    AlControl, AlStatus, ClearGroup, ControllerType, DlControl, DlStatus, ErrorCounters,
    FmmuConfig, PortState, SmStatus, SystemTimeDifference, WatchdogDivider, WatchdogTime,
};
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{DcTime32, Instant};

use super::{Answer, part, word_at};
use crate::model::set_up::SYNC_MANAGERS;
use crate::model::{Chip, Device, LoopWrite, NetworkModel, Seen, UpTime};

const CHIP_TYPE: u16 = 0x0000;
const CHIP_REVISION: u16 = 0x0001;
const ALIAS: u16 = 0x0012;
const DL_CONTROL: u16 = 0x0100;
const DL_STATUS: u16 = 0x0110;
const AL_CONTROL: u16 = 0x0120;
const AL_STATUS: u16 = 0x0130;
const AL_STATUS_CODE: u16 = 0x0134;
const COUNTERS: std::ops::Range<u16> = 0x0300..0x0314;
const FMMUS: std::ops::Range<u16> = 0x0600..0x0700;
const RECEIVE_TIMES: u16 = 0x0900;
const CLOCK_DIFFERENCE: u16 = 0x092C;
/// System time offset, delay, and what steers the clock: whoever writes there sets it.
const CLOCK_SETTING: std::ops::Range<u16> = 0x0920..0x0936;
/// Activation of cyclic operation and SYNC signals; bit 0 switches them on, bits 1 and 2 choose them.
const SYNC_ACTIVATION: u16 = 0x0981;
/// Status of SyncManager 0, which holds requests to the mailbox, and of SyncManager 1, which holds its answers.
const MAILBOX_OUT_STATUS: u16 = 0x0805;
pub(super) const MAILBOX_IN_STATUS: u16 = 0x080D;
const WATCHDOG_DIVIDER: u16 = 0x0400;
const WATCHDOG_TIME: u16 = 0x0420;

/// One controller's registers were read.
pub(super) fn read(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
    let (data, start) = (answer.reply.data(), answer.ado);
    let (at, frame) = (answer.at, Some(answer.frame));
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    let mut news = false;
    device.set_up.read(start, data, Seen::new((), at, frame));
    if start.0 <= AL_STATUS_CODE {
        if let Some([kind]) = part(data, start, CHIP_TYPE, 1) {
            let revision = part(data, start, CHIP_REVISION, 1).map_or(0, |byte| byte[0]);
            let chip = Chip { kind: ControllerType(*kind), revision };
            // A shorter read does not take back what a longer one has told.
            let is_known = device.chip.is_some_and(|known| known.value.revision != 0);
            if revision != 0 || !is_known {
                device.chip = Some(Seen::new(chip, at, frame));
            }
        }
        if let Some(alias) = word_at(data, start, ALIAS) {
            device.alias = Some(StationAlias(alias));
        }
        let control = part(data, start, DL_CONTROL, 4).and_then(|bytes| bytes.first_chunk());
        if let Some(control) = control.map(|bytes| DlControl::from_bytes(*bytes)) {
            // What holds for a moment is not how it stands.
            device.dl_control = Some(control).filter(|now| !now.temporary()).or(device.dl_control);
        }
        if let Some(status) = dl_status(device, data, start) {
            news |= device.dl.record(status, at, frame);
        }
        if let Some(status) = al_status(data, start) {
            news |= device.al.record_status(status, at, frame);
        }
        if let Some(code) = word_at(data, start, AL_STATUS_CODE) {
            news |= device.al.record_code(AlStatusCode(code), at, frame);
        }
    } else if touches(start, data, COUNTERS) {
        if let Some(since) = device.counters.errors_since(start, data) {
            model.note_errors(since, at);
        }
        let Some(device) = model.device_mut(id) else { return };
        news |= device.counters.record(start, data, at, frame);
    } else if start.0 <= WATCHDOG_TIME {
        news |= watchdog(device, data, start, Seen::new((), at, frame));
    } else if start.0 <= MAILBOX_IN_STATUS {
        if let Some(status) = part(data, start, MAILBOX_OUT_STATUS, 1) {
            let is_full = SmStatus(status[0]).mailbox_full();
            news |= device.mailbox.read_status(is_full, at, answer.frame);
        }
        if let Some(status) = part(data, start, MAILBOX_IN_STATUS, 1) {
            device.mailbox.polled = Some(at);
            device.mailbox.looked(SmStatus(status[0]).mailbox_full(), at);
        }
    } else if start.0 == RECEIVE_TIMES
        && let Some(times) = part(data, start, RECEIVE_TIMES, 16)
    {
        news = learn_receive_times(model, id, times, at);
    } else if start.0 == UpTime::REGISTERS.0
        && let Some(up_time) = UpTime::from_bytes(data, at)
    {
        device.up_time = Some(up_time);
        news = true;
    } else if start.0 > RECEIVE_TIMES
        && let Some(bytes) = part(data, start, CLOCK_DIFFERENCE, 4).and_then(|it| it.first_chunk())
    {
        let difference = SystemTimeDifference::from(*bytes);
        news |= device.clock.record(Seen::new(difference.ahead_ns(), at, frame));
    }
    if news {
        model.touch();
    }
}

/// One controller's registers were written.
pub(super) fn written(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    let is_news = write(device, answer);
    let seen = Seen::new((), answer.sent_at.unwrap_or(answer.at), Some(answer.frame));
    if let Some(write) = loop_write(device, (answer.ado, answer.written()), seen) {
        model.note_loops(write);
    }
    if is_dl_control(answer.ado, answer.written()) {
        model.note_order(seen.at);
    }
    if touches(answer.ado, answer.written(), CLOCK_SETTING) {
        for reference in model.references.iter_mut().filter(|one| one.device == id) {
            reference.set(answer.at);
        }
    }
    if touches(answer.ado, answer.written(), FMMUS) {
        write_fmmus(model, id, answer);
    }
    if is_news {
        model.touch();
    }
}

/// Counters of these controllers were to be cleared, and the frame did not come back, or came back damaged: it may
/// have been executed all the same.
pub(super) fn may_be_cleared(
    model: &mut NetworkModel,
    ids: &[DeviceId],
    (start, data): (RegisterAddress, &[u8]),
    sent: Instant,
) {
    if !touches(start, data, COUNTERS) {
        return;
    }
    for id in ids {
        let Some(device) = model.device_mut(*id) else { continue };
        for group in cleared_by(start, data) {
            device.counters.note_lost_clear(group, sent);
        }
    }
    model.touch();
}

/// The groups of counters that a write clears.
fn cleared_by(start: RegisterAddress, data: &[u8]) -> impl Iterator<Item = ClearGroup> + use<'_> {
    ClearGroup::ALL.into_iter().filter(move |group| {
        (0..data.len() as u16).any(|offset| {
            let address = RegisterAddress(start.0.saturating_add(offset));
            ClearGroup::written_by(address) == Some(*group)
        })
    })
}

/// Whether a write is about DL control.
pub(super) fn is_dl_control(start: RegisterAddress, data: &[u8]) -> bool {
    touches(start, data, DL_CONTROL..DL_CONTROL + 4)
}

/// Whether DL control is written for temporary use: then by this write.
pub(super) fn loop_write(
    device: &Device,
    (start, data): (RegisterAddress, &[u8]),
    seen: Seen<()>,
) -> Option<LoopWrite> {
    let bytes = part(data, start, DL_CONTROL, 2)?.first_chunk()?;
    LoopWrite::of(device, *bytes, seen)
}

/// A request for a state was not taken by a controller that has answered before. Says whether it was one.
pub(super) fn untaken(device: &mut Device, answer: &Answer<'_>) -> bool {
    let control = part(answer.written(), answer.ado, AL_CONTROL, 1);
    let Some(control) = control.filter(|_| answer.effect.writes && device.answered.is_some())
    else {
        return false;
    };
    let requested = AlControl(u16::from(control[0])).requested();
    device.al.record_untaken(Seen::new(requested, answer.at, Some(answer.frame)));
    true
}

/// All controllers' registers were read; their data are ORed together.
pub(super) fn broadcast_read(model: &mut NetworkModel, answer: &Answer<'_>) {
    let Some(status) = al_status(answer.reply.data(), answer.ado) else { return };
    let states = AlState::from_or(status.0 as u8);
    model.traffic.broadcasts.record_state(states.highest());
    // In a ring that is open each copy holds the states of its own half.
    let everybody = usize::from(answer.own) == model.devices.len();
    let (Some(state), true, false) = (states.all_in(), everybody, states.any_error()) else {
        return;
    };
    for device in &mut model.devices {
        let before = device.al.latest_reading;
        device.al.latest_reading = Some(before.map_or(answer.at, |before| before.max(answer.at)));
    }
    if model.calm_state == Some((state, model.revision())) {
        return;
    }
    let (mut news, mut are_calm) = (false, true);
    for device in &mut model.devices {
        // Other bits than state and error are not known from here.
        if !device.al.is_in(state) || device.al.has_error() {
            let status = AlStatus::new(state);
            news |= device.al.record_status(status, answer.at, Some(answer.frame));
        }
        are_calm &= device.al.is_calm_in(state);
    }
    if news {
        model.touch();
    }
    model.calm_state = are_calm.then_some((state, model.revision()));
}

/// All controllers' registers were written.
pub(super) fn broadcast_write(model: &mut NetworkModel, answer: &Answer<'_>) {
    let data = answer.written();
    let mut news = false;
    if touches(answer.ado, data, RECEIVE_TIMES..RECEIVE_TIMES + 1) {
        model.latched_in_ring = !answer.is_single;
    }
    if touches(answer.ado, data, CLOCK_SETTING) {
        model.references.iter_mut().for_each(|reference| reference.set(answer.at));
    }
    for device in &mut model.devices {
        news |= write(device, answer);
        if touches(answer.ado, data, FMMUS) {
            device.fmmus.clear();
        }
        if touches(answer.ado, data, SYNC_MANAGERS) {
            device.set_up.sync_managers.clear();
        }
    }
    if touches(answer.ado, data, FMMUS) {
        model.cyclic.iter_mut().for_each(|cyclic| cyclic.lay_out_anew(answer.at));
    }
    if news {
        model.touch();
    }
}

fn write(device: &mut Device, answer: &Answer<'_>) -> bool {
    let (data, start) = (answer.written(), answer.ado);
    device.set_up.written(start, data, Seen::new((), answer.at, Some(answer.frame)));
    if let Some(control) = part(data, start, AL_CONTROL, 1) {
        let control = AlControl(u16::from(control[0]));
        device
            .al
            .record_request(control, Seen::new(control.requested(), answer.at, Some(answer.frame)));
        return true;
    }
    if let Some(activation) = part(data, start, SYNC_ACTIVATION, 1) {
        let is_on = activation[0] & 1 != 0 && activation[0] & 0b110 != 0;
        device.sync_on = Some(Seen::new(is_on, answer.at, Some(answer.frame)));
        return true;
    }
    if touches(start, data, CLOCK_SETTING) {
        device.clock.set(answer.at);
    }
    let is_set = watchdog(device, data, start, Seen::new((), answer.at, Some(answer.frame)));
    if touches(start, data, COUNTERS) {
        for group in cleared_by(start, data) {
            device.counters.note_clear(group, answer.at, Some(answer.frame));
        }
    }
    is_set
}

/// The watchdog's registers were read or written. Says whether it is set otherwise than before.
fn watchdog(device: &mut Device, data: &[u8], start: RegisterAddress, seen: Seen<()>) -> bool {
    let divider = word_at(data, start, WATCHDOG_DIVIDER).map(WatchdogDivider);
    let time = word_at(data, start, WATCHDOG_TIME).map(WatchdogTime);
    (divider.is_some() || time.is_some()) && device.watchdog.record(divider, time, seen)
}

fn write_fmmus(model: &mut NetworkModel, id: DeviceId, answer: &Answer<'_>) {
    let (data, start) = (answer.written(), answer.ado);
    let Some(device) = model.devices.get_mut(id.index()) else { return };
    for index in 0..16_u16 {
        let address = FMMUS.start + index * FmmuConfig::LEN as u16;
        let Some(bytes) = part(data, start, address, FmmuConfig::LEN) else { continue };
        let Some(bytes) = bytes.first_chunk() else { continue };
        let fmmu = FmmuConfig::from_bytes(*bytes);
        let before = device.fmmus.insert(index as u8, fmmu);
        // An FMMU of which nothing was known is no other layout: a SubDevice that comes back is set up as before.
        let before = before.filter(|before| before.active && *before != fmmu);
        for cyclic in &mut model.cyclic {
            let touches = |fmmu: &FmmuConfig| fmmu.overlap(cyclic.start, cyclic.len).is_some();
            match before {
                Some(before) if touches(&fmmu) || touches(&before) => {
                    cyclic.lay_out_anew(answer.at)
                }
                None if touches(&fmmu) => cyclic.set_up_again(),
                Some(_) | None => {}
            }
        }
    }
    model.touch();
}

/// AL status as far as it was read: many poll the first byte alone, which has state and error.
fn al_status(data: &[u8], start: RegisterAddress) -> Option<AlStatus> {
    let low = part(data, start, AL_STATUS, 1)?;
    Some(AlStatus(word_at(data, start, AL_STATUS).unwrap_or(u16::from(low[0]))))
}

/// DL status as far as it was read. Some poll the second byte alone, which says all of loops and
/// communication; a port is then taken to have a carrier where it communicates, and the rest of the
/// first byte to be as it was. Whether a processor feeds its watchdog is not in it: as long as that was never
/// read nobody is taken to, so that the first reading is none that fell.
fn dl_status(device: &Device, data: &[u8], start: RegisterAddress) -> Option<DlStatus> {
    if let Some(word) = word_at(data, start, DL_STATUS) {
        return Some(DlStatus(word));
    }
    let high = part(data, start, DL_STATUS + 1, 1)?[0];
    let known = device.dl.last.map(|last| last.value);
    if let Some(known) = known.filter(|known| known.to_bytes()[1] == high) {
        return Some(known);
    }
    let low = known.unwrap_or(DlStatus::default().with_pdi(true, false)).to_bytes()[0];
    let read = DlStatus::from_bytes([low, high]);
    Some(Port::ALL.into_iter().fold(read, |status, port| {
        let state = status.port_state(port);
        status.with_port(port, PortState { link: state.communication, ..state })
    }))
}

/// Takes the receive times of a controller. Says whether they tell anything.
///
/// In a closed ring the frame does not come back to the ports that lead on: what they show is of the copy that went the other
/// way, or of an earlier frame. In an open one those of the far half met it the other way round. A port that is closed, by order as
/// the end of a ring is while delays are measured, or since nobody is there any more, keeps the time that it had: those of a
/// controller whose ports were all open are more than a later set without one of them.
fn learn_receive_times(
    model: &mut NetworkModel,
    id: DeviceId,
    bytes: &[u8],
    read_at: Instant,
) -> bool {
    if model.latched_in_ring {
        return false;
    }
    let closed = model.closed_by_order(id, read_at);
    let Some(device) = model.devices.get_mut(id.index()) else { return false };
    let dl = &device.dl;
    let has_shut = |port| dl.was_active(port) == Some(true) && dl.is_active(port) == Some(false);
    let is_shut = |port| closed == Some(port) || has_shut(port);
    if device.received.is_some() && Port::ALL.into_iter().any(is_shut) {
        return false;
    }
    device.received = Some(PortMap::from_fn(|port| {
        let at = 4 * port.index();
        let bytes = bytes.get(at..at + 4).and_then(|bytes| bytes.first_chunk());
        let time = DcTime32(bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes)));
        (!is_shut(port)).then_some(time)
    }));
    true
}

fn touches(start: RegisterAddress, data: &[u8], range: std::ops::Range<u16>) -> bool {
    let end = usize::from(start.0) + data.len();
    start.0 < range.end && end > usize::from(range.start)
}

const _: () = assert!(COUNTERS.end - COUNTERS.start == ErrorCounters::LEN as u16);

#[cfg(test)]
mod tests {
    use linesman_proto::time::Span;

    use super::*;

    /// Receive times of the ports, with text left over where there is no port.
    fn times(a: u32, c: u32) -> Vec<u8> {
        let left_over = u32::from_le_bytes(*b"left");
        [a, left_over, c, left_over].into_iter().flat_map(u32::to_le_bytes).collect()
    }

    #[test]
    fn receive_times_tell_nothing_in_a_ring_and_of_a_port_that_is_closed_by_order() {
        let (id, at) = (DeviceId(0), Instant::ZERO + Span::ms(300));
        let mut model = NetworkModel { devices: vec![Device::new(id)], ..NetworkModel::default() };
        model.latched_in_ring = true;
        assert!(!learn_receive_times(&mut model, id, &times(5_000, 10), at));
        assert_eq!(model.devices[0].received, None);

        // The end of the ring is closed for a moment: its time is an old one.
        model.latched_in_ring = false;
        let seen = Seen::new((), at, None);
        model.note_loops(LoopWrite { device: id, closed: Some(Port::C), seen });
        assert!(learn_receive_times(&mut model, id, &times(9_000, 10), at + Span::ms(1)));
        let received = model.devices[0].received.expect("it was read");
        assert_eq!((received[Port::A], received[Port::C]), (Some(DcTime32(9_000)), None));

        // A port that was closed for temporary use opens by itself.
        assert!(learn_receive_times(&mut model, id, &times(9_000, 9_700), at + Span::s(2)));
        let received = model.devices[0].received.expect("it was read");
        assert_eq!(received[Port::C], Some(DcTime32(9_700)));
    }

    #[test]
    fn receive_times_of_when_all_ports_were_open_stay_when_one_has_lost_its_link() {
        let (id, at) = (DeviceId(0), Instant::ZERO + Span::ms(300));
        let mut device = Device::new(id);
        let open = |ports: &[Port]| {
            let state = PortState { link: true, communication: true, ..PortState::default() };
            ports.iter().fold(DlStatus::default(), |status, port| status.with_port(*port, state))
        };
        device.dl.record(open(&[Port::A, Port::C]), at, None);
        let mut model = NetworkModel { devices: vec![device], ..NetworkModel::default() };
        assert!(learn_receive_times(&mut model, id, &times(5_000, 5_700), at));
        // Nobody is behind C any more, and the frame is latched anew: C keeps the time of the one before.
        model.devices[0].dl.record(open(&[Port::A]), at + Span::s(1), None);
        assert!(!learn_receive_times(&mut model, id, &times(9_000_000, 5_700), at + Span::s(1)));
        let received = model.devices[0].received.expect("it was read");
        assert_eq!(
            (received[Port::A], received[Port::C]),
            (Some(DcTime32(5_000)), Some(DcTime32(5_700)))
        );
        // So it is when they are the first that are read.
        model.devices[0].received = None;
        assert!(learn_receive_times(&mut model, id, &times(9_000_000, 5_700), at + Span::s(1)));
        let received = model.devices[0].received.expect("it was read");
        assert_eq!((received[Port::A], received[Port::C]), (Some(DcTime32(9_000_000)), None));
    }

    #[test]
    fn what_is_lost_while_a_port_is_closed_by_order_is_so_when_the_port_is_open_again() {
        let ms = |ms: u64| Instant::ZERO + Span::ms(ms);
        let mut model = NetworkModel::default();
        model.note_order(ms(300));
        model.note_order(ms(310));
        let by_order: Vec<bool> =
            [297, 299, 303, 400, 511].map(|at| model.is_lost_by_order(ms(at))).to_vec();
        assert_eq!(by_order, [false, true, true, true, false]);
        // Another order much later has nothing to do with the first.
        model.note_order(ms(900));
        assert!(!model.is_lost_by_order(ms(303)));
    }
}
