//! Construction of a segment from its file.

use std::collections::BTreeSet;

use linesman_config::attachment::Attachment;
use linesman_config::project::{ProjectError, Ring};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use linesman_proto::sii::word;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::wiring::ports_after;
use linesman_proto::topology::{Link, Tree};

use super::port_swap::swap_ports;
use super::{DeviceInfo, Segment, build_deviations, ethernet, identification, signal_wires};
use crate::controller::{Controller, ControllerKinds, LocalClock};
use crate::device::Signals;
use crate::device::library::Built;
use crate::fault::{self, FaultError};
use crate::hardware::PortKind;
use crate::seed::Seed;
use crate::segment_file::{self, Planned, SegmentFile, SegmentFileError, TypeError};
use crate::truth::Effect;
use crate::wire::Medium;
use crate::wire::plug_noise::PlugNoise;
use crate::wire::world::World;

/// Why a segment cannot be built.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum BuildError {
    /// The file contradicts itself.
    #[error(transparent)]
    File(#[from] SegmentFileError),
    /// A fault cannot be.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// With the devices that are wrong or missing the wiring does not fit together.
    #[error("with its faults the wiring does not fit together: {0}")]
    Wiring(ProjectError),
    /// A wire leads nowhere.
    #[error("wire {number}, from `{from}` to `{to}`: {why}")]
    Wire {
        /// Which `[[wire]]`, from 1.
        number: usize,
        /// Whose output.
        from: String,
        /// Whose input.
        to: String,
        /// What is wrong.
        why: String,
    },
    /// A device has no processor that could do what the file says.
    #[error(
        "device `{device}`: `sii = \"{place}\"` needs a processor, and a {type_name} has none; \
         leave it out"
    )]
    NoProcessor {
        /// Which device.
        device: String,
        /// What the file says.
        place: &'static str,
        /// Its type.
        type_name: String,
    },
    /// The Ethernet side of a device cannot be so.
    #[error("device `{device}`: ethernet: {why}")]
    Ethernet {
        /// Which device.
        device: String,
        /// What is wrong.
        why: String,
    },
    /// The type that is to sit in another's place is not known.
    #[error("{entry}: {source}")]
    Replacement {
        /// Which fault.
        entry: String,
        /// Why not.
        source: Box<TypeError>,
    },
    /// The type that is to sit in another's place does not fit there.
    #[error("{entry}: a {type_name} does not fit in the place of `{device}`: {why}")]
    Misfit {
        /// Which fault.
        entry: String,
        /// Whose place.
        device: String,
        /// The type.
        type_name: String,
        /// What does not fit.
        why: String,
    },
}

/// What is really put in a place.
pub(super) struct Placed {
    pub(super) id: DeviceId,
    pub(super) planned: Planned,
    revision: Option<u32>,
    /// Alias that a fault has put into its EEPROM.
    pub(super) alias: Option<u16>,
    /// The place from which its wiring came along, if from another.
    pub(super) wiring_of: Option<DeviceId>,
}

pub(super) fn build(file: &SegmentFile) -> Result<Segment, BuildError> {
    file.check()?;
    let file = &build_deviations::with_extras(file)?;
    let planned = segment_file::expand(file)?;
    let names: Vec<String> = planned.iter().map(|controller| controller.name.clone()).collect();
    let ids = (0u32..).map(DeviceId);
    let place =
        |(id, planned)| Placed { id, planned, revision: None, alias: None, wiring_of: None };
    let mut placed: Vec<Placed> = ids.zip(planned).map(place).collect();
    let mut ring = file.ring.as_ref().map(|ring| Ring::closing_at(ring.closes_at.clone()));
    for (index, entry) in file.faults.iter().enumerate() {
        let label = label(index);
        if let Some(replacement) = fault::replacement(&label, entry)? {
            replace(&label, file, &mut placed, &replacement)?;
        }
        build_deviations::swap(&label, &mut placed, entry)?;
        if let Some((alias, devices)) = fault::duplicate_alias(&label, entry)? {
            build_deviations::share_alias(&mut placed, alias, &devices);
        }
        if let Some(device) = fault::missing_device(entry) {
            remove(&mut placed, device, &mut ring);
        }
        if let Some(swapped_ports) = fault::swapped_ports(&label, entry)? {
            swap_ports(&label, &mut placed, &swapped_ports, &mut ring)?;
        }
    }
    assemble(file, placed, ring, names)
}

pub(super) fn label(index: usize) -> String {
    format!("fault {}", index + 1)
}

