//! Finding the SubDevices of the plan on the line, and giving them their station addresses.
//!
//! Those that already answer at a planned address are landmarks. Between two landmarks the line
//! keeps its order: as many unknown ones as planned ones are the planned ones, one by one, and are
//! compared; more or fewer are aligned by identity.

use std::collections::{BTreeMap, BTreeSet};

use linesman_config::identity::mismatch;
use linesman_config::plan::{AddressingChoice, DevicePlan};
use linesman_proto::address::{DeviceId, Position, StationAddress};
use linesman_proto::register::{AL_STATUS, AlStatus, STATION_ADDRESS};
use linesman_proto::sii::Identity;
use linesman_proto::state::AlState;

use super::align::align;
use super::by_alias;
use super::by_wiring;
use super::hot_connect;
use super::numbers::Numbers;
use super::times::Phase;
use super::{Context, Reachability, find, lose};
use crate::event::Event;
use crate::exchange::Target;
use crate::executor::{Wire, lock};
use crate::procedure::read_only_scan::{self, ReadOnlyScanError};
use crate::procedure::scan::ScanCache;
use crate::procedure::{address, sii};

/// One controller on the line.
#[derive(Clone, Copy)]
pub(super) struct FoundController {
    pub(super) position: Position,
    /// How it is addressed as long as it has no station address.
    pub(super) place: Target,
    /// The station address that it has; 0 for none.
    pub(super) station: StationAddress,
    /// Which of the plan, if its address tells.
    pub(super) known: Option<DeviceId>,
    /// Who it is, where that was asked a moment ago.
    pub(super) identity: Option<Identity>,
    /// It was found by its alias: it is no landmark, since it may be anywhere.
    pub(super) by_alias: bool,
    /// The one of the plan that hangs there, if the ports tell.
    pub(super) wired: Option<DeviceId>,
}

/// Choice among several equal ones for a found one, where fewer are found than are planned.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Equals {
    /// The first of them.
    First,
    /// None, unless one beside it is there: the others may come back yet.
    Beside,
}

/// Looks for all, whatever addresses they have. Who a scan has identified a moment ago is known by the
/// address that it still has.
///
/// # Errors
/// [`ReadOnlyScanError`] when the line is silent.
pub(super) async fn from_scratch(
    context: &Context,
    scan_cache: Option<&ScanCache>,
) -> Result<(), ReadOnlyScanError> {
    locate(context, true, scan_cache).await
}

/// Looks for those that are not there.
///
/// # Errors
/// [`ReadOnlyScanError`] when the line is silent.
pub(super) async fn again(context: &Context) -> Result<(), ReadOnlyScanError> {
    locate(context, false, None).await
}

async fn locate(
    context: &Context,
    from_scratch: bool,
    scan_cache: Option<&ScanCache>,
) -> Result<(), ReadOnlyScanError> {
    let wire = &context.wire;
    let began = wire.now();
    lock(&context.device_table).groups.begin_search();
    let (places, _) = read_only_scan::places(wire, context.network).await?;
    let mut who = vec![None; places.len()];
    if let Some(scan_cache) = scan_cache {
        let now = wire.now();
        let stations = stations(wire, &places).await;
        let uses = uses(&stations);
        let alone = |station: &StationAddress| uses.get(station) == Some(&1);
        let asked = |station: &StationAddress| scan_cache.who(*station, now);
        who = stations.iter().map(|one| asked(one).filter(|_| alone(one))).collect();
    }
    if from_scratch {
        // Addresses of an earlier run must not meet those of the plan.
        let _ = wire.write(Target::All, STATION_ADDRESS.address, &[0; 2]).await;
    }
    by_alias::locate(context).await;
    let named = context.plan.devices.iter().any(|device| by_alias::alias_of(device).is_some());
    let stations = if from_scratch && !named {
        vec![StationAddress(0); places.len()]
    } else {
        stations(wire, &places).await
    };
    context.note(Phase::Count, began);
    let began = wire.now();
    let uses = uses(&stations);
    // Of several with one address the first is meant.
    let devices = context.plan.devices.iter().rev();
    let planned: BTreeMap<StationAddress, DeviceId> = devices
        .filter(|device| device.settings.addressing == AddressingChoice::Auto)
        // Groups may be anywhere, too.
        .filter(|device| context.plan.group_of(device.id).is_none())
        .map(|device| (device.station, device.id))
        .collect();
    let anywhere: BTreeSet<StationAddress> = (context.plan.devices.iter())
        .filter(|device| by_alias::alias_of(device).is_some())
        .map(|device| device.station)
        .collect();
    let known = |station: StationAddress| {
        let unique = uses.get(&station) == Some(&1);
        let planned = planned.get(&station).copied();
        planned.filter(|_| unique && station.0 != 0 && !from_scratch)
    };
    let mut seen: Vec<FoundController> = (stations.iter().zip(places).zip(who).zip(0..))
        .map(|(((station, place), identity), at)| FoundController {
            position: Position(at),
            place,
            station: *station,
            known: known(*station),
            identity,
            by_alias: anywhere.contains(station),
            wired: None,
        })
        .collect();
    if !from_scratch {
        by_wiring::note(context, &mut seen).await;
    }
    let (groups, mut seen) = hot_connect::claim(context, seen).await;
    seen.retain(|one| !one.by_alias);
    let equals = if from_scratch { Equals::First } else { Equals::Beside };
    by_place(context, &mut seen).await;
    match_stretches(context, &seen, equals).await;
    hot_connect::settle(context, groups).await;
    for device in &context.plan.devices {
        if lock(&context.device_table).found(device.id) == Reachability::Unknown {
            lose(context, device.id);
        }
    }
    context.note(Phase::Identify, began);
    Ok(())
}

