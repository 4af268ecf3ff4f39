//! Expansion of devices to controllers: most devices have one, a large junction has three; a device
//! that is repeated is there many times.

use std::collections::BTreeMap;

use linesman_config::attachment::Attachment;
use linesman_config::project::{Project, ProjectDevice, ProjectError, Ring};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::sii::Image;
use linesman_proto::topology::wiring::ports_after;

use super::passive::Passives;
use super::{SegmentDevice, SegmentFile, SegmentFileError};
use crate::device::{DeviceKind, Signals};
use crate::hardware::PortKind;

/// What a cable is long when nothing is said, in metres.
pub(crate) const DEFAULT_CABLE_M: f64 = 5.0;
/// The longest line that a MainDevice can address.
const MOST_REPEATS: u32 = 65_535;
/// The longest cable: glass fibre.
const LONGEST_CABLE_M: f64 = 2_000.0;
/// Longest time in which a link comes up.
const LONGEST_LINK_UP_MS: f64 = 10_000.0;

/// A controller that is planned.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Planned {
    /// Index of its device in the file.
    pub(crate) device: usize,
    /// Which of those that a `repeat` makes of it, from 0.
    pub(crate) copy: usize,
    /// Which controller of the device, from 0.
    pub(crate) part: usize,
    pub(crate) name: String,
    pub(crate) kind: DeviceKind,
    pub(crate) on: Attachment,
    pub(crate) entry: Port,
    pub(crate) cable_m: f64,
    /// A terminal without a controller feeds the E-bus before it anew.
    pub(crate) fed_anew: bool,
    pub(crate) ports: PortMap<PortKind>,
    pub(crate) serial: u32,
}

impl Planned {
    /// Whether both are controllers of one device.
    pub(crate) fn is_of(&self, other: &Self) -> bool {
        (self.device, self.copy) == (other.device, other.copy)
    }
}

/// All controllers of a file, in the order of their numbers.
pub(crate) fn expand(file: &SegmentFile) -> Result<Vec<Planned>, SegmentFileError> {
    let mut planned = Vec::with_capacity(file.devices.len());
    let passives = Passives::of(file);
    for (index, device) in file.devices.iter().enumerate() {
        let place = passives.resolve(device)?;
        if passives.devices().any(|passive| std::ptr::eq(passive, device)) {
            continue;
        }
        let kind = file.kind(&device.type_name, device.slots.as_deref()).map_err(|source| {
            SegmentFileError::Type { device: device.name.clone(), source: Box::new(source) }
        })?;
        let entry = match device.entry.as_deref() {
            None => Port::A,
            Some(text) => parse_port(text).ok_or_else(|| SegmentFileError::Range {
                device: device.name.clone(),
                key: "entry",
                given: format!("`{text}`"),
                allowed: "A, B, C or D",
            })?,
        };
        let Some(repeat) = device.repeat else {
            let serial = device.serial.unwrap_or(planned.len() as u32 + 1);
            expand_device(device, (index, 0), &kind, entry, serial, place, &mut planned);
            continue;
        };
        for copy in 0..count_of(device, repeat)? {
            let no = copy as u32 + 1;
            let place = match copy {
                0 => place.clone(),
                copy => (behind(device, &kind, entry, copy)?, false),
            };
            let one = SegmentDevice {
                name: format!("{}[{no}]", device.name),
                repeat: None,
                ..device.clone()
            };
            let next = planned.len() as u32 + 1;
            let serial = device.serial.map_or(next, |first| first.wrapping_add(no - 1));
            expand_device(&one, (index, copy), &kind, entry, serial, place, &mut planned);
        }
    }
    Ok(planned)
}

/// How often a device is there.
fn count_of(device: &SegmentDevice, repeat: u32) -> Result<usize, SegmentFileError> {
    if (1..=MOST_REPEATS).contains(&repeat) {
        return Ok(repeat as usize);
    }
    Err(SegmentFileError::Range {
        device: device.name.clone(),
        key: "repeat",
        given: repeat.to_string(),
        allowed: "1 to 65535",
    })
}

