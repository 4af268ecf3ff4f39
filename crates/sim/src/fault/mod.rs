//! Fault catalogue of the segment: one file per kind of fault.
//!
//! A [`Kind`] says where its fault can be, which parameters it takes, and makes a
//! [`Source`]: the changes it makes to the world, one after the other, from
//! its start to its end. What it holds when it ends (open contacts, supplies that are off, waiting
//! hits) is let go. No kind knows anything of counters.

mod carrier;
mod error;
mod manual;
mod parameter;
mod place;
mod running;
mod schedule;
mod source;

mod brown_out;
mod cable_degraded;
mod clock_drift;
mod config_mismatch;
mod cycle_too_fast;
mod device_extra;
mod device_internal;
mod device_missing;
mod device_off;
mod device_wrong;
mod devices_swapped;
mod duplicate_address;
mod early_link;
mod ebus_overload;
mod emc_noise;
mod emergency;
mod eoe_fault;
mod false_link;
mod firmware_fault;
mod foreign_frames;
mod host_drops;
mod host_jitter;
mod init_refused;
mod late_frames;
mod link_flapping;
mod link_open;
mod mailbox_error;
mod mailbox_slow;
mod mailbox_stuck;
mod maindevice_wrong_port;
mod nic_damaged;
mod ports_swapped;
mod receiver_damaged;
mod reference_clock_lost;
mod ring_open;
mod second_maindevice;
mod supply_off;
mod sync_lost;
mod transmitter_damaged;
mod twins_swapped;
mod watchdog_starved;

use linesman_config::fault::FaultName;
use linesman_proto::time::{Instant, Span};

pub use carrier::FaultCarrier;
pub use error::FaultError;
pub use manual::manual;
pub use parameter::{Parameter, Shape};
pub(crate) use place::FaultContext;
pub use place::PlaceRule;
pub(crate) use running::{Running, Step};

pub(crate) use device_extra::extra;
pub(crate) use device_missing::missing_device;
pub(crate) use device_wrong::{Replacement, replacement};
pub(crate) use duplicate_address::duplicate_alias;
pub(crate) use ports_swapped::{SwappedPorts, swapped_ports};

use crate::seed::{Seed, Stream};
use crate::segment_file::FaultEntry;
use crate::truth::{FaultId, Place};
use crate::wire::Source;
use parameter::Values;
pub(crate) use place::Target;
use schedule::Window;
pub(crate) use schedule::Windows;

/// A kind of fault.
#[derive(Debug)]
pub struct Kind {
    /// Its name; what it is, is [`FaultName::meaning`].
    pub name: FaultName,
    /// Where it can be.
    pub place: PlaceRule,
    /// What it takes beside place and times.
    pub parameters: &'static [Parameter],
    start: fn(ChangesSource<'_>) -> Result<Box<dyn Source>, FaultError>,
}

impl Kind {
    /// Whether it is in the line from its making on: it cannot come and go while the line runs.
    #[must_use]
    pub fn is_built_in(&self) -> bool {
        let built_in = [
            FaultName::DeviceMissing,
            FaultName::DeviceExtra,
            FaultName::DeviceWrong,
            FaultName::DevicesSwapped,
            FaultName::TwinsSwapped,
            FaultName::PortsSwapped,
            FaultName::MainDeviceWrongPort,
        ];
        built_in.contains(&self.name)
    }
}

/// All kinds that a segment can have.
pub const KINDS: &[Kind] = &[
    link_open::KIND,
    link_flapping::KIND,
    cable_degraded::KIND,
    emc_noise::KIND,
    transmitter_damaged::KIND,
    receiver_damaged::KIND,
    device_internal::KIND,
    device_off::KIND,
    supply_off::KIND,
    brown_out::KIND,
    device_wrong::KIND,
    device_missing::KIND,
    init_refused::KIND,
    nic_damaged::KIND,
    false_link::KIND,
    early_link::KIND,
    ports_swapped::KIND,
    maindevice_wrong_port::KIND,
    ring_open::KIND,
    second_maindevice::KIND,
    foreign_frames::KIND,
    host_jitter::KIND,
    host_drops::KIND,
    mailbox_error::KIND,
    mailbox_slow::KIND,
    mailbox_stuck::KIND,
    eoe_fault::KIND,
    emergency::KIND,
    firmware_fault::KIND,
    watchdog_starved::KIND,
    cycle_too_fast::KIND,
    late_frames::KIND,
    reference_clock_lost::KIND,
    clock_drift::KIND,
    sync_lost::KIND,
    ebus_overload::KIND,
    devices_swapped::KIND,
    twins_swapped::KIND,
    device_extra::KIND,
    duplicate_address::KIND,
    config_mismatch::KIND,
];

pub(crate) const DEVICES: FaultName = FaultName::DevicesSwapped;
pub(crate) const TWINS: FaultName = FaultName::TwinsSwapped;

/// Whether an entry puts two devices in each other's place, and whether they are twins.
pub(crate) fn swaps(entry: &FaultEntry) -> Option<bool> {
    [(DEVICES, false), (TWINS, true)]
        .into_iter()
        .find_map(|(name, twins)| (entry.kind == name.name()).then_some(twins))
}

/// The kind with a name, if a segment can have it.
#[must_use]
pub fn kind(name: FaultName) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.name == name)
}

