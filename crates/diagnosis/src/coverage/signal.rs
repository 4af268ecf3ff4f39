//! Signal quality and link status as evidence: registers of both ends of each link.

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_proto::topology::route::Direction;
use linesman_proto::topology::{End, Hop};

use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};
use crate::finding::{LinkDirection, Place};
use crate::locate::LocateInput;
use crate::main_device::{MainDeviceKind, next_step};
use crate::model::{CounterTrack, Device, NetworkModel};

/// So many frames that came back, with none lost, show that a link whose counter is full spoils no frames.
const MANY_FRAMES: u64 = 2_000;

/// What stands so soon after the first frame stood before it.
const FROM_THE_FIRST: Span = Span::ms(100);

/// How well one port of a controller told of errors.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PortEvidence {
    /// Every error would have been seen.
    All,
    /// Errors of which nobody knows when they were.
    Once,
    /// None: its counter is at its end.
    Full,
    /// Nothing: it was not read.
    Unread,
}

/// Whether every port that checks frames told of errors.
pub(super) fn all_tell(model: &NetworkModel) -> bool {
    let Some(input) = LocateInput::of(model, true) else { return false };
    let mut ends = input.routes().iter().flat_map(|route| route.hops()).map(|hop| hop.to);
    ends.all(|end| match end {
        End::Controller(node, port) => model
            .devices
            .get(node)
            .is_some_and(|device| port_tells(device, port) == PortEvidence::All),
        End::MainDevice(_) => true,
    })
}

/// Error counters, link by link and direction by direction.
pub(super) fn quality(basis: &Basis<'_>) -> Assessment {
    let model = basis.model;
    let traffic = &model.traffic;
    // Frames that are spoiled are lost; enough that came back make up for counters that nobody read.
    let frames_tell = traffic.losses.frames().sum == 0 && traffic.losses.damaged().sum == 0;
    let is_shown_by_frames = basis.has_frames && frames_tell;
    let Some(input) = LocateInput::of(model, true) else {
        return quality_without_wiring(basis, is_shown_by_frames);
    };
    let mut all = Assessment::judged(Subject::SignalQuality);
    let mut told: Vec<(PortEvidence, Place)> = Vec::new();
    let mut last_hops = Vec::new();
    for hop in input.routes().iter().flat_map(|route| route.hops()) {
        match hop.to {
            End::Controller(node, port) => {
                let device = model.devices.get(node);
                told.push((
                    device.map_or(PortEvidence::Unread, |one| port_tells(one, port)),
                    place(&input, hop),
                ));
            }
            End::MainDevice(_) => last_hops.push(place(&input, hop)),
        }
    }
    let at = |wanted: PortEvidence| -> Vec<Place> {
        let found = told.iter().filter(|(one, _)| *one == wanted);
        found.map(|(_, place)| *place).collect()
    };
    let (full, once, unread) =
        (at(PortEvidence::Full), at(PortEvidence::Once), at(PortEvidence::Unread));
    if unread.len() == told.len() {
        let gap = Gap::new(Reason::CountersNotRead, "nobody read the error counters")
            .essential_if(!is_shown_by_frames)
            .step(basis.read_counters());
        all.lacks(Extent::NotJudged, gap);
    } else if !unread.is_empty() {
        let text = format!("the error counters of {} were not read", path_delays(unread.len()));
        let gap = Gap::new(Reason::CountersNotRead, text)
            .essential_if(!is_shown_by_frames)
            .at(unread)
            .step(basis.read_counters());
        all.lacks(Extent::InPart, gap);
    }
    if !full.is_empty() {
        let text = format!(
            "the error counter of {} stands at its end, 255, and counts no more",
            path_delays(full.len())
        );
        let gap = Gap::new(Reason::CounterFull, text)
            .essential_if(!frames_tell || traffic.returns.count() < MANY_FRAMES)
            .at(full)
            .step("clear them and watch: `linesman counters WHERE --clear --for 60`");
        all.lacks(Extent::InPart, gap);
    }
    if !once.is_empty() {
        let text = format!(
            "the error counters of {} were read once: what they hold may be old",
            path_delays(once.len())
        );
        let gap = Gap::new(Reason::CountersReadOnce, text)
            .essential_if(!is_shown_by_frames)
            .at(once)
            .step(basis.read_counters());
        all.lacks(Extent::InPart, gap);
    }
    if !model.host.is_watched && !last_hops.is_empty() {
        let text = "errors on the last way, from the first SubDevice to the card, are counted by the card alone; its \
                    counters are not known";
        let gap = Gap::new(Reason::HostCountersMissing, text).at(last_hops).step(host_step(basis));
        all.lacks(Extent::InPart, gap);
    }
    all
}