fn assemble(
    file: &SegmentFile,
    placed: Vec<Placed>,
    ring: Option<Ring>,
    names: Vec<String>,
) -> Result<Segment, BuildError> {
    let controllers: Vec<Planned> = placed.iter().map(|one| one.planned.clone()).collect();
    let mut wiring = segment_file::wiring(file, &controllers);
    wiring.ring = ring;
    let tree = wiring.tree().map_err(BuildError::Wiring)?;

    let seed = Seed(file.seed.unwrap_or(0));
    let mut signals = Signals::default();
    let mut kinds = ControllerKinds::default();
    let mut devices = Vec::with_capacity(placed.len());
    let mut made = Vec::with_capacity(placed.len());
    for one in &placed {
        let Some((controller, device)) = make(file, one, seed, &mut signals, &mut kinds)? else {
            continue;
        };
        made.push(controller);
        devices.push(device);
    }
    build_deviations::move_wiring(&placed, &mut devices);
    signal_wires::lay(file, &names, &placed, &devices, &mut signals)?;
    let mut world = World::new(&tree, made, &cable_lengths(file, &placed, &tree), signals);
    for (wired, link) in tree.links().iter().zip(&mut world.links) {
        link.medium = medium(file, &placed, wired);
        link.link_up = link_up(file, &placed, link);
    }
    world.plug_noise =
        PlugNoise::new(file.noise_at_link_up.unwrap_or(0.0), seed.stream("plug noise"));
    let current = |one: &Placed| one.planned.kind.ebus_current_ma();
    let mut segment = Segment {
        supplies: file.supplies.clone(),
        ebus_ma: placed.iter().map(current).collect(),
        fed_anew: placed.iter().map(|one| one.planned.fed_anew).collect(),
        groups: build_deviations::groups(file, &placed),
        seed,
        ..Segment::of_world(&file.name, tree, world, devices, names)
    };
    if file.old_counters {
        age(&mut segment);
    }
    set_counters(&mut segment, file, &placed);
    for (index, entry) in file.faults.iter().enumerate() {
        schedule(&mut segment, &label(index), entry)?;
    }
    segment.advance(Instant::ZERO);
    Ok(segment)
}

/// The controller in a place, with all that the file says of it; `None` where its type has not so many parts.
fn make(
    file: &SegmentFile,
    one: &Placed,
    seed: Seed,
    signals: &mut Signals,
    kinds: &mut ControllerKinds,
) -> Result<Option<(Controller, DeviceInfo)>, BuildError> {
    let device = &file.devices[one.planned.device];
    // What is planned has as many parts as its type.
    let Some(mut built) = build_one(one, signals) else { return Ok(None) };
    if let Some(revision) = one.revision {
        set_revision(&mut built.sii, revision);
    }
    let id = device.id.filter(|_| one.planned.part == 0);
    let identification = identification::set(&mut built, id, signals);
    let first = one.planned.part == 0 && one.planned.copy == 0;
    let said = device.alias.filter(|_| first);
    if let Some(alias) = one.alias.or(said) {
        identification::set_alias(&mut built.sii, alias);
    }
    let clock = clock(file, &one.planned, seed);
    let place = device.sii.unwrap_or_default();
    if place.needs_processor() && !built.firmware.has_processor() {
        return Err(BuildError::NoProcessor {
            device: one.planned.name.clone(),
            place: place.name(),
            type_name: one.planned.kind.name().to_owned(),
        });
    }
    let Built { mut hardware, sii, mut firmware, outputs, inputs } = place.apply(built);
    if one.planned.part == 0 {
        ethernet::connect(&mut *firmware, device, &one.planned.name, one.id)?;
    }
    let counting = &mut hardware.counting;
    let counts = device.counts_forwarded.or(file.counts_forwarded);
    counting.forwarded = counts.unwrap_or(counting.forwarded);
    counting.remakes_symbol_errors =
        device.remakes_symbol_errors.unwrap_or(counting.remakes_symbol_errors);
    let mut controller = Controller::new(one.id, kinds.get(hardware), clock, firmware, sii);
    identification.finish(&mut controller);
    Ok(Some((controller, DeviceInfo { outputs, inputs })))
}

/// Lengths of the cables, in m, in the order of the tree's links.
fn cable_lengths(file: &SegmentFile, placed: &[Placed], tree: &Tree) -> Vec<f64> {
    let length = |link: &Link| match link.downstream.node() {
        Some(node) => placed[node].planned.cable_m,
        None => {
            let ring = file.ring.as_ref().and_then(|ring| ring.cable_m);
            ring.unwrap_or(segment_file::DEFAULT_CABLE_M)
        }
    };
    tree.links().iter().map(length).collect()
}