/// Where copy number `copy` (from 1) of a device hangs: on the one before, by its first port that is
/// of the kind by which it is entered itself.
fn behind(
    device: &SegmentDevice,
    found: &DeviceKind,
    entry: Port,
    copy: usize,
) -> Result<Attachment, SegmentFileError> {
    let all = found.ports();
    let kind = all.first().copied().unwrap_or_default()[entry];
    let inner_links = found.inner_links();
    for (part, ports) in all.into_iter().enumerate() {
        let taken = |port: Port| {
            let links = inner_links.iter();
            links.flat_map(|link| [link.from, link.to]).any(|end| end == (part, port))
        };
        let free = |port: &Port| (part, *port) != (0, entry) && !taken(*port);
        let found = ports_after(entry).into_iter().find(|port| free(port) && ports[*port] == kind);
        if let Some(port) = found {
            let name = format!("{}[{copy}]", device.name);
            return Ok(Attachment::Device { name: part_name(&name, part), port });
        }
    }
    Err(SegmentFileError::NoRepeat {
        device: device.name.clone(),
        type_name: found.name().to_owned(),
        kind: kind_name(kind),
    })
}

/// The name of a controller of a device.
fn part_name(device: &str, part: usize) -> String {
    match part {
        0 => device.to_owned(),
        part => format!("{device}/{}", part + 1),
    }
}

fn expand_device(
    device: &SegmentDevice,
    (index, copy): (usize, usize),
    kind: &DeviceKind,
    entry: Port,
    serial: u32,
    (on_place, fed_anew): (Attachment, bool),
    planned: &mut Vec<Planned>,
) {
    let name = |part: usize| part_name(&device.name, part);
    let inner_links = kind.inner_links();
    for (part, ports) in kind.ports().into_iter().enumerate() {
        let inner = inner_links.iter().find(|link| link.to.0 == part);
        let (on, entry, cable_m) = match inner {
            Some(link) => {
                let on = Attachment::Device { name: name(link.from.0), port: link.from.1 };
                (on, link.to.1, 0.0)
            }
            None => {
                let length = match ports[entry] {
                    PortKind::Ebus => 0.0,
                    PortKind::Mii | PortKind::Absent => DEFAULT_CABLE_M,
                };
                (on_place.clone(), entry, device.cable_m.unwrap_or(length))
            }
        };
        planned.push(Planned {
            device: index,
            copy,
            part,
            name: name(part),
            kind: kind.clone(),
            on,
            entry,
            cable_m,
            fed_anew: fed_anew && inner.is_none(),
            ports,
            serial,
        });
    }
}

fn parse_port(text: &str) -> Option<Port> {
    let mut letters = text.chars();
    match (letters.next().and_then(Port::from_letter), letters.next()) {
        (Some(port), None) => Some(port),
        (Some(_) | None, _) => None,
    }
}

/// Checks names, ports, places and ranges.
pub(super) fn check(file: &SegmentFile, planned: &[Planned]) -> Result<(), SegmentFileError> {
    for device in &file.devices {
        let out_of_range = |key, given: f64, allowed| SegmentFileError::Range {
            device: device.name.clone(),
            key,
            given: given.to_string(),
            allowed,
        };
        if let Some(length) = device.cable_m.filter(|m| !(0.0..=LONGEST_CABLE_M).contains(m)) {
            return Err(out_of_range("cable_m", length, "0 to 2000"));
        }
        if let Some(ms) = device.link_up_ms.filter(|ms| !(0.0..=LONGEST_LINK_UP_MS).contains(ms)) {
            return Err(out_of_range("link_up_ms", ms, "0 to 10000"));
        }
        if let Some(ppm) = device.clock_ppm.filter(|ppm| !(-200.0..=200.0).contains(ppm)) {
            return Err(out_of_range("clock_ppm", ppm, "-200 to 200"));
        }
        if let Some(clock) = &device.clock {
            clock.check(&device.name)?;
        }
        if let Some(given) = device.counters.keys().find(|key| parse_counter(key).is_none()) {
            return Err(SegmentFileError::Counter {
                device: device.name.clone(),
                given: given.clone(),
                allowed: "A.frame, A.physical, A.forwarded, A.lost_link (and B, C, D), \
                          processing_unit, pdi",
            });
        }
    }
    if let Some(noise) = file.noise_at_link_up.filter(|mean| !(0.0..=1_000.0).contains(mean)) {
        return Err(SegmentFileError::Wiring(format!(
            "`noise_at_link_up` is {noise}, expected 0 to 1000"
        )));
    }
    let ring_m = file.ring.as_ref().and_then(|ring| ring.cable_m);
    if let Some(length) = ring_m.filter(|m| !(0.0..=LONGEST_CABLE_M).contains(m)) {
        return Err(SegmentFileError::Range {
            device: "ring".to_owned(),
            key: "cable_m",
            given: length.to_string(),
            allowed: "0 to 2000",
        });
    }
    wiring(file, planned).tree().map_err(wiring_error)?;
    check_ports(file, planned)?;
    check_supplies(file)
}