/// Gives those their addresses that hang where one like them is planned: they are landmarks from then on. Those that are refused there,
/// by their number, are no other one either.
async fn by_place(context: &Context, seen: &mut Vec<FoundController>) {
    identify(context, seen).await;
    let fits = |one: &FoundController| {
        let device = context.plan.device(one.wired?)?;
        let found = one.identity?;
        let is_it = mismatch(&device.identity, &found, device.revision_rule).is_none()
            && by_alias::alias_of(device).is_none();
        is_it.then_some(device.id)
    };
    let (placed, ids): (Vec<FoundController>, Vec<DeviceId>) =
        seen.iter().filter_map(|one| Some((*one, fits(one)?))).unzip();
    stretch(context, &placed, ids, Equals::Beside).await;
    let is_there = |id: &DeviceId| lock(&context.device_table).is_there(*id);
    seen.retain(|one| fits(one).is_none_or(|id| is_there(&id)));
    for one in seen {
        one.known = one.known.or(fits(one));
    }
}

/// Matches controllers and planned SubDevices in each stretch between landmarks: those whose address is known.
async fn match_stretches(context: &Context, seen: &[FoundController], equals: Equals) {
    let (mut first_seen, mut first_planned) = (0, 0);
    for end in 0..=seen.len() {
        let landmark = seen.get(end).map(|seen| seen.known);
        if landmark == Some(None) {
            continue;
        }
        let end_planned = landmark.flatten().map_or(context.plan.devices.len(), DeviceId::index);
        if first_planned <= end_planned {
            let planned = &context.plan.devices[first_planned..end_planned];
            let fixed = planned.iter().filter(|one| context.plan.group_of(one.id).is_none());
            let fixed = fixed.map(|device| device.id).collect();
            stretch(context, &seen[first_seen..end], fixed, equals).await;
            first_planned = end_planned + 1;
        }
        first_seen = end + 1;
    }
}

/// How often each address is there.
fn uses(stations: &[StationAddress]) -> BTreeMap<StationAddress, u32> {
    let mut uses = BTreeMap::new();
    for station in stations {
        *uses.entry(*station).or_default() += 1;
    }
    uses
}

/// The station addresses that controllers have; 0 for one that does not answer.
async fn stations(wire: &Wire, places: &[Target]) -> Vec<StationAddress> {
    let reads: Vec<_> = (places.iter())
        .map(|place| wire.read(*place, STATION_ADDRESS.address, STATION_ADDRESS.len))
        .collect();
    let mut stations = Vec::with_capacity(reads.len());
    for read in reads {
        stations.push(read.await.map_or(StationAddress(0), |reply| StationAddress(reply.word(0))));
    }
    stations
}

/// Asks those who they are of whom nothing is known.
pub(super) async fn identify(context: &Context, seen: &mut [FoundController]) {
    let is_asked = |one: &FoundController| one.known.is_none() && one.identity.is_none();
    let reading: Vec<_> = (seen.iter())
        .map(|one| {
            let (wire, place) = (context.wire.clone(), one.place);
            let read = async move { sii::read_identity(&wire, place).await };
            is_asked(one).then(|| context.wire.spawn(read))
        })
        .collect();
    for (one, reading) in seen.iter_mut().zip(reading) {
        if let Some(reading) = reading {
            // Who cannot say who it is fits nobody.
            one.identity = Some(reading.await.unwrap_or_default());
        }
    }
}