/// The medium of a link.
fn medium(file: &SegmentFile, placed: &[Placed], wired: &Link) -> Medium {
    // A device of several controllers has a cable to its first only.
    let medium = match wired.downstream.node().map(|node| &placed[node].planned) {
        Some(planned) if planned.part == 0 => file.devices[planned.device].medium,
        Some(_) => None,
        None => file.ring.as_ref().and_then(|ring| ring.medium),
    };
    medium.unwrap_or_default()
}

/// The time in which the link of a cable comes up, where the file says it.
fn link_up(file: &SegmentFile, placed: &[Placed], link: &crate::wire::Link) -> Option<Span> {
    let planned = &placed[link.downstream.node()?].planned;
    if planned.part != 0 || link.kind != PortKind::Mii {
        return None;
    }
    let ms = file.devices[planned.device].link_up_ms?;
    Some(Span::us((ms * 1e3) as u64))
}

/// Error counters start as the file says.
fn set_counters(segment: &mut Segment, file: &SegmentFile, placed: &[Placed]) {
    for one in placed.iter().filter(|one| one.planned.part == 0) {
        for (key, value) in &file.devices[one.planned.device].counters {
            if let Some(counter) = segment_file::parse_counter(key) {
                segment.set_counter(one.id, counter, *value);
            }
        }
    }
}

fn schedule(
    segment: &mut Segment,
    label: &str,
    entry: &segment_file::FaultEntry,
) -> Result<(), BuildError> {
    let id = segment.schedule(label, entry, Instant::ZERO, None)?;
    let effect = if fault::missing_device(entry).is_some() {
        Effect::MissingDevice
    } else if fault::replacement(label, entry)?.is_some() {
        Effect::WrongDevice
    } else if fault::extra(label, entry)?.is_some() {
        Effect::ExtraDevice
    } else if fault::swaps(entry).is_some() {
        Effect::SwappedDevice
    } else if let Some((address, _)) = fault::duplicate_alias(label, entry)? {
        Effect::SharedAddress { address }
    } else if fault::swapped_ports(label, entry)?.is_some() {
        Effect::WrongPort
    } else {
        return Ok(());
    };
    let places = segment.world.truth.fault(id).map_or(Vec::new(), |fault| fault.places.clone());
    for place in places {
        segment.world.truth.effect(Instant::ZERO, Some(id), place, effect);
    }
    Ok(())
}

fn build_one(one: &Placed, signals: &mut Signals) -> Option<Built> {
    let Planned { kind, serial, part, .. } = &one.planned;
    kind.build(*serial, signals).into_iter().nth(*part)
}

/// A quartz that is a little off, warms up, and has run for some time.
fn clock(file: &SegmentFile, planned: &Planned, seed: Seed) -> LocalClock {
    let device = &file.devices[planned.device];
    // A device keeps its quartz wherever it sits.
    let alone = planned.part == 0 && device.repeat.is_none();
    let name = if alone { &device.name } else { &planned.name };
    let mut stream = seed.stream(&format!("clock {name}"));
    let start = stream.below(1_000_000_000_000);
    let ppm = stream.fraction() * 50.0 - 25.0;
    let mut clock = LocalClock::with_ppm(start, device.clock_ppm.unwrap_or(ppm));
    clock.ramp_ppb_per_s = (stream.fraction() * 40.0 - 20.0).round() as i64;
    clock.ramp = Span::s(stream.between(60, 300));
    clock.jitter_ns = stream.between(0, 6) as u16;
    clock.seed = stream.number();
    if let Some(said) = &device.clock {
        said.apply(&mut clock);
    }
    clock
}

fn set_revision(sii: &mut [u8], revision: u32) {
    let at = word::REVISION.byte();
    if let Some(slot) = sii.get_mut(at..at + 4) {
        slot.copy_from_slice(&revision.to_le_bytes());
    }
}

/// Old errors and noise at power-on: some counters of some controllers are not 0.
fn age(segment: &mut Segment) {
    let mut stream = segment.seed.stream("old counters");
    let devices: Vec<DeviceId> = segment.devices().collect();
    for device in devices {
        for counter in ErrorCounter::ALL {
            let likely = match counter {
                ErrorCounter::PhysicalLayer(_) | ErrorCounter::LostLink(_) => 0.15,
                ErrorCounter::InvalidFrame(_) | ErrorCounter::Forwarded(_) => 0.08,
                ErrorCounter::ProcessingUnit => 0.05,
                ErrorCounter::Pdi => 0.0,
            };
            if stream.chance(likely) {
                // Mostly a few, now and then many, up to the end of the counter.
                let value = stream.log_uniform(1.0, 400.0).min(255.0) as u8;
                segment.set_counter(device, counter, value);
            }
        }
    }
}

