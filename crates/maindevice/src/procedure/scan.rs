//! Finding out what is there: look, station addresses, EEPROMs, wiring.
//!
//! What a scan writes: station addresses (0x0010) of SubDevices that have none or share theirs, the
//! command registers of the EEPROM interface (0x0500 to 0x0507), and once the broadcast that latches
//! receive times (0x0900). States, outputs and counters stay as they are.

use std::collections::BTreeMap;

use linesman_config::inventory::{FoundDevice, Inventory};
use linesman_config::profile::DeviceProfile;
use linesman_proto::address::{DeviceId, Network, Path, Position, StationAddress};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{self, AlStatus, DlStatus};
use linesman_proto::sii::{Identity, Image};
use linesman_proto::state::AlStatusCode;
use linesman_proto::time::{DcTime32, Instant, Span};
use linesman_proto::topology::derive::{Doubt, TopologyError};
use linesman_proto::topology::{Reconstruction, SeenController, Tree, Wired};

use super::read_only_scan::{self, DeviceReading, ReadOnlyScan, ReadOnlyScanError};
use super::sii::{Head, SiiAccessError};
use super::{address, sii};
use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;

/// A scan that came to no result.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ScanError {
    /// There is nothing to scan.
    #[error(transparent)]
    ReadOnlyScan(#[from] ReadOnlyScanError),
    /// A SubDevice was counted but does not answer, or not alone.
    #[error("position {position}, of {count} that were counted, cannot be addressed: {error}")]
    Address {
        /// Which.
        position: Position,
        /// How many were counted.
        count: usize,
        /// What failed.
        error: ExchangeError,
    },
    /// The number of SubDevices changed meanwhile.
    #[error(
        "{before} SubDevices at first, {after} at the end of the scan: a link or supply comes and \
         goes; scan again, or watch the line with `diagnose`"
    )]
    Changing {
        /// Before.
        before: u16,
        /// After.
        after: u16,
    },
}

/// Who a scan has found at which station address. A SubDevice that loses its supply loses that address; so
/// whoever still has it, and has it alone, is the one that was found.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ScanCache {
    at: Instant,
    devices: BTreeMap<StationAddress, Identity>,
}

impl ScanCache {
    /// So long it is relied upon.
    const FRESH: Span = Span::s(1);

    /// Those of an inventory. A scan leaves no address to two.
    #[must_use]
    pub fn of(inventory: &Inventory, at: Instant) -> Self {
        let known = |device: &FoundDevice| Some((device.station, device.identity?));
        Self { at, devices: inventory.devices.iter().filter_map(known).collect() }
    }

    /// Who has this address, as long as that is fresh.
    #[must_use]
    pub fn who(&self, station: StationAddress, now: Instant) -> Option<Identity> {
        let is_fresh = now.since(self.at) <= Self::FRESH;
        self.devices.get(&station).copied().filter(|_| is_fresh)
    }
}

/// How often a scan begins anew when SubDevices come or go meanwhile.
const ATTEMPTS: u32 = 3;

/// Scans a line, with or without error counters.
///
/// # Errors
/// [`ScanError`].
pub async fn scan(wire: Wire, network: Network, counters: bool) -> Result<Inventory, ScanError> {
    let mut attempt = 1;
    loop {
        match scan_once(&wire, network, counters).await {
            Ok(inventory) => return Ok(inventory),
            Err(error) if attempt >= ATTEMPTS => return Err(error),
            Err(ScanError::ReadOnlyScan(error)) => return Err(error.into()),
            Err(ScanError::Address { .. } | ScanError::Changing { .. }) => attempt += 1,
        }
    }
}