/// Identifies unknown controllers, of which the plan has these.
pub(super) async fn stretch(
    context: &Context,
    seen: &[FoundController],
    planned: Vec<DeviceId>,
    equals: Equals,
) {
    let planned: Vec<DeviceId> = (planned.into_iter())
        .filter(|id| by_alias::alias_of(&context.plan.devices[id.index()]).is_none())
        .filter(|id| !lock(&context.device_table).is_there(*id))
        .collect();
    if seen.is_empty() {
        return;
    }
    let mut seen = seen.to_vec();
    identify(context, &mut seen).await;
    let identities: Vec<Identity> =
        seen.iter().map(|one| one.identity.unwrap_or_default()).collect();
    let differs = |id: DeviceId, found: &Identity| {
        let device = &context.plan.devices[id.index()];
        let anyone = device.identity == Identity::default();
        mismatch(&device.identity, found, device.revision_rule).filter(|_| !anyone)
    };
    let fits = |at: usize, of: usize| differs(planned[of], &identities[at]).is_none();
    let numbers = Numbers::read(context, &seen, &planned).await;
    let pairs: Vec<(usize, usize)> = if seen.len() == planned.len() {
        (0..seen.len()).map(|at| (at, at)).collect()
    } else {
        let tells = |at: usize, of: usize| numbers.wrong(at, planned[of]).is_none();
        let by_number = align(seen.len(), planned.len(), |at, of| fits(at, of) && tells(at, of));
        // Numbers that contradict the places are those of SubDevices that were exchanged.
        match numbers.contradict(&by_number, &planned) {
            false => by_number,
            true => align(seen.len(), planned.len(), fits),
        }
    };
    let mut pairs: Vec<(usize, DeviceId)> =
        pairs.into_iter().map(|(at, of)| (at, planned[of])).collect();
    let paired: BTreeSet<usize> = pairs.iter().map(|(at, _)| *at).collect();
    if equals == Equals::Beside && seen.len() != planned.len() {
        let fits = |at: usize, id: DeviceId| differs(id, &identities[at]).is_none();
        let is_there = |id| lock(&context.device_table).is_there(id);
        let tree = &context.plan.tree;
        pairs = by_wiring::without_doubtful(tree, is_there, pairs, &planned, fits);
    }
    for (at, found) in identities.iter().enumerate() {
        let is_known =
            paired.contains(&at) || by_alias::is_one(context, seen[at].place, found).await;
        if !is_known && lock(&context.device_table).add_stranger(None, *found) {
            let (position, found) = (seen[at].position, *found);
            context.wire.emit(Event::UnplannedDevice { position, found });
        }
    }
    let mut giving = Vec::with_capacity(pairs.len());
    for (at, id) in pairs {
        let found = identities[at];
        match differs(id, &found) {
            None if numbers.refuses(context, &seen[at], at, id).await => {}
            None => {
                context.wire.emit(Event::Identified { id, found });
                let (context, place) = (context.clone(), seen[at].place);
                let wire = context.wire.clone();
                giving.push(wire.spawn(async move { give_address(&context, place, id).await }));
            }
            Some(mismatch) if lock(&context.device_table).add_stranger(Some(id), found) => {
                let expected = context.plan.devices[id.index()].identity;
                context.wire.emit(Event::WrongDevice { id, mismatch, expected, found });
            }
            Some(_told) => {}
        }
    }
    for given in giving {
        given.await;
    }
}

async fn give_address(context: &Context, place: Target, id: DeviceId) {
    let DevicePlan { station, settings, .. } = &context.plan.devices[id.index()];
    let station = *station;
    if settings.addressing == AddressingChoice::Position {
        // Only its place was sought: who runs goes on running, who began anew is set up.
        let state = context.wire.read_one(place, AL_STATUS.address, AL_STATUS.len).await;
        let state = state.ok().and_then(|reply| AlStatus(reply.word(0)).state().state());
        context.wire.set_place(station, place);
        find(context, id, state.is_none_or(|state| state == AlState::Init));
        return;
    }
    match address::assign(&context.wire, place, station).await {
        Ok(()) => find(context, id, true),
        Err(_) => lose(context, id),
    }
}