/// Puts another device in a place.
fn replace(
    label: &str,
    file: &SegmentFile,
    placed: &mut [Placed],
    replacement: &fault::Replacement,
) -> Result<(), BuildError> {
    let Some(index) = placed.iter().position(|one| one.planned.name == replacement.device) else {
        // The fault itself says what is wrong with its place.
        return Ok(());
    };
    placed[index].revision = replacement.revision;
    let Some(type_name) = &replacement.type_name else { return Ok(()) };
    let kind = file.kind(type_name, None).map_err(|source| BuildError::Replacement {
        entry: label.to_owned(),
        source: Box::new(source),
    })?;
    let misfit = |why: String| BuildError::Misfit {
        entry: label.to_owned(),
        device: replacement.device.clone(),
        type_name: kind.name().to_owned(),
        why,
    };
    let parts = placed.iter().filter(|one| one.planned.is_of(&placed[index].planned)).count();
    let [ports] = kind.ports()[..] else {
        return Err(misfit("devices with several controllers cannot be exchanged".to_owned()));
    };
    if parts != 1 {
        return Err(misfit("devices with several controllers cannot be exchanged".to_owned()));
    }
    let used = used_ports(placed, index);
    for port in used {
        let (was, is) = (placed[index].planned.ports[port], ports[port]);
        if was != is {
            return Err(misfit(format!("its port {port} is {is:?}, expected {was:?}")));
        }
    }
    placed[index].planned.ports = ports;
    placed[index].planned.kind = kind;
    Ok(())
}

/// The ports of a controller that something is plugged into.
pub(super) fn used_ports(placed: &[Placed], index: usize) -> Vec<Port> {
    let name = &placed[index].planned.name;
    let children = placed.iter().filter_map(|other| match &other.planned.on {
        Attachment::Device { name: on, port } if on == name => Some(*port),
        Attachment::Device { .. } | Attachment::MainDevice(_) => None,
    });
    std::iter::once(placed[index].planned.entry).chain(children).collect()
}

/// Takes a device out. What hung on it by the kind of wire by which it was itself entered moves up
/// to its place, the first in the order of frames; the rest is not there either.
fn remove(placed: &mut Vec<Placed>, device: &str, ring: &mut Option<Ring>) {
    let Some(index) = placed.iter().position(|one| one.planned.name == device) else { return };
    let gone = placed[index].planned.clone();
    let (on, entry) = (placed[index].planned.on.clone(), placed[index].planned.entry);
    let kind = placed[index].planned.ports[entry];
    let parts: Vec<(String, PortKindMap)> = placed
        .iter()
        .filter(|one| one.planned.is_of(&gone))
        .map(|one| (one.planned.name.clone(), one.planned.ports))
        .collect();
    placed.retain(|one| !one.planned.is_of(&gone));
    let mut heir = None;
    for (name, ports) in &parts {
        for port in ports_after(entry) {
            let here = Attachment::Device { name: name.clone(), port };
            let child = placed.iter_mut().find(|one| one.planned.on == here);
            if heir.is_none() && ports[port] == kind {
                if let Some(child) = child {
                    child.planned.on = on.clone();
                    heir = Some(child.id);
                } else if ring.as_ref().is_some_and(|ring| ring.closes_at == here) {
                    *ring = match &on {
                        Attachment::Device { .. } => Some(Ring::closing_at(on.clone())),
                        Attachment::MainDevice(_) => None,
                    };
                    return drop_orphans(placed, ring);
                }
            }
        }
    }
    drop_orphans(placed, ring);
}

type PortKindMap = linesman_proto::port::PortMap<PortKind>;

/// Takes out what hangs on nothing.
fn drop_orphans(placed: &mut Vec<Placed>, ring: &mut Option<Ring>) {
    loop {
        let names: BTreeSet<String> = placed.iter().map(|one| one.planned.name.clone()).collect();
        let is_there = |on: &Attachment| match on {
            Attachment::MainDevice(_) => true,
            Attachment::Device { name, .. } => names.contains(name),
        };
        let before = placed.len();
        placed.retain(|one| is_there(&one.planned.on));
        if ring.as_ref().is_some_and(|ring| !is_there(&ring.closes_at)) {
            *ring = None;
        }
        if placed.len() == before {
            return;
        }
    }
}