async fn scan_once(wire: &Wire, network: Network, counters: bool) -> Result<Inventory, ScanError> {
    let seen_line = read_only_scan::scan(wire.clone(), network, counters).await?;
    let stations = give_addresses(wire, &seen_line).await?;
    let on_b = |device: &DeviceReading| device.target.card() == Some(Path::B);
    let half = seen_line.devices.iter().position(on_b).unwrap_or(seen_line.devices.len());
    let seen = latch(wire, &seen_line, &stations).await;
    let images = images(wire, &stations).await;
    let devices: Vec<_> = (seen_line.devices.into_iter().zip(0..))
        .zip(stations.iter().zip(images))
        .map(|((looked, id), (station, image))| found(DeviceId(id), looked, *station, image))
        .collect();
    let before = devices.len() as u16;
    let (after, _) = read_only_scan::count(wire, network).await?;
    if after != before {
        return Err(ScanError::Changing { before, after });
    }
    let mut wiring = wiring(&seen, half);
    if wire.ring_intact() == Some(true) && half < seen.len() {
        // Where the halves meet is no end of the line.
        let reversed = TopologyError::RingReversed { node: half, behind: seen.len() - half - 1 };
        wiring.errors = vec![reversed];
    }
    Ok(Inventory { devices, wiring })
}

/// The line as card A sees it; in a broken ring also the half behind card B, from `half` on.
fn wiring(seen: &[SeenController], half: usize) -> Reconstruction {
    let (on_a, on_b) = seen.split_at(half.min(seen.len()));
    let mut first = Reconstruction::of(Path::A, on_a);
    if on_b.is_empty() {
        return first;
    }
    let second = Reconstruction::of(Path::B, on_b);
    let shifted = |wired: Wired| Wired { on: wired.on.map(|node| node + half), ..wired };
    let both = match (first.tree.wiring(), second.tree.wiring()) {
        (Ok(a), Ok(b)) => a.into_iter().chain(b.into_iter().map(shifted)).collect::<Vec<_>>(),
        (Err(_), _) | (_, Err(_)) => Vec::new(),
    };
    match Tree::from_wiring(&both, None) {
        Ok(tree) if tree.len() == seen.len() => {
            first.tree = tree;
            first.entry_basis.extend(second.entry_basis);
            first.doubts.extend(second.doubts.into_iter().map(|doubt| shift_doubt(doubt, half)));
            first.errors.extend(second.errors);
            first
        }
        // Halves that do not fit together are told as one line, with what is wrong with that.
        Ok(_) | Err(_) => Reconstruction::of(Path::A, seen),
    }
}

fn shift_doubt(doubt: Doubt, by: usize) -> Doubt {
    match doubt {
        Doubt::Entry { node, taken } => Doubt::Entry { node: node + by, taken },
        Doubt::Place { node, port, child, candidates } => {
            Doubt::Place { node: node + by, port, child: child + by, candidates }
        }
        Doubt::ReceiveTimes { node } => Doubt::ReceiveTimes { node: node + by },
    }
}

async fn give_addresses(
    wire: &Wire,
    seen_line: &ReadOnlyScan,
) -> Result<Vec<StationAddress>, ScanError> {
    let present: Vec<StationAddress> =
        seen_line.devices.iter().map(|device| device.station.unwrap_or_default()).collect();
    let chosen = address::choose(&present);
    let giving: Vec<_> = (seen_line.devices.iter().zip(&present).zip(&chosen))
        .filter(|((_, present), chosen)| present != chosen)
        .map(|((device, _), chosen)| {
            let (wire, position, station) = (wire.clone(), device.position, *chosen);
            let place = device.target;
            async move { (position, address::assign(&wire, place, station).await) }
        })
        .map(|task| wire.spawn(task))
        .collect();
    let count = present.len();
    for given in giving {
        let (position, outcome) = given.await;
        outcome.map_err(|error| ScanError::Address { position, count, error })?;
    }
    Ok(chosen)
}

