//! Random plants: what a machine might look like, from a seed.
//!
//! Stations of a coupler and its terminals hang on one another by cables; junctions branch off
//! more of them, on cables of their own or as terminals within a station. What can be put where
//! follows from the library: a terminal is entered and left by the E-bus, a coupler turns a cable
//! into an E-bus, a junction has more than one way on by cable.

use linesman_config::attachment::Attachment;
use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::topology::wiring::ports_after;

use super::expand::{expand, wiring};
use super::{SegmentDevice, SegmentFile, SegmentRing};
use crate::device::library::{self, LibraryType};
use crate::hardware::PortKind;
use crate::seed::{Seed, Stream};

/// What plants are made of, unless they are to have everything.
const COMMON: &[&str] = &[
    "EK1100", "EK1101", "EK1110", "EK1122", "EK1521", "CU1123", "CU1124", "CU1128", "EL1004",
    "EL1008", "EL1014", "EL1018", "EL2004", "EL2008", "EL2024", "EL3004", "EL3102", "EL3104",
    "EL3154", "EL3162", "EL4004", "EL4102", "EL4112", "EL2014", "EL6601", "EL7041", "EP1008",
    "EP2308", "EP4174",
];

/// What kind of plant is wanted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlantOptions {
    /// The fewest controllers, at least 1.
    pub min_devices: usize,
    /// The most.
    pub max_devices: usize,
    /// There is at least one junction, if there is room for it.
    pub junction: bool,
    /// The end of the line is wired to a second card.
    pub ring: bool,
    /// Of all types in the library, not of the common ones alone. A seed keeps its plant when the
    /// library grows only without this.
    pub all_types: bool,
}

impl Default for PlantOptions {
    fn default() -> Self {
        Self { min_devices: 5, max_devices: 60, junction: false, ring: false, all_types: false }
    }
}

/// A random, plausible plant: the same for the same seed and options.
#[must_use]
pub fn plant(seed: Seed, options: &PlantOptions) -> SegmentFile {
    let mut stream = seed.stream("plant");
    let low = options.min_devices.max(1) as u64;
    let target = stream.between(low, options.max_devices as u64) as usize;
    let old_counters = stream.chance(0.25);
    let mut builder = PlantBuilder::new(stream, target, options.all_types);
    builder.build(options.junction);
    let ring = if options.ring { builder.ring() } else { None };
    let file = SegmentFile {
        name: format!("plant {}", seed.0),
        seed: Some(seed.0),
        old_counters,
        devices: builder.devices,
        ring,
        ..SegmentFile::default()
    };
    in_order(file)
}

/// What a type is good for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum TypeUse {
    /// From a cable to the E-bus.
    Coupler,
    /// On the E-bus, with ways on by cable: how many.
    EbusJunction(usize),
    /// On the E-bus.
    Terminal,
    /// On a cable, with more than one way on.
    Junction,
    /// On a cable, with one way on.
    Box,
    /// Nothing that a plant is made of.
    None,
}

fn use_of(library_type: &LibraryType) -> TypeUse {
    let Some(first) = library_type.ports().next() else { return TypeUse::None };
    if library_type.fast_hot_connect() {
        // It fits its like only, and never the first cable.
        return TypeUse::None;
    }
    let ways = |kind| ports_after(Port::A).into_iter().filter(|port| first[*port] == kind).count();
    let (ebus, cable) = (ways(PortKind::Ebus), ways(PortKind::Mii));
    let single = library_type.inner_links().is_empty();
    match (first[Port::A], ebus, cable) {
        (PortKind::Mii, 1.., 1..) if single => TypeUse::Coupler,
        (PortKind::Mii, _, 2..) => TypeUse::Junction,
        (PortKind::Mii, 0, 1) => TypeUse::Box,
        (PortKind::Ebus, _, 1..) => TypeUse::EbusJunction(cable),
        (PortKind::Ebus, 1.., 0) => TypeUse::Terminal,
        (PortKind::Mii | PortKind::Ebus | PortKind::Absent, _, _) => TypeUse::None,
    }
}

/// Where a cable can be plugged in.
#[derive(Clone, Debug)]
struct FreePort {
    on: Attachment,
    /// How many stations lie between it and the MainDevice.
    depth: usize,
}

