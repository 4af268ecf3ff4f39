//! The swarm over the segment alone: any plant, any fault of the catalogue, any traffic.
//!
//! There is no MainDevice and no diagnosis in it, only frames that a stream of chance makes up. What
//! must hold whatever happens:
//!
//! * the segment never panics, and no frame walks for ever: every frame comes back at most once, or
//!   has a place in the truth log where it was lost;
//! * no error counter moves without a logged cause;
//! * the same seed gives the same bytes, however often somebody looks in between;
//! * once all faults are healed everybody who is there answers again, unless the wiring itself is
//!   wrong, and counters stand still.

use std::fmt;

use linesman_config::fault::FaultName;
use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};
use linesman_proto::time::{Instant, Span};
use linesman_sim::device::library::{self, LibraryType};
use linesman_sim::fault::{KINDS, Kind, PlaceRule, Shape};
use linesman_sim::seed::{Seed, Stream};
use linesman_sim::segment::{FrameTally, Segment};
use linesman_sim::segment_file::{
    BurstTimes, FaultEntry, PlantOptions, RandomTimes, Schedule, SegmentDevice, SegmentFile, Times,
    plant,
};
use linesman_sim::truth::FaultId;

/// How many frames are sent while faults act.
const FRAMES: u64 = 240;
/// From one frame to the next at most.
const LONGEST_PAUSE_US: u64 = 4_000;
/// After this long everything is healed and every link is up again.
const RECOVERY: Span = Span::s(15);
/// The largest frame.
const FRAME: usize = 1_514;

/// What came of one seed.
#[derive(Clone, Debug)]
pub struct PhysicsReport {
    /// The seed.
    pub seed: u64,
    /// Controllers of its plant.
    pub devices: usize,
    /// The faults, in words.
    pub faults: Vec<String>,
    /// How many of them had an effect.
    pub effective: usize,
    /// What became of the frames.
    pub tally: FrameTally,
    /// What must hold and did not, in words.
    pub violations: Vec<String>,
}

impl PhysicsReport {
    /// Whether all held.
    #[must_use]
    pub fn is_green(&self) -> bool {
        self.violations.is_empty()
    }
}

impl fmt::Display for PhysicsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FrameTally { sent, whole, damaged, vanished, dropped } = self.tally;
        write!(
            f,
            "seed {}: {} devices; {}; {sent} frames sent, {whole} back, {damaged} damaged, \
             {vanished} vanished, {dropped} dropped",
            self.seed,
            self.devices,
            self.faults.join("; "),
        )?;
        for violation in &self.violations {
            write!(f, "\n  {violation}")?;
        }
        if !self.is_green() {
            let next = self.seed + 1;
            write!(f, "\n  again: linesman lab swarm --physics --seeds {}..{next}", self.seed)?;
        }
        Ok(())
    }
}

/// Runs one seed, twice: once looked at seldom, once often.
#[must_use]
pub fn run_physics_seed(seed: u64) -> PhysicsReport {
    let mut run = Run::new(seed, 1);
    let mut report = run.play();
    let mut again = Run::new(seed, 7);
    let second = again.play();
    if run.digest != again.digest || report.tally != second.tally {
        report.violations.push("the same seed gave other bytes when played again".to_owned());
    }
    report
}

struct Run {
    seed: u64,
    stream: Stream,
    file: SegmentFile,
    segment: Segment,
    /// Planned wiring is wrong: nobody can tell who answers.
    twisted: bool,
    now: Instant,
    /// How often somebody looks between two frames.
    looks: u64,
    buffer: Vec<u8>,
    digest: u64,
    faults: Vec<String>,
    violations: Vec<String>,
}

impl Run {
    fn new(seed: u64, looks: u64) -> Self {
        let mut stream = Seed(seed).stream("physics swarm");
        let ring = stream.chance(0.25);
        let all_types = stream.chance(0.5);
        let options =
            PlantOptions { min_devices: 1, max_devices: 24, junction: false, ring, all_types };
        let mut file = plant(Seed(seed), &options);
        file.noise_at_link_up = stream.chance(0.3).then_some(3.0);
        let mut faults = Vec::new();
        let built_in: Vec<&Kind> = KINDS.iter().filter(|kind| kind.is_built_in()).collect();
        let whole = Segment::build(&file);
        let mut segment = whole.unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let mut twisted = false;
        if stream.chance(0.2)
            && let Some(kind) = stream.pick(&built_in)
        {
            let entry = any_fault(kind, &file, &mut stream);
            let mut wrong = file.clone();
            wrong.faults.push(entry.clone());
            // What cannot be built in here is refused with a reason.
            if let Ok(built) = Segment::build(&wrong) {
                (segment, twisted) = (built, true);
                faults.push(crate::choice::text(&entry));
                file = wrong;
            }
        }
        Self {
            seed,
            stream,
            file,
            segment,
            twisted,
            now: Instant::ZERO,
            looks,
            buffer: Vec::new(),
            digest: 0xCBF2_9CE4_8422_2325,
            faults,
            violations: Vec::new(),
        }
    }