/// Supplies have names of their own and feed devices that are there.
fn check_supplies(file: &SegmentFile) -> Result<(), SegmentFileError> {
    for (index, supply) in file.supplies.iter().enumerate() {
        let wrong = |what: String| SegmentFileError::Supply { supply: supply.name.clone(), what };
        if file.supplies[..index].iter().any(|other| other.name == supply.name) {
            return Err(wrong("there are two of this name".to_owned()));
        }
        let known = |name: &String| file.devices.iter().any(|device| device.name == *name);
        match supply.devices.iter().find(|name| !known(name)) {
            Some(name) => return Err(wrong(format!("no device is called `{name}`"))),
            None if supply.devices.is_empty() => {
                return Err(wrong("it feeds nobody: name its `devices`".to_owned()));
            }
            None => {}
        }
    }
    Ok(())
}

fn wiring_error(error: ProjectError) -> SegmentFileError {
    let ProjectError::Wiring(text) = error else {
        return SegmentFileError::Wiring(error.to_string());
    };
    SegmentFileError::Wiring(text)
}

/// The counter behind a key of the file, such as `A.lost_link`; `None` for what is none.
#[must_use]
pub fn parse_counter(key: &str) -> Option<linesman_proto::register::ErrorCounter> {
    use linesman_proto::register::ErrorCounter as Counter;
    match key {
        "processing_unit" => return Some(Counter::ProcessingUnit),
        "pdi" => return Some(Counter::Pdi),
        _ => {}
    }
    let (port, what) = key.split_once('.')?;
    let port = parse_port(port)?;
    match what {
        "frame" => Some(Counter::InvalidFrame(port)),
        "physical" => Some(Counter::PhysicalLayer(port)),
        "forwarded" => Some(Counter::Forwarded(port)),
        "lost_link" => Some(Counter::LostLink(port)),
        _ => None,
    }
}

/// Every end is a port that is there, and both ends of a link are of one kind.
fn check_ports(file: &SegmentFile, planned: &[Planned]) -> Result<(), SegmentFileError> {
    let by_name: BTreeMap<&str, &Planned> =
        planned.iter().map(|known| (known.name.as_str(), known)).collect();
    let kind_at = |end: &Attachment| match end {
        Attachment::MainDevice(_) => Ok(PortKind::Mii),
        Attachment::Device { name, port } => match by_name.get(name.as_str()) {
            Some(known) => has_port(known, *port),
            None => Ok(PortKind::Mii),
        },
    };
    for passive in Passives::of(file).devices() {
        let (on, _) = Passives::of(file).resolve(passive)?;
        let from_kind = kind_at(&on)?;
        if from_kind != PortKind::Ebus {
            return Err(SegmentFileError::Kinds {
                from: on.to_string(),
                from_kind: kind_name(from_kind),
                to: format!("{}.A", passive.name),
                to_kind: kind_name(PortKind::Ebus),
                instead: instead(parent_of(&by_name, &on), PortKind::Ebus),
            });
        }
    }
    for controller in planned {
        let from_kind = kind_at(&controller.on)?;
        let to_kind = has_port(controller, controller.entry)?;
        let parent = parent_of(&by_name, &controller.on);
        check_cable(parent, controller, to_kind)?;
        if from_kind != to_kind {
            return Err(SegmentFileError::Kinds {
                from: controller.on.to_string(),
                from_kind: kind_name(from_kind),
                to: format!("{}.{}", controller.name, controller.entry),
                to_kind: kind_name(to_kind),
                instead: instead(parent, to_kind),
            });
        }
    }
    if let Some(ring) = &file.ring {
        let kind = kind_at(&ring.closes_at)?;
        if kind != PortKind::Mii {
            return Err(SegmentFileError::Kinds {
                from: ring.closes_at.to_string(),
                from_kind: kind_name(kind),
                to: "maindevice.B".to_owned(),
                to_kind: kind_name(PortKind::Mii),
                instead: instead(parent_of(&by_name, &ring.closes_at), PortKind::Mii),
            });
        }
    }
    Ok(())
}