/// Ports and receive times of one and the same frame, for the wiring.
async fn latch(
    wire: &Wire,
    seen_line: &ReadOnlyScan,
    stations: &[StationAddress],
) -> Vec<SeenController> {
    let receive_time = register::RECEIVE_TIME;
    // Who has no clocks does not take it: the working counter says nothing.
    let latched = wire.write(Target::All, receive_time.address, &[0; 4]).await.is_ok();
    // In a closed ring the frame does not come back to the ports it left by.
    let latched = latched && wire.ring_intact() != Some(true);
    let reading: Vec<_> = (seen_line.devices.iter())
        .zip(stations)
        .map(|(device, station)| {
            let clocks = device.information.is_some_and(|it| it.features.distributed_clocks());
            let times = (latched && clocks)
                .then(|| wire.read(Target::Station(*station), receive_time.address, 16));
            (device.dl_status.unwrap_or_default(), times)
        })
        .collect();
    let mut seen = Vec::with_capacity(reading.len());
    for (dl_status, times) in reading {
        let times = match times {
            Some(times) => times.await.ok().filter(crate::exchange::Reply::answered),
            None => None,
        };
        let open = open_ports(dl_status);
        let received = |port: Port| {
            let times = times.as_ref().filter(|_| open[port])?;
            Some(DcTime32(u32::from_le_bytes(times.bytes(4 * port.index()))))
        };
        seen.push(SeenController { open, received: PortMap::from_fn(received) });
    }
    seen
}

fn open_ports(status: DlStatus) -> PortMap<bool> {
    PortMap::from_fn(|port| status.port_state(port).is_active())
}

/// The EEPROMs of all: each is looked at, but of those that are alike one only is read to its end.
async fn images(wire: &Wire, stations: &[StationAddress]) -> Vec<Result<Image, SiiAccessError>> {
    let targets = || stations.iter().map(|station| Target::Station(*station));
    let reading: Vec<_> = targets()
        .map(|target| {
            let wire = wire.clone();
            wire.clone().spawn(async move { sii::read_head(&wire, target).await })
        })
        .collect();
    let mut heads = Vec::with_capacity(reading.len());
    for head in reading {
        heads.push(head.await);
    }
    let read_rest = |target: Target, head: &Head| {
        let (wire, head) = (wire.clone(), head.clone());
        wire.clone().spawn(async move { sii::read_rest(&wire, target, &head).await })
    };
    let (mut kinds, mut alone) = (BTreeMap::new(), Vec::with_capacity(heads.len()));
    for (target, head) in targets().zip(&heads) {
        let Ok(head) = head else {
            alone.push(None);
            continue;
        };
        match head.kind() {
            None => alone.push(Some(read_rest(target, head))),
            Some(kind) => {
                kinds.entry(kind).or_insert_with(|| read_rest(target, head));
                alone.push(None);
            }
        }
    }
    let mut read = BTreeMap::new();
    for (kind, reading) in kinds {
        read.insert(kind, reading.await);
    }
    let mut images = Vec::with_capacity(heads.len());
    for ((target, head), alone) in targets().zip(heads).zip(alone) {
        let equal = |head: &Head| head.kind().and_then(|kind| read.get(&kind));
        images.push(match (head, alone) {
            (Err(error), _) => Err(error),
            (Ok(head), alone) => match (alone, equal(&head)) {
                (Some(reading), _) => reading.await,
                (None, Some(Ok(bytes))) => Ok(bytes.clone()),
                // Its equal could not be read; it may be all right itself.
                (None, Some(Err(_)) | None) => read_rest(target, &head).await,
            }
            .and_then(|bytes| {
                head.image_like(&bytes).map_err(|error| SiiAccessError::Image { target, error })
            }),
        });
    }
    images
}

fn found(
    id: DeviceId,
    looked: DeviceReading,
    station: StationAddress,
    image: Result<Image, SiiAccessError>,
) -> FoundDevice {
    let (identity, profile, trouble) = match image {
        Ok(image) => {
            let odd: Vec<String> = image.oddities.iter().map(ToString::to_string).collect();
            let trouble = (!odd.is_empty()).then(|| odd.join("; "));
            (Some(image.identity), DeviceProfile::from_sii(&image), trouble)
        }
        Err(error) => (None, DeviceProfile::default(), Some(error.to_string())),
    };
    FoundDevice {
        id,
        position: looked.position,
        station,
        alias: looked.alias.unwrap_or_default(),
        identity,
        profile,
        information: looked.information.unwrap_or_default(),
        al_status: looked.al_status.unwrap_or(AlStatus(0)),
        al_code: looked.al_code.unwrap_or(AlStatusCode::NO_ERROR),
        dl_status: looked.dl_status.unwrap_or_default(),
        counters: looked.counters.unwrap_or_default(),
        sii_trouble: trouble,
    }
}