/// Error counters of a line whose links cannot be told apart.
fn quality_without_wiring(basis: &Basis<'_>, is_shown_by_frames: bool) -> Assessment {
    let devices = &basis.model.devices;
    let is_unread = devices.iter().all(|device| !device.counters.is_known());
    let (reason, text) = if is_unread {
        (Reason::CountersNotRead, "nobody read the error counters")
    } else {
        (Reason::WiringUnknown, "the wiring is not known, so no link can be told from another")
    };
    let has_risen = devices.iter().any(has_risen);
    let text = if has_risen { format!("{text}, and some counted errors") } else { text.to_owned() };
    let gap = Gap::new(reason, text)
        .essential_if(!is_shown_by_frames || has_risen)
        .step(basis.read_counters());
    let mut all = Assessment::judged(Subject::SignalQuality);
    all.lacks(Extent::NotJudged, gap);
    all
}

/// DL status and lost-link counters, link by link.
pub(super) fn link_status(basis: &Basis<'_>) -> Assessment {
    let model = basis.model;
    let mut all = Assessment::judged(Subject::LinkStatus);
    came_up(basis, &mut all);
    unread_change(basis, &mut all);
    let unread: Vec<&Device> = model.devices.iter().filter(|one| !tells_links(one)).collect();
    if unread.is_empty() && !model.devices.is_empty() {
        return all;
    }
    let is_none_read = unread.len() == model.devices.len();
    let (extent, text) = if is_none_read {
        (
            Extent::NotJudged,
            "nobody read link status (0x0110) or the counters of lost links".to_owned(),
        )
    } else {
        let text = format!("the link status of {} SubDevices was not read", unread.len());
        (Extent::InPart, text)
    };
    let places = unread.iter().map(|one| Place::device(model.network, one.id));
    let places = if is_none_read { Vec::new() } else { places.collect() };
    let kind = model.main_device_kind();
    let step = match basis.input {
        InputKind::Typed if kind == MainDeviceKind::Unknown => {
            "give `ports.A = { link = …, lost_link = … }` of each SubDevice"
        }
        InputKind::Driven | InputKind::ReadOut => "read it: `linesman counters WHERE --for 60`",
        InputKind::Listened | InputKind::Recorded | InputKind::Typed => {
            next_step::link_status(kind)
        }
    };
    all.lacks(extent, Gap::new(Reason::LinkStatusNotRead, text).at(places).step(step));
    all
}

/// Links that were away when the look at them began, and are there now.
fn came_up(basis: &Basis<'_>, all: &mut Assessment) {
    let model = basis.model;
    for device in &model.devices {
        let (Some(first), Some(last)) = (device.dl.first, device.dl.last) else { continue };
        for port in Port::ALL {
            if first.value.port_state(port).link || !last.value.port_state(port).link {
                continue;
            }
            let text = format!(
                "port {port} of {} had no link at first and has one now: why was not seen",
                model.label(device.id)
            );
            let gap = Gap::new(Reason::LinkCameUp, text)
                .essential()
                .at(vec![Place::device(model.network, device.id)])
                .step(basis.look_longer());
            all.lacks(Extent::InPart, gap);
        }
    }
}