    fn play(&mut self) -> PhysicsReport {
        let all = self.count();
        if !self.twisted && all.map(usize::from) != Some(self.segment.tree().len()) {
            self.violation(format!("{all:?} answer before anything is broken"));
        }
        let mut ids = Vec::new();
        for _ in 0..self.stream.between(1, 3) {
            ids.extend(self.inject());
            for _ in 0..FRAMES / 3 {
                self.send_any();
            }
            self.audit("while faults act");
        }
        for id in &ids {
            self.segment.heal(self.now, *id);
        }
        self.wait(RECOVERY);
        self.audit("after healing");
        self.check_whole(all);
        let truth = self.segment.truth().faults();
        PhysicsReport {
            seed: self.seed,
            devices: self.segment.tree().len(),
            faults: std::mem::take(&mut self.faults),
            effective: truth.iter().filter(|fault| fault.first_effect.is_some()).count(),
            tally: self.segment.frames(),
            violations: std::mem::take(&mut self.violations),
        }
    }

    fn inject(&mut self) -> Option<FaultId> {
        let is_ring = self.file.ring.is_some();
        let fits =
            |kind: &&Kind| !kind.is_built_in() && (is_ring || kind.place != PlaceRule::RingLink);
        let kinds: Vec<&Kind> = KINDS.iter().filter(fits).collect();
        let kind = self.stream.pick(&kinds)?;
        let mut entry = any_fault(kind, &self.file, &mut self.stream);
        // Nothing in this plant can have it.
        let nowhere = entry.device.is_none() && entry.devices.is_none() && entry.at.is_none();
        if nowhere && kind.place.needs_place() {
            return None;
        }
        entry.schedule = any_schedule(&mut self.stream);
        let id = match self.segment.inject(self.now, &entry) {
            Ok(id) => id,
            // What feeds nobody cannot be overloaded.
            Err(_) if kind.place == PlaceRule::Feed => return None,
            // Chance has put together what does not go together; without its own choices it must do.
            Err(_) => {
                (entry.schedule, entry.parameters) = (Schedule::default(), Default::default());
                match self.segment.inject(self.now, &entry) {
                    Ok(id) => id,
                    Err(error) => {
                        if !self.twisted {
                            self.violation(format!("{}: {error}", crate::choice::text(&entry)));
                        }
                        return None;
                    }
                }
            }
        };
        self.faults.push(crate::choice::text(&entry));
        Some(id)
    }

    /// After healing everybody answers, and counters stand still.
    fn check_whole(&mut self, all: Option<u16>) {
        // A card whose loops were closed by hand, or a state that a frame of chance has written, are
        // no faults: only the wires are looked at, so loops are set to automatic first.
        let auto = frame(Command::Bwr, 0, 0x0100, &[0x01, 0x00, 0x07, 0x00], 0);
        for path in self.paths() {
            self.send(path, &auto);
        }
        self.wait(Span::s(4));
        let before = self.counters();
        let again = self.count();
        if !self.twisted && again != all {
            self.violation(format!("{again:?} answer after healing, {all:?} before"));
        }
        if self.counters() != before {
            self.violation("a counter moved after healing".to_owned());
        }
        let active: Vec<_> = self.segment.truth().active().map(|fault| fault.name).collect();
        if let Some(name) = active.into_iter().find(|name| !is_for_ever(*name)) {
            self.violation(format!("{name} still acts after healing"));
        }
    }

    fn counters(&self) -> Vec<u8> {
        let controllers = self.segment.devices().filter_map(|id| self.segment.controller(id));
        controllers
            .flat_map(|known| {
                known.error_counters().iter().map(|(_, value)| value).collect::<Vec<_>>()
            })
            .collect()
    }