/// Whose port something hangs on; `None` for the MainDevice's.
fn parent_of<'a>(by_name: &BTreeMap<&str, &'a Planned>, on: &Attachment) -> Option<&'a Planned> {
    match on {
        Attachment::Device { name, .. } => by_name.get(name.as_str()).copied(),
        Attachment::MainDevice(_) => None,
    }
}

/// Which other port of the parent would be of the kind that is needed; empty when none is.
fn instead(parent: Option<&Planned>, needed: PortKind) -> String {
    let Some(parent) = parent else { return String::new() };
    let fits = parent.ports.iter().filter(|(port, kind)| **kind == needed && *port != parent.entry);
    let ports: Vec<String> = fits.map(|(port, _)| format!("{}.{port}", parent.name)).collect();
    match ports.is_empty() {
        true => String::new(),
        false => format!("; {} would be {}", ports.join(" or "), kind_name(needed)),
    }
}

/// Fast Hot Connect is at both ends of a cable or at none.
fn check_cable(
    parent: Option<&Planned>,
    controller: &Planned,
    kind: PortKind,
) -> Result<(), SegmentFileError> {
    let misplaced =
        |why: String| Err(SegmentFileError::Misplaced { device: controller.name.clone(), why });
    let fast = |one: Option<&Planned>| one.is_some_and(|one| one.kind.fast_hot_connect());
    if kind == PortKind::Mii && fast(parent) != fast(Some(controller)) {
        return misplaced(format!(
            "a port with Fast Hot Connect fits another such port only, not `{}`",
            controller.on
        ));
    }
    Ok(())
}

fn has_port(controller: &Planned, port: Port) -> Result<PortKind, SegmentFileError> {
    match controller.ports[port] {
        PortKind::Absent => Err(SegmentFileError::NoPort {
            device: controller.name.clone(),
            type_name: controller.kind.name().to_owned(),
            port,
            has: controller
                .ports
                .iter()
                .filter(|(_, kind)| **kind != PortKind::Absent)
                .map(|(port, _)| port.to_string())
                .collect::<Vec<_>>()
                .join(", "),
        }),
        kind @ (PortKind::Ebus | PortKind::Mii) => Ok(kind),
    }
}

const fn kind_name(kind: PortKind) -> &'static str {
    match kind {
        PortKind::Ebus => "an E-bus contact",
        PortKind::Mii => "a 100 Mbit/s port",
        PortKind::Absent => "no port",
    }
}

/// A project that says how things are wired, and nothing of what they are.
pub(crate) fn wiring(file: &SegmentFile, planned: &[Planned]) -> Project {
    let devices = planned.iter().map(|controller| ProjectDevice {
        type_name: controller.kind.name().to_owned(),
        entry: controller.entry.to_string(),
        ..ProjectDevice::at(&controller.name, controller.on.clone())
    });
    let ring = file.ring.as_ref().map(|ring| Ring::closing_at(ring.closes_at.clone()));
    Project { ring, ..Project::of(&file.name, devices.collect()) }
}

/// The whole project.
pub(super) fn project(
    file: &SegmentFile,
    planned: &[Planned],
) -> Result<Project, SegmentFileError> {
    check(file, planned)?;
    let mut project = wiring(file, planned);
    let mut signals = Signals::default();
    for (controller, wanted) in planned.iter().zip(&mut project.devices) {
        let built = controller.kind.build(controller.serial, &mut signals);
        let image = built.get(controller.part).and_then(|one| Image::parse(&one.sii).ok());
        if let Some(image) = image {
            wanted.vendor_id = Some(image.identity.vendor_id);
            wanted.product_code = Some(image.identity.product_code);
            wanted.revision = Some(image.identity.revision);
        }
        let written = file.devices.iter().find(|device| device.name == controller.name);
        wanted.alias = written.and_then(|device| device.alias);
    }
    Ok(project)
}