/// A change of DL status that frames tell of and that nobody has read.
fn unread_change(basis: &Basis<'_>, all: &mut Assessment) {
    let Some(since) = basis.model.events.dl_status.since else { return };
    let when = match basis.model.traffic.recording.first() {
        Some(first) if since.at.since(first) < FROM_THE_FIRST => {
            "before the first frame that was seen".to_owned()
        }
        Some(_) | None => format!("at {}", since.at),
    };
    let text = format!(
        "DL status of a SubDevice changed {when}, and nobody has read since whose (event field of the frames): a link came \
         or went"
    );
    let step = match basis.input {
        InputKind::Typed | InputKind::Driven | InputKind::ReadOut => {
            "read DL status (0x0110) of all SubDevices"
        }
        InputKind::Listened | InputKind::Recorded => {
            next_step::link_status(basis.model.main_device_kind())
        }
    };
    all.lacks(Extent::InPart, Gap::new(Reason::LinkStatusNotRead, text).essential().step(step));
}

/// The next step that gets the counters of the card.
pub(super) fn host_step(basis: &Basis<'_>) -> &'static str {
    match basis.input {
        InputKind::Driven | InputKind::ReadOut => {
            "use a card whose driver counts errors: `linesman interfaces`"
        }
        InputKind::Listened | InputKind::Recorded => {
            "read them on the MainDevice's computer: `ethtool -S CARD`"
        }
        InputKind::Typed => "give `[maindevice]` with `crc = …`",
    }
}

fn port_tells(device: &Device, port: Port) -> PortEvidence {
    let frames = device.counters.track(ErrorCounter::InvalidFrame(port));
    let symbols = device.counters.track(ErrorCounter::PhysicalLayer(port));
    let Some(frames) = frames else { return PortEvidence::Unread };
    let tracks = || [Some(frames), symbols].into_iter().flatten();
    if tracks().any(|track| track.is_at_end()) {
        return PortEvidence::Full;
    }
    if tracks().any(is_read_once) { PortEvidence::Once } else { PortEvidence::All }
}

/// Whether one of its counters of frames or symbols was seen to rise.
fn has_risen(device: &Device) -> bool {
    Port::ALL.into_iter().any(|port| {
        [ErrorCounter::InvalidFrame(port), ErrorCounter::PhysicalLayer(port)]
            .into_iter()
            .filter_map(|counter| device.counters.track(counter))
            .any(|track| !track.rises.is_empty())
    })
}

/// Whether nobody knows when a counter counted what it holds, or whether it went on.
fn is_read_once(track: &CounterTrack) -> bool {
    if track.may_be_old {
        return track.last.value > 0;
    }
    track.first.at == track.last.at
}

fn tells_links(device: &Device) -> bool {
    let is_watched = |port: Port| {
        let track = device.counters.track(ErrorCounter::LostLink(port));
        track.is_some_and(|track| track.first.at < track.last.at)
    };
    // What a person did not give was taken from the plan.
    let is_read = device.dl.latest_reading.is_some() && !device.dl.is_assumed;
    is_read || Port::ALL.into_iter().any(is_watched)
}

fn place(input: &LocateInput<'_>, hop: &Hop) -> Place {
    let model: &NetworkModel = input.model();
    let direction = match hop.direction {
        Direction::Downstream => LinkDirection::AToB,
        Direction::Upstream => LinkDirection::BToA,
    };
    let link = input.tree().links()[hop.link].map(|node| DeviceId(node as u32));
    Place::link(model.network, link, Some(direction))
}

/// `1 direction of a link`, `3 directions of links`.
fn path_delays(count: usize) -> String {
    match count {
        1 => "1 direction of a link".to_owned(),
        count => format!("{count} directions of links"),
    }
}