    fn paths(&self) -> Vec<Path> {
        Path::ALL.into_iter().take(1 + usize::from(self.file.ring.is_some())).collect()
    }

    /// How many answer a broadcast, by all cards together.
    fn count(&mut self) -> Option<u16> {
        let probe = frame(Command::Brd, 0, 0x0000, &[0], 0xC0);
        let mut sum = None;
        for path in self.paths() {
            for bytes in self.send(path, &probe) {
                let counter = answer(&bytes, 0xC0);
                if let Some(counter) = counter {
                    sum = Some(sum.unwrap_or(0) + counter);
                }
            }
        }
        sum
    }

    fn send(&mut self, path: Path, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.segment.handle_frame(self.now, path, bytes);
        self.wait(Span::ms(1))
    }

    /// A frame of chance, mostly a good one.
    fn send_any(&mut self) {
        let paths = self.paths();
        let stream = &mut self.stream;
        let command = *stream
            .pick(&[Command::Brd, Command::Bwr, Command::Aprd, Command::Lrw, Command::Brw])
            .unwrap_or(&Command::Brd);
        let len = stream.between(1, 1_200) as usize;
        let ado = *stream.pick(&[0x0000, 0x0110, 0x0130, 0x1000, 0x0900]).unwrap_or(&0);
        // Written is only what does no harm.
        let ado = if command == Command::Brd || command == Command::Aprd { ado } else { 0x1000 };
        let adp = stream.below(30) as u16;
        let mut bytes = frame(command, 0u16.wrapping_sub(adp), ado, &vec![0x5A; len], 1);
        if stream.chance(0.03) {
            // Cut off within a datagram, or no EtherCAT at all.
            let keep = stream.between(14, bytes.len() as u64) as usize;
            bytes.truncate(keep);
        } else if stream.chance(0.02) {
            bytes[12] = 0x08;
        }
        let path = *stream.pick(&paths).unwrap_or(&Path::A);
        let pause = Span::us(self.stream.between(1, LONGEST_PAUSE_US));
        self.segment.handle_frame(self.now, path, &bytes);
        self.wait(pause);
    }

    fn wait(&mut self, span: Span) -> Vec<Vec<u8>> {
        let until = self.now + span;
        let step = Span::ns((span.as_nanos() / self.looks).max(1));
        let mut all = Vec::new();
        let strangers = |segment: &Segment| {
            segment.truth().faults().iter().map(|fault| fault.frames_sent).sum::<u64>()
        };
        while self.now < until {
            self.now = (self.now + step).min(until);
            self.segment.advance(self.now);
            while let Some(arrival) = self.segment.poll_arrival(&mut self.buffer) {
                self.note(&arrival.at.as_nanos().to_le_bytes());
                self.note(&[u8::from(arrival.intact), arrival.path.index() as u8]);
                let buffer = std::mem::take(&mut self.buffer);
                self.note(&buffer);
                all.push(buffer.clone());
                self.buffer = buffer;
            }
        }
        let tally = self.segment.frames();
        let back = tally.whole + tally.damaged + tally.vanished + tally.dropped;
        if back > tally.sent {
            let sent = strangers(&self.segment);
            self.violation(format!(
                "{back} of {} frames accounted for, and {sent} of others",
                tally.sent
            ));
        }
        all
    }

