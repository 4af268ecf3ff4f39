//! Random place and severity of a fault of the catalogue: wider than [`crate::choice`] draws, down
//! to a single hit.

#![expect(clippy::wildcard_enum_match_arm, reason = "menus, not tables of all faults")]

mod others;

use linesman_config::fault::FaultName::{self, *};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::Span;
use linesman_proto::topology::End;
use linesman_sim::device::library;
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::{FaultEntry, OneOrMany, SegmentDevice, SegmentFile};

use crate::choice::{Choice, LineOutline};

/// When a fault is put in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum When {
    /// It is so from the start, before the line is brought up.
    FromStart,
    /// While the line runs.
    Running,
}

/// How it ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ends {
    /// It stays to the end of the case.
    Never,
    /// It is healed when its time is over.
    Healed,
}

/// A fault as drawn.
#[derive(Clone, PartialEq, Debug)]
pub struct Drawn {
    /// What and where, and how long it acts.
    pub choice: Choice,
    /// How it ends.
    pub ends: Ends,
    /// Whose mailbox the application asks meanwhile.
    pub asks: Option<DeviceId>,
}

/// What a line offers to faults.
#[derive(Clone, Copy, Debug)]
pub struct Offer<'a> {
    /// Wiring and names.
    pub outline: &'a LineOutline<'a>,
    /// The segment as described.
    pub file: &'a SegmentFile,
    /// SubDevices that are in step with SYNC0.
    pub clocked: &'a [DeviceId],
    /// The reference clock.
    pub reference: Option<DeviceId>,
    /// When the fault is put in.
    pub when: When,
}

/// When a fault of this name is put in; `early` for those that may begin either way.
#[must_use]
pub fn when(name: FaultName, early: bool) -> When {
    let built_in = linesman_sim::fault::kind(name).is_some_and(|kind| kind.is_built_in());
    // What a device refuses on its way up is refused on the way up; inputs that are frozen and a dead
    // state machine show there only.
    if built_in || matches!(name, InitRefused | ConfigMismatch) || (early && name == FirmwareFault)
    {
        When::FromStart
    } else {
        When::Running
    }
}

/// Draws place and parameters; `None` where the line has no place for it.
#[must_use]
pub fn draw(name: FaultName, offer: &Offer<'_>, stream: &mut Stream) -> Option<Drawn> {
    let mut drawer = Drawer { name, offer, stream };
    match name {
        LinkOpen | FalseLink => drawer.opened(),
        LinkFlapping => drawer.flapping(),
        RingOpen => drawer.ring(),
        EarlyLink => drawer.early(),
        CableDegraded | EmcNoise | TransmitterDamaged | ReceiverDamaged => drawer.noise(),
        NicDamaged => drawer.card(),
        DeviceInternal => drawer.inside(),
        DeviceOff | SupplyOff | BrownOut => drawer.unpowered(),
        EbusOverload => drawer.overload(),
        InitRefused | ConfigMismatch => drawer.refused(),
        FirmwareFault | WatchdogStarved | CycleTooFast | SyncLost => drawer.software(),
        MailboxError | MailboxSlow | MailboxStuck | Emergency => drawer.mailbox(),
        ClockDrift | ReferenceClockLost => drawer.clock(),
        HostDrops | HostJitter | LateFrames => drawer.host(),
        SecondMainDevice | ForeignFrames => drawer.strangers(),
        DevicesSwapped | TwinsSwapped | DuplicateAddress => drawer.pair(),
        DeviceMissing | DeviceWrong | DeviceExtra | PortsSwapped | MainDeviceWrongPort => {
            drawer.built_in()
        }
        _ => None,
    }
}

/// A dip of a supply lasts so long at most, in ms: IEC 61000-4-29 tests DC ports with dips and short
/// interruptions of up to a second.
const DIP_MS: f64 = 1_000.0;
/// A device that stays away for longer lost its supply, for so long at most, in ms.
const OFF_MS: f64 = 10_000.0;
/// Hits in a second: four decades.
const HITS_PER_S: (f64, f64) = (0.5, 5_000.0);
/// Time that a broken link stays so, in ms.
const OPEN_MS: (f64, f64) = (50.0, 10_000.0);

struct Drawer<'a, 's> {
    name: FaultName,
    offer: &'a Offer<'a>,
    stream: &'s mut Stream,
}

impl Drawer<'_, '_> {
    fn entry(&self) -> FaultEntry {
        FaultEntry::new(self.name)
    }