struct PlantBuilder {
    stream: Stream,
    target: usize,
    controllers: usize,
    devices: Vec<SegmentDevice>,
    sockets: Vec<FreePort>,
    couplers: Vec<&'static LibraryType>,
    terminals: Vec<&'static LibraryType>,
    boxes: Vec<&'static LibraryType>,
    junctions: Vec<&'static LibraryType>,
    ebus_junctions: Vec<&'static LibraryType>,
}

impl PlantBuilder {
    fn new(stream: Stream, target: usize, all_types: bool) -> Self {
        let types: Vec<&'static LibraryType> = if all_types {
            library::types().collect()
        } else {
            COMMON.iter().filter_map(|name| library::find(name)).collect()
        };
        let of = |wanted: fn(TypeUse) -> bool| {
            types.iter().copied().filter(|known| wanted(use_of(known))).collect::<Vec<_>>()
        };
        Self {
            stream,
            target,
            controllers: 0,
            devices: Vec::new(),
            sockets: vec![FreePort { on: Attachment::MainDevice(Path::A), depth: 0 }],
            couplers: of(|what| what == TypeUse::Coupler),
            terminals: of(|what| what == TypeUse::Terminal),
            boxes: of(|what| what == TypeUse::Box),
            junctions: of(|what| what == TypeUse::Junction),
            ebus_junctions: of(|what| matches!(what, TypeUse::EbusJunction(_))),
        }
    }

    fn room(&self) -> usize {
        self.target.saturating_sub(self.controllers)
    }

    fn build(&mut self, junction: bool) {
        let mut junction = junction;
        // Each round adds a device, or closes a socket for good.
        while self.room() > 0 && !self.sockets.is_empty() {
            // Mostly the line goes on where it came to last.
            let last = self.sockets.len() - 1;
            let index = if self.stream.chance(0.6) {
                last
            } else {
                self.stream.below(last as u64 + 1) as usize
            };
            let socket = self.sockets.remove(index);
            let begins = self.devices.is_empty();
            if !begins && (junction || self.stream.chance(0.12)) {
                if self.put_junction(&socket) {
                    junction = false;
                    continue;
                }
            } else if !begins && self.stream.chance(0.2) && self.put_box(&socket) {
                continue;
            }
            self.put_station(&socket, junction);
        }
    }

    fn put_junction(&mut self, socket: &FreePort) -> bool {
        let room = self.room();
        let fits: Vec<_> =
            self.junctions.iter().copied().filter(|kind| kind.ports().count() <= room).collect();
        let Some(kind) = self.stream.pick(&fits).copied() else { return false };
        let name = self.put(kind, socket.on.clone(), true);
        for (part, ports) in kind.ports().enumerate() {
            let name = if part == 0 { name.clone() } else { format!("{name}/{}", part + 1) };
            let inner = kind.inner_links();
            for port in ports_after(Port::A) {
                let taken = inner.iter().any(|link| link.from == (part, port));
                if ports[port] == PortKind::Mii && !taken {
                    self.open(&name, port, socket.depth + 1);
                }
            }
        }
        true
    }

    fn put_box(&mut self, socket: &FreePort) -> bool {
        let Some(kind) = self.stream.pick(&self.boxes).copied() else { return false };
        let name = self.put(kind, socket.on.clone(), true);
        self.open_cables(&name, kind, socket.depth + 1);
        true
    }

    /// A coupler and its terminals, as many as its supply carries.
    fn put_station(&mut self, socket: &FreePort, junction: bool) {
        let Some(coupler) = self.stream.pick(&self.couplers).copied() else { return };
        let name = self.put(coupler, socket.on.clone(), true);
        let Some(ports) = coupler.ports().next() else { return };
        let mut current = -i32::from(coupler.ebus_current_ma());
        let mut contact = ports_after(Port::A)
            .into_iter()
            .find(|port| ports[*port] == PortKind::Ebus)
            .map(|port| Attachment::Device { name: name.clone(), port });
        let terminals = self.stream.between(1, 10);
        for place in 0..terminals {
            let Some(on) = contact.take().filter(|_| self.room() > 0) else { break };
            let branches = self.stream.chance(0.08) || (junction && place == 1);
            let kinds = if branches { &self.ebus_junctions } else { &self.terminals };
            let Some(kind) = self.stream.pick(kinds).copied() else { break };
            current -= i32::from(kind.ebus_current_ma());
            if current < 0 {
                break;
            }
            let name = self.put(kind, on, false);
            self.open_cables(&name, kind, socket.depth + 1);
            let ports = kind.ports().next().unwrap_or_default();
            contact = ports_after(Port::A)
                .into_iter()
                .find(|port| ports[*port] == PortKind::Ebus)
                .map(|port| Attachment::Device { name, port });
        }
        // The coupler's own way on comes last, and is thus the likeliest to be used.
        self.open_cables(&name, coupler, socket.depth + 1);
    }

    fn open_cables(&mut self, name: &str, kind: &LibraryType, depth: usize) {
        let Some(ports) = kind.ports().next() else { return };
        for port in ports_after(Port::A) {
            if ports[port] == PortKind::Mii {
                self.open(name, port, depth);
            }
        }
    }

    fn open(&mut self, name: &str, port: Port, depth: usize) {
        let on = Attachment::Device { name: name.to_owned(), port };
        self.sockets.push(FreePort { on, depth });
    }

    /// Puts a device in and gives its name for the time being.
    fn put(&mut self, kind: &LibraryType, on: Attachment, cable: bool) -> String {
        let name = format!("#{}", self.devices.len());
        let cable_m = cable.then(|| (self.stream.log_uniform(0.5, 60.0) * 10.0).round() / 10.0);
        let serial = Some(self.stream.between(1, 999_999) as u32);
        self.controllers += kind.ports().count();
        self.devices.push(SegmentDevice {
            cable_m,
            serial,
            ..SegmentDevice::new(name.clone(), kind.name(), on)
        });
        name
    }

    /// The free socket that is farthest out.
    fn ring(&mut self) -> Option<SegmentRing> {
        let farthest = self.sockets.iter().max_by_key(|socket| socket.depth)?;
        let cable_m = (self.stream.log_uniform(5.0, 80.0) * 10.0).round() / 10.0;
        match farthest.on {
            Attachment::Device { .. } => Some(SegmentRing {
                closes_at: farthest.on.clone(),
                cable_m: Some(cable_m),
                medium: None,
            }),
            Attachment::MainDevice(_) => None,
        }
    }
}

