//! A report made of what is planned, what has happened and how it is now.

use linesman_config::plan::{DevicePlan, InfoData, Plan};
use linesman_maindevice::watch::{CounterTotals, GroupStatus, NetworkStatus, WatchedDevice};
use linesman_maindevice::{FrameStatus, Statistics};
use linesman_proto::address::{DeviceId, Position};
use linesman_proto::ads::AmsNetId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::sii::Identity;
use linesman_proto::state::AlStatusCode;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::report::{
    Count, FrameCounts, MailboxTrouble, Neighbour, OddFrames, OnlineChange, OnlineClock,
    OnlineDevice, OnlineFrame, OnlineGroup, OnlineIdentity, OnlineInfo, OnlineMailbox, OnlinePort,
    OnlineReport, OnlineSyncUnit, SCHEMA, Word,
};
use super::snapshot::Snapshot;

/// A line that is driven; counts of frames begin at `base`, and programs reach it by `net_id`.
pub(super) fn driven(
    plan: &Plan,
    status: &NetworkStatus,
    snapshot: &Snapshot,
    base: &Statistics,
    net_id: Option<AmsNetId>,
) -> OnlineReport {
    let mut report = known(plan, status, snapshot.now);
    report.driven = true;
    report.responding = snapshot.responding.map(|count| count.0);
    report.responding_by_card = snapshot.responding_by_card.map(|both| both.map(|count| count.0));
    for (device, planned) in report.devices.iter_mut().zip(&plan.devices) {
        add_data(device, planned, snapshot);
        device.info = Some(info(plan.info_data(planned, net_id)));
    }
    frames(&mut report, plan, snapshot);
    let counts = &snapshot.statistics;
    let [cyclic, queued] = snapshot.rates.map_or([None; 2], |rates| rates.map(Some));
    report.cyclic = FrameCounts {
        sent: counts.cyclic_sent - base.cyclic_sent,
        lost: counts.cyclic_lost - base.cyclic_lost,
        per_second: cyclic,
    };
    report.queued = queued_frames(counts, base, queued);
    report.odd = odd(counts, base);
    report
}

/// Frames of procedures.
pub(super) fn queued_frames(
    counts: &Statistics,
    base: &Statistics,
    per_second: Option<f64>,
) -> FrameCounts {
    FrameCounts {
        sent: counts.queued_sent() - base.queued_sent(),
        lost: counts.queued_lost - base.queued_lost,
        per_second,
    }
}

/// Frames that came back otherwise than they should.
pub(super) fn odd(counts: &Statistics, base: &Statistics) -> OddFrames {
    OddFrames {
        late: counts.frames_late - base.frames_late,
        duplicate: counts.frames_duplicate - base.frames_duplicate,
        truncated: counts.frames_truncated - base.frames_truncated,
        stray: counts.frames_stray - base.frames_stray,
        foreign: counts.frames_foreign - base.frames_foreign,
    }
}

/// What is known of a line, whoever drives it.
pub(super) fn known(plan: &Plan, status: &NetworkStatus, now: Instant) -> OnlineReport {
    let word = status.network_state();
    let devices = plan.devices.iter().zip(status.devices());
    OnlineReport {
        schema: SCHEMA.to_owned(),
        time_ns: now.as_nanos(),
        state: Word { word: word.0, text: word.to_string() },
        planned: plan.devices.len() as u32,
        present: status.present() as u32,
        responding: status.responding().map(|count| count.0),
        clock: status
            .network_time()
            .map(|(id, ahead_ns)| OnlineClock { reference: id.no(), ahead_ns }),
        devices: devices.map(|(planned, watched)| device(plan, planned, watched)).collect(),
        groups: status.groups().iter().map(|one| group(status, one)).collect(),
        topology: status.topology_order().iter().map(|id| id.no()).collect(),
        ..OnlineReport::default()
    }
}

fn group(status: &NetworkStatus, group: &GroupStatus) -> OnlineGroup {
    let is_there =
        |id: &&DeviceId| status.device(**id).is_some_and(|one| one.is_present() == Some(true));
    OnlineGroup {
        name: group.name().to_owned(),
        devices: group.members().iter().map(|id| id.no()).collect(),
        present: group.members().iter().filter(is_there).count() as u32,
        joined: group.has_joined(),
        place: group.place().map(|(id, port)| format!("{}.{port}", id.no())),
    }
}

fn device(plan: &Plan, planned: &DevicePlan, watched: &WatchedDevice) -> OnlineDevice {
    let word = watched.state();
    let status = watched.al_status();
    let al_error = status.is_some_and(|status| status.error());
    let totals = watched.counters();
    let history = watched.history().map(|change| OnlineChange {
        at_ns: change.at.as_nanos(),
        from: change.from.to_string(),
        to: change.to.to_string(),
        al_code: change.code.0,
        al_code_text: meaning(change.code),
    });
    OnlineDevice {
        no: planned.id.no(),
        name: planned.name.clone(),
        r#type: planned.type_name.clone(),
        station: planned.station.0,
        auto_increment: auto_increment(planned.id.index()),
        present: watched.is_present(),
        state: Word { word: word.0, text: word.to_string() },
        al_state: status.map(|status| status.state().to_string()),
        al_error,
        al_code: watched.code().0,
        al_code_text: meaning(watched.code()),
        planned: identity(&planned.identity),
        found: watched.found().and_then(identity),
        clock_difference_ns: watched.clock_difference().map(Span::as_nanos),
        clock_apart: watched.is_clock_apart(),
        dl_status: watched.links().map(|status| status.0),
        ports: Port::ALL.into_iter().map(|one| port(plan, planned.id, watched, one)).collect(),
        processing_unit: count(totals, ErrorCounter::ProcessingUnit),
        pdi: count(totals, ErrorCounter::Pdi),
        errors: totals.sum(),
        errors_lower_bound: totals.is_lower_bound(),
        abnormal_changes: watched.abnormal_changes(),
        presence_changes: watched.presence_changes(),
        history: history.collect(),
        net_id: planned.net_id().map(|net_id| net_id.to_string()),
        ..OnlineDevice::default()
    }
}