    fn note(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.digest = (self.digest ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }

    fn audit(&mut self, when: &str) {
        // What a frame on its way does to counters is in the log before it is in the counters.
        self.wait(Span::ms(5));
        let holes = self.segment.audit();
        if !holes.is_empty() {
            self.violation(format!("{when} counters moved without a cause: {holes:?}"));
        }
    }

    fn violation(&mut self, text: String) {
        self.violations.push(text);
    }
}

/// Whether a fault is in the line from its making on, and stays.
fn is_for_ever(name: FaultName) -> bool {
    linesman_sim::fault::kind(name).is_some_and(Kind::is_built_in)
}

/// A fault of a kind somewhere in a plant, with parameters of chance.
fn any_fault(kind: &Kind, file: &SegmentFile, stream: &mut Stream) -> FaultEntry {
    let mut entry = FaultEntry::new(kind.name);
    let needs_software = matches!(kind.place, PlaceRule::Processor | PlaceRule::Mailbox);
    let has_software = |name: &str| library::find(name).is_some_and(LibraryType::has_mailbox);
    let fit = file.devices.iter().filter(|one| !needs_software || has_software(&one.type_name));
    let fit: Vec<_> = fit.collect();
    let Some(device) = stream.pick(&fit) else { return entry };
    let (near, far) = (device.on.to_string(), format!("{}.A", device.name));
    let way = match stream.below(3) {
        0 => format!("{near}>{far}"),
        1 => format!("{far}>{near}"),
        _ => format!("{near}-{far}"),
    };
    let both = format!("{near}-{far}");
    let one = if stream.chance(0.5) { format!("{near}>{far}") } else { format!("{far}>{near}") };
    entry = match kind.place {
        PlaceRule::Link => entry.at(both),
        PlaceRule::Directions | PlaceRule::ManyDirections => entry.at(way),
        PlaceRule::Direction => entry.at(one),
        PlaceRule::Pair => {
            let other = file.devices.iter().find(|other| other.name != device.name);
            let pair = |other: &SegmentDevice| vec![device.name.clone(), other.name.clone()];
            FaultEntry { devices: other.map(pair), ..entry }
        }
        PlaceRule::Device
        | PlaceRule::Devices
        | PlaceRule::Feed
        | PlaceRule::Processor
        | PlaceRule::Mailbox
        | PlaceRule::DeviceOrCard => entry.device(&device.name),
        PlaceRule::Entrance if stream.chance(0.5) => entry.at(one),
        PlaceRule::Card | PlaceRule::RingLink | PlaceRule::Entrance => entry,
    };
    for parameter in kind.parameters {
        if stream.chance(0.5) {
            continue;
        }
        match parameter.shape {
            Shape::Number { low, high, .. } => {
                let value = stream.log_uniform(low.max(0.1), high.clamp(0.2, 2_000.0));
                entry = entry.with(parameter.key, value);
            }
            Shape::Whole { low, high, .. } => {
                let value = stream.between(low.into(), high.min(low.saturating_add(40)).into());
                entry = entry.with(parameter.key, value as u32);
            }
            Shape::Word { words } => {
                if let Some(word) = stream.pick(words) {
                    entry = entry.with(parameter.key, *word);
                }
            }
            Shape::Text => {}
        }
    }
    #[expect(clippy::wildcard_enum_match_arm, reason = "only these need more than chance")]
    match kind.name {
        // Any terminal draws more than that.
        FaultName::EbusOverload => entry.with("supply_ma", 1.0),
        FaultName::DeviceExtra => {
            entry.device = Some("extra".to_owned());
            entry.with("type", "EL1008").with("on", near.as_str())
        }
        _ => entry,
    }
}

/// Once, again and again, by chance, in bursts.
fn any_schedule(stream: &mut Stream) -> Schedule {
    let for_ms = Some(stream.log_uniform(0.01, 20.0));
    let burst = stream.chance(0.2).then_some(BurstTimes { count: 3, every_ms: 25.0 });
    let repeated = Schedule { for_ms, burst, ..Schedule::default() };
    match stream.below(6) {
        0 => Schedule { every_ms: Some(stream.log_uniform(100.0, 300.0)), ..repeated },
        1 => Schedule { at_ms: Some(Times::Many(vec![0.0, 150.0])), ..repeated },
        2 => {
            let random = Some(RandomTimes { mean_ms: 40.0, for_ms: Some(5.0) });
            Schedule { random, times: Some(20), ..Schedule::default() }
        }
        3 => Schedule { burst: None, ..repeated },
        _ => Schedule::default(),
    }
}

fn frame(command: Command, adp: u16, ado: u16, data: &[u8], index: u8) -> Vec<u8> {
    let mut bytes = vec![0; FRAME];
    let mut builder = FrameBuilder::new(&mut bytes, MacAddress([0, 1, 2, 3, 4, 5]));
    let address = DatagramAddress::Physical(adp, RegisterAddress(ado));
    if let Ok(slot) = builder.push(command, index, address, data.len()) {
        slot.copy_from_slice(data);
    }
    let len = builder.finish();
    bytes.truncate(len);
    bytes
}

/// The working counter of a frame that is ours.
fn answer(bytes: &[u8], index: u8) -> Option<u16> {
    let view = FrameView::parse(bytes).ok()?;
    let datagram = view.datagrams().next()?.ok()?;
    (datagram.index() == index).then(|| datagram.wkc().value())
}