/// What a kind makes its changes from.
struct ChangesSource<'a> {
    /// How errors call the entry.
    label: &'a str,
    name: FaultName,
    from: Instant,
    to: Option<Instant>,
    target: Target,
    values: Values,
    stream: Stream,
    /// Chance by which a number of hits falls on moments and bytes, where that is not `stream`.
    hits: Option<Stream>,
}

impl ChangesSource<'_> {
    /// The span over which something is spread when no end is given.
    const OPEN_END: Span = Span::s(1);

    /// From begin to end, or for a second.
    fn interval(&self) -> (Instant, Instant) {
        (self.from, self.to.unwrap_or(self.from + Self::OPEN_END))
    }

    fn number(&self, key: &str) -> f64 {
        self.values.number(key).unwrap_or(0.0)
    }

    fn milliseconds(&self, key: &str) -> Span {
        Span::ns((self.number(key) * 1e6) as u64)
    }

    fn error(&self, what: String) -> FaultError {
        FaultError::Combination { entry: self.label.to_owned(), kind: self.name, what }
    }
}

/// What a fault is made from, each time that it comes.
#[derive(Debug)]
pub(crate) struct FaultTemplate {
    label: String,
    kind: &'static Kind,
    target: Target,
    values: Values,
    seed: Seed,
    /// Name of its streams of chance.
    stream: String,
    /// Name of those of a number of hits, where they have their own.
    hits: Option<String>,
}

impl FaultTemplate {
    /// Its changes when it comes for the `nth` time, from 0.
    fn source(&self, nth: u32, window: Window) -> Result<Box<dyn Source>, FaultError> {
        let of_time = |name: &String| match nth {
            0 => self.seed.stream(name),
            nth => self.seed.stream(&format!("{name} time {nth}")),
        };
        (self.kind.start)(ChangesSource {
            label: &self.label,
            name: self.kind.name,
            from: window.from,
            to: window.to,
            target: self.target.clone(),
            values: self.values.clone(),
            stream: of_time(&self.stream),
            hits: self.hits.as_ref().map(of_time),
        })
    }
}

/// A fault that is ready to run.
pub(crate) struct Planned {
    pub(crate) name: FaultName,
    pub(crate) places: Vec<Place>,
    template: FaultTemplate,
    windows: Windows,
    source: Box<dyn Source>,
}

impl Planned {
    /// Lets it run.
    pub(crate) fn run(self, id: FaultId) -> Running {
        Running::new(id, Some(self.template), self.windows, self.source)
    }
}

/// Works out what an entry means here. It begins at its own time, but not before `earliest`; its
/// chance is that of `seed` under the name `stream`; that of a number of hits may have a name of its own.
pub(crate) fn plan(
    label: &str,
    entry: &FaultEntry,
    context: &FaultContext<'_>,
    earliest: Instant,
    seed: Seed,
    (stream, hits): (&str, Option<&str>),
) -> Result<Planned, FaultError> {
    let kind = known_kind(label, entry)?;
    let target = place::resolve(label, kind, entry, context)?;
    let (mut schedule, mut parameters) = (entry.schedule.clone(), entry.parameters.clone());
    // What a kind takes itself is its own.
    if kind.parameters.iter().any(|parameter| parameter.key == "every_ms")
        && let Some(every) = schedule.every_ms.take()
    {
        parameters.insert("every_ms".to_owned(), every.into());
    }
    let values = parameter::read(label, kind, &parameters)?;
    let times = seed.stream(&format!("{stream} times"));
    let windows = schedule::windows(label, entry, &schedule, earliest, times)?;
    let (places, name) = (target.places.clone(), kind.name);
    let (label, stream) = (label.to_owned(), stream.to_owned());
    let hits = hits.map(str::to_owned);
    let template = FaultTemplate { label, kind, target, values, seed, stream, hits };
    let source = template.source(0, windows.first())?;
    Ok(Planned { name, places, template, windows, source })
}

fn known_kind(label: &str, entry: &FaultEntry) -> Result<&'static Kind, FaultError> {
    let name: FaultName = entry.kind.parse().map_err(|_| FaultError::unknown_kind(label, entry))?;
    kind(name).ok_or_else(|| FaultError::NotHere { entry: label.to_owned(), kind: name })
}