fn meaning(code: AlStatusCode) -> Option<String> {
    (code != AlStatusCode::NO_ERROR).then(|| code.explain().name.to_owned())
}

fn identity(of: &Identity) -> Option<OnlineIdentity> {
    (*of != Identity::default()).then_some(OnlineIdentity {
        vendor_id: of.vendor_id,
        product_code: of.product_code,
        revision: of.revision,
        serial: of.serial_number,
    })
}

fn auto_increment(place: usize) -> u16 {
    Position(place as u16).auto_increment()
}

fn port(plan: &Plan, id: DeviceId, watched: &WatchedDevice, port: Port) -> OnlinePort {
    let seen = watched.links().map(|status| status.port_state(port));
    let totals = watched.counters();
    OnlinePort {
        port: port.to_string(),
        link: seen.map(|seen| seen.link),
        communication: seen.map(|seen| seen.communication),
        to: neighbour(plan, id, port),
        invalid_frames: count(totals, ErrorCounter::InvalidFrame(port)),
        physical_layer: count(totals, ErrorCounter::PhysicalLayer(port)),
        forwarded: count(totals, ErrorCounter::Forwarded(port)),
        lost_links: count(totals, ErrorCounter::LostLink(port)),
    }
}

fn neighbour(plan: &Plan, id: DeviceId, port: Port) -> Option<Neighbour> {
    if id.index() >= plan.tree.len() || !plan.tree.is_open(id.index(), port) {
        return None;
    }
    let End::Controller(node, at) = plan.tree.opposite(End::Controller(id.index(), port))? else {
        return None;
    };
    let device = plan.devices.get(node)?;
    Some(Neighbour {
        no: device.id.no(),
        station: device.station.0,
        auto_increment: auto_increment(node),
        port: at.to_string(),
    })
}

fn count(totals: &CounterTotals, counter: ErrorCounter) -> Option<Count> {
    let register = totals.registers()?.value(counter)?;
    Some(Count { register, total: totals.count(counter)? })
}

/// What the cycle and the mailbox say of a SubDevice.
fn add_data(device: &mut OnlineDevice, planned: &DevicePlan, snapshot: &Snapshot) {
    let wanted = snapshot.wanted.get(planned.id.index()).copied();
    device.target = Some(wanted.unwrap_or(planned.target).to_string());
    let has_data = !planned.outputs.is_empty() || !planned.inputs.is_empty();
    if let Some(quality) = snapshot.qualities.get(planned.id.index()).filter(|_| has_data) {
        device.wc_state = Some(!quality.valid);
        device.age_ns = quality.age(snapshot.now).map(Span::as_nanos);
    }
    let Some(mailbox) = planned.mailbox else { return };
    let trouble = snapshot.mailboxes.iter().find(|(id, ..)| *id == planned.id);
    let standing = trouble.into_iter().flat_map(|(_, _, standing)| standing);
    device.mailbox = Some(OnlineMailbox {
        out_size: mailbox.areas.receive.size,
        in_size: mailbox.areas.send.size,
        mapped: planned.mailbox_state.is_some(),
        errors: trouble.map_or(0, |(_, errors, _)| *errors),
        standing: standing
            .map(|error| MailboxTrouble {
                protocol: error.failure.operation.protocol().to_string(),
                at_ns: error.at.as_nanos(),
                text: error.failure.to_string(),
            })
            .collect(),
    });
}

fn info(of: InfoData) -> OnlineInfo {
    OnlineInfo {
        ads_address: of.ads_address.map(|address| address.to_string()),
        aoe_net_id: of.aoe_net_id.map(|net_id| net_id.to_string()),
        channels: of.channels,
        sync0_shift_ns: of.sync0_shift_ns,
        output_shift_ns: of.output_shift.map(Span::as_nanos),
        input_shift_ns: of.input_shift.map(Span::as_nanos),
        object: of.object,
    }
}

fn frames(report: &mut OnlineReport, plan: &Plan, snapshot: &Snapshot) {
    let mut statuses = snapshot.frames.iter();
    for task in &plan.tasks {
        let mut bad_units = vec![false; task.sync_units.len()];
        for (frame, planned) in task.frames.iter().enumerate() {
            let status = statuses.next().copied().unwrap_or_default();
            let FrameStatus { not_sent, wrong_counter, input_toggle } = status;
            report.frames.push(OnlineFrame {
                task: task.name.clone(),
                frame: frame as u32,
                state: not_sent,
                wc_state: wrong_counter,
                input_toggle,
            });
            for (at, datagram) in planned.datagrams.iter().enumerate() {
                let bad = wrong_counter & (FrameStatus::bit(at) | FrameStatus::WHOLE) != 0;
                let unit = datagram.sync_unit.and_then(|unit| bad_units.get_mut(unit));
                unit.into_iter().for_each(|unit| *unit |= bad);
            }
        }
        for (unit, wc_state) in task.sync_units.iter().zip(bad_units) {
            report.sync_units.push(OnlineSyncUnit {
                task: task.name.clone(),
                name: unit.name.clone(),
                wc_state,
                devices: unit.devices.iter().map(|id| id.no()).collect(),
            });
        }
    }
}