    /// A fault for some time.
    fn lasting(&mut self, entry: FaultEntry, low: f64, high: f64) -> Drawn {
        let lasts = Span::us((self.stream.log_uniform(low, high) * 1e3) as u64);
        let choice = Choice { name: self.name, entry, link: None, device: None, lasts };
        Drawn { choice, ends: Ends::Healed, asks: None }
    }

    /// A fault that stays, or is healed after a while.
    fn hard(&mut self, entry: FaultEntry) -> Drawn {
        let ends = if self.stream.chance(0.5) { Ends::Never } else { Ends::Healed };
        Drawn { ends, ..self.lasting(entry, OPEN_MS.0, OPEN_MS.1) }
    }

    fn number(&mut self, low: f64, high: f64) -> f64 {
        let number = self.stream.log_uniform(low, high);
        (number * 100.0).round() / 100.0
    }

    fn word(&mut self, words: &[&'static str]) -> &'static str {
        self.stream.pick(words).copied().unwrap_or_default()
    }

    fn at_link(drawn: Drawn, link: usize) -> Drawn {
        Drawn { choice: Choice { link: Some(link), ..drawn.choice }, ..drawn }
    }

    fn at_device(drawn: Drawn, device: DeviceId) -> Drawn {
        Drawn { choice: Choice { device: Some(device), ..drawn.choice }, ..drawn }
    }

    /// Both directions of a link, as segment files write it.
    fn both(&self, link: usize) -> String {
        let ends = self.offer.outline.tree.links()[link];
        let end = |end: End| self.offer.outline.end(end);
        format!("{}-{}", end(ends.upstream), end(ends.downstream))
    }

    /// One direction of a link.
    fn one(&mut self, link: usize) -> String {
        let ends = self.offer.outline.tree.links()[link];
        let (mut from, mut to) = (ends.upstream, ends.downstream);
        if self.stream.chance(0.5) {
            std::mem::swap(&mut from, &mut to);
        }
        format!("{}>{}", self.offer.outline.end(from), self.offer.outline.end(to))
    }

    fn opened(&mut self) -> Option<Drawn> {
        let is_false = self.name == FalseLink;
        let outline = self.offer.outline;
        let link =
            if is_false { outline.any_cable(self.stream) } else { outline.any_link(self.stream) }?;
        // A link of a ring that is open is a ring that is open.
        if !is_false && outline.tree.is_on_ring(link) {
            return None;
        }
        let one_way = self.stream.chance(if is_false { 0.3 } else { 0.1 });
        let at = if one_way { self.one(link) } else { self.both(link) };
        let mut entry = self.entry().at(at);
        if is_false {
            entry = entry.with("far", self.word(&["with-link", "without-link"]));
        }
        let drawn = self.hard(entry);
        Some(Self::at_link(drawn, link))
    }

    fn flapping(&mut self) -> Option<Drawn> {
        let link = self.offer.outline.any_link(self.stream)?;
        let entry = self
            .entry()
            .at(self.both(link))
            .with("openings_per_s", self.number(0.3, 10.0))
            .with("open_ms", self.number(0.5, 300.0));
        let drawn = self.lasting(entry, 1_000.0, 5_000.0);
        Some(Self::at_link(drawn, link))
    }

    fn ring(&mut self) -> Option<Drawn> {
        let tree = self.offer.outline.tree;
        let on_ring: Vec<usize> =
            (0..tree.links().len()).filter(|link| tree.is_on_ring(*link)).collect();
        let link = *self.stream.pick(&on_ring)?;
        let entry = self.entry().at(self.both(link));
        let drawn = self.hard(entry);
        Some(Self::at_link(drawn, link))
    }

    fn early(&mut self) -> Option<Drawn> {
        let link = self.offer.outline.any_cable(self.stream)?;
        let entry = self
            .entry()
            .at(self.both(link))
            .with("blind_ms", self.number(10.0, 2_000.0))
            .with("down_ms", self.number(5.0, 1_000.0));
        let drawn = self.lasting(entry, 3_000.0, 5_000.0);
        Some(Self::at_link(drawn, link))
    }

    /// Exactly so many frames, from a single one, or symbols at a rate.
    fn hits(&mut self, entry: FaultEntry, low_ms: f64, high_ms: f64) -> Drawn {
        if self.stream.chance(0.5) {
            let hits = self.stream.log_uniform(1.0, 500.0).round() as u32;
            // There are not many more frames than one a millisecond.
            let least = low_ms.max(f64::from(hits) * 2.0).min(high_ms);
            return self.lasting(entry.with("hits", hits), least, high_ms);
        }
        let rate = self.number(HITS_PER_S.0, HITS_PER_S.1);
        let least = low_ms.max(1_500.0 / rate).min(high_ms);
        self.lasting(entry.with("hits_per_s", rate), least, high_ms)
    }

    fn noise(&mut self) -> Option<Drawn> {
        let outline = self.offer.outline;
        let is_cable = matches!(self.name, CableDegraded | EmcNoise);
        let link =
            if is_cable { outline.any_cable(self.stream) } else { outline.any_link(self.stream) }?;
        let is_whole = is_cable && self.stream.chance(0.5);
        let at = if is_whole { self.both(link) } else { self.one(link) };
        // The transmitter and the receiver of the card are parts of it: that is `nic-damaged`.
        let is_of_card = match self.name {
            TransmitterDamaged => at.starts_with("maindevice"),
            ReceiverDamaged => at.contains(">maindevice"),
            _ => false,
        };
        if is_of_card {
            return None;
        }
        let mut entry = self.entry().at(at.clone());
        if self.name == EmcNoise {
            let mut places = vec![at];
            for _ in 0..self.stream.below(3) {
                let other = outline.any_cable(self.stream)?;
                let place = self.both(other);
                let is_new = |known: &String| !known.contains(&place) && other != link;
                if places.iter().all(is_new) {
                    places.push(place);
                }
            }
            entry.at = Some(OneOrMany::Many(places));
            entry = entry
                .with("bursts_per_s", self.number(1.0, 50.0))
                .with("burst_ms", self.number(0.1, 20.0));
        }
        if self.name == CableDegraded {
            entry = entry.with("movement_ms", self.number(50.0, 3_000.0));
        }
        let drawn = self.hits(entry, 20.0, 3_000.0);
        Some(Self::at_link(drawn, link))
    }

    fn card(&mut self) -> Option<Drawn> {
        let part = self.word(&["receiver", "transmitter"]);
        let link = self.offer.outline.tree.link_at(End::MainDevice(Path::A))?;
        let entry = self.entry().at("maindevice").with("part", part);
        let drawn = self.hits(entry, 20.0, 3_000.0);
        Some(Self::at_link(drawn, link))
    }

    fn inside(&mut self) -> Option<Drawn> {
        let (device, id) = self.any_device()?;
        let entry = self.entry().device(&device.name);
        let drawn = self.hits(entry, 20.0, 3_000.0);
        Some(Self::at_device(drawn, id))
    }

    fn unpowered(&mut self) -> Option<Drawn> {
        let (entry, id) =
            if self.name == DeviceOff { self.one_supplied()? } else { self.supplied()? };
        let drawn = if self.name == BrownOut {
            let entry = entry.with("dip_ms", self.number(0.5, DIP_MS));
            self.lasting(entry, 3_000.0, 4_000.0)
        } else {
            let hard = self.hard(entry.clone());
            Drawn { ends: hard.ends, ..self.lasting(entry, DIP_MS, OFF_MS) }
        };
        Some(Self::at_device(drawn, id))
    }

    fn one_supplied(&mut self) -> Option<(FaultEntry, DeviceId)> {
        let (device, id) = self.any_device()?;
        Some((self.entry().device(device.name), id))
    }

    /// What hangs on a supply: on one of the plant's in half of the cases where it has any, else some devices, or, for a
    /// dip, one.
    fn supplied(&mut self) -> Option<(FaultEntry, DeviceId)> {
        if !self.offer.file.supplies.is_empty()
            && self.stream.chance(0.5)
            && let Some(supply) = self.stream.pick(&self.offer.file.supplies).cloned()
        {
            let first = supply.devices.first()?;
            let at = self.offer.outline.names.iter().position(|name| name == first)?;
            let entry = FaultEntry { supply: Some(supply.name), ..self.entry() };
            return Some((entry, DeviceId(at as u32)));
        }
        if self.name == BrownOut {
            return self.one_supplied();
        }
        let (device, id) = self.any_device()?;
        let mut names = vec![device.name];
        for _ in 0..=self.stream.below(3) {
            let (other, _) = self.any_device()?;
            if !names.contains(&other.name) {
                names.push(other.name);
            }
        }
        // A supply of one device alone is that device's power.
        (names.len() >= 2).then(|| (FaultEntry { devices: Some(names), ..self.entry() }, id))
    }

    fn overload(&mut self) -> Option<Drawn> {
        let feeds = |device: &&SegmentDevice| {
            let found = library::find(&device.type_name);
            found.is_some_and(|found| found.ebus_current_ma() < 0)
        };
        let feeding: Vec<_> = self.offer.file.devices.iter().filter(feeds).collect();
        let device = *self.stream.pick(&feeding)?;
        let entry = self
            .entry()
            .device(&device.name)
            .with("supply_ma", 1.0)
            .with("off_ms", self.number(20.0, DIP_MS))
            .with("on_ms", self.number(300.0, 3_000.0));
        let drawn = self.lasting(entry, 2_000.0, 5_000.0);
        Some(Self::at_device(drawn, self.id(device)?))
    }

    fn for_ever(&mut self, entry: FaultEntry) -> Drawn {
        Drawn { ends: Ends::Never, ..self.lasting(entry, 4_000.0, 6_000.0) }
    }

    fn software(&mut self) -> Option<Drawn> {
        let entry = self.entry();
        let (device, id) = match self.name {
            CycleTooFast | SyncLost => {
                let id = *self.stream.pick(self.offer.clocked)?;
                (self.device(id)?, id)
            }
            _ => self.with_mailbox()?,
        };
        let entry = match self.name {
            WatchdogStarved if self.stream.chance(0.5) => {
                let entry = entry.at("maindevice").with("pause_ms", self.number(120.0, 1_000.0));
                return Some(self.lasting(entry, 2_000.0, 4_000.0));
            }
            WatchdogStarved => entry.with("watchdog_ms", self.number(0.1, 3.0)),
            CycleTooFast => entry.with("needs_us", self.number(5_500.0, 50_000.0)),
            FirmwareFault => {
                let how = match self.offer.when {
                    When::Running => self.word(&["hangs", "restarts", "memory-blocked"]),
                    When::FromStart => self.word(&["inputs-frozen", "state-machine-dead"]),
                };
                entry.with("how", how)
            }
            _ => entry,
        };
        let entry = entry.device(&device.name);
        let drawn = match self.offer.when {
            When::Running => self.lasting(entry, 1_000.0, 4_000.0),
            When::FromStart => self.for_ever(entry),
        };
        Some(Self::at_device(drawn, id))
    }

    fn mailbox(&mut self) -> Option<Drawn> {
        let (device, id) = self.with_mailbox()?;
        let entry = self.entry().device(&device.name);
        let entry = match self.name {
            MailboxError => entry.with("answer", self.word(&["abort", "error-reply"])),
            MailboxSlow => entry.with("by_ms", self.number(100.0, 1_500.0)),
            MailboxStuck => entry.with("side", self.word(&["requests", "answers", "both"])),
            _ => {
                let codes = [0x2310, 0x3210, 0x4310, 0x5000, 0x6100, 0x7300, 0x8130, 0xFF01];
                entry.with("code", *self.stream.pick(&codes)?)
            }
        };
        let is_asked = self.name != Emergency;
        let drawn = self.lasting(entry, 2_000.0, 4_000.0);
        let asks = is_asked.then_some(id);
        Some(Self::at_device(Drawn { asks, ..drawn }, id))
    }

    fn clock(&mut self) -> Option<Drawn> {
        let id = match self.name {
            ReferenceClockLost => self.offer.reference?,
            _ => *self.stream.pick(self.offer.clocked)?,
        };
        let name = self.device(id)?.name.clone();
        let entry = self.entry().device(name);
        let entry = if self.name == ReferenceClockLost {
            entry.with("how", self.word(&["stands", "starts-anew"]))
        } else {
            let sign = if self.stream.chance(0.5) { 1.0 } else { -1.0 };
            entry.with("ppm", sign * self.number(850.0, 2_000.0))
        };
        let drawn = self.lasting(entry, 3_000.0, 5_000.0);
        Some(Self::at_device(drawn, id))
    }

    fn any_device(&mut self) -> Option<(SegmentDevice, DeviceId)> {
        let device = self.stream.pick(&self.offer.file.devices)?.clone();
        let id = self.id(&device)?;
        Some((device, id))
    }

    fn with_mailbox(&mut self) -> Option<(SegmentDevice, DeviceId)> {
        let fits = |device: &&SegmentDevice| {
            library::find(&device.type_name).is_some_and(|found| found.has_mailbox())
        };
        let fitting: Vec<_> = self.offer.file.devices.iter().filter(fits).collect();
        let device = (*self.stream.pick(&fitting)?).clone();
        let id = self.id(&device)?;
        Some((device, id))
    }

    fn id(&self, device: &SegmentDevice) -> Option<DeviceId> {
        let at = self.offer.outline.names.iter().position(|name| *name == device.name)?;
        Some(DeviceId(at as u32))
    }

    fn device(&self, id: DeviceId) -> Option<SegmentDevice> {
        let name = self.offer.outline.names.get(id.index())?;
        self.offer.file.devices.iter().find(|device| device.name == *name).cloned()
    }
}