/// Puts devices into the order in which frames pass them, and names them by it: `K1`, `T2`, `J3`.
fn in_order(mut file: SegmentFile) -> SegmentFile {
    let Ok(planned) = expand(&file) else { return file };
    let Ok(tree) = wiring(&file, &planned).tree() else { return file };
    let first_parts = tree.order().iter().filter(|node| planned[**node].part == 0);
    let order: Vec<usize> = first_parts.map(|node| planned[*node].device).collect();
    let mut no = 1;
    let mut names = Vec::with_capacity(order.len());
    for device in &order {
        let found = library::find(&file.devices[*device].type_name);
        let letter = match found.map_or(TypeUse::None, use_of) {
            TypeUse::Coupler => 'K',
            TypeUse::Terminal => 'T',
            TypeUse::Junction | TypeUse::EbusJunction(_) => 'J',
            TypeUse::Box | TypeUse::None => 'B',
        };
        names.push((file.devices[*device].name.clone(), format!("{letter}{no}")));
        no += found.map_or(1, |found| found.ports().count());
    }
    let renamed = |old: &str| {
        let (device, part) = old.split_once('/').map_or((old, None), |(a, b)| (a, Some(b)));
        let new = names.iter().find(|(old, _)| old == device).map_or(device, |(_, new)| new);
        part.map_or(new.to_owned(), |part| format!("{new}/{part}"))
    };
    let moved = |on: &Attachment| match on {
        Attachment::MainDevice(path) => Attachment::MainDevice(*path),
        Attachment::Device { name, port } => {
            Attachment::Device { name: renamed(name), port: *port }
        }
    };
    let devices = order.iter().map(|device| {
        let device = &file.devices[*device];
        SegmentDevice { name: renamed(&device.name), on: moved(&device.on), ..device.clone() }
    });
    let devices = devices.collect();
    if let Some(ring) = &mut file.ring {
        ring.closes_at = moved(&ring.closes_at);
    }
    file.devices = devices;
    file
}
