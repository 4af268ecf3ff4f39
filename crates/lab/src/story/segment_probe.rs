//! Probe of the segment for a story: frames on their way, and counters as they were.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use linesman_diagnosis::observe::{Direction, FrameSeen};
use linesman_proto::address::{DeviceId, Path, RegisterAddress};
use linesman_proto::frame::FrameView;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::{ErrorCounter, SYSTEM_TIME_DIFFERENCE, SystemTimeDifference};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::FrameTally;

use super::assertion::{Assertion, FrameFate, Moved};
use crate::habit::Habit;
use crate::lab::{Lab, Tap};
use crate::swarm::counter::{Kind, expected};

/// How many cycles an answer may take before a line counts as silent.
const SILENCE: u64 = 10;
/// How long frames are remembered.
const MEMORY: Span = Span::s(1);

/// A working counter that came back.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Returned {
    at: Instant,
    kind: Kind,
    /// The slot of the exchange: both copies of a frame in a ring have the same.
    index: u8,
    counter: u16,
}

/// Frames of the last second.
#[derive(Clone, Default, Debug)]
struct Frames {
    returned: VecDeque<Returned>,
    last_sent: Option<Instant>,
    last_received: Option<Instant>,
}

impl Frames {
    fn note(&mut self, seen: &FrameSeen<'_>) {
        match seen.direction {
            Direction::Sent => self.last_sent = Some(seen.time),
            Direction::Received => self.last_received = Some(seen.time),
            Direction::Unknown => {}
        }
        let Ok(view) = FrameView::parse(seen.bytes) else { return };
        if seen.direction == Direction::Received {
            for datagram in view.datagrams().filter_map(Result::ok) {
                if let Some(kind) = Kind::of(&datagram) {
                    let (index, counter) = (datagram.index(), datagram.wkc().value());
                    self.returned.push_back(Returned { at: seen.time, kind, index, counter });
                }
            }
        }
        while self.returned.front().is_some_and(|old| old.at + MEMORY < seen.time) {
            self.returned.pop_front();
        }
    }
}

impl Frames {
    /// The working counter of the last datagram of a kind that came back; in a ring both copies
    /// together.
    fn last(&self, kind: Kind, cycle: Span) -> Option<u16> {
        let of_kind = || self.returned.iter().rev().filter(|one| one.kind == kind);
        let last = of_kind().next()?;
        let copies =
            of_kind().filter(|one| one.index == last.index && last.at.since(one.at) < cycle);
        Some(copies.map(|one| one.counter).sum())
    }
}

/// Sees what happens on the segment, for the expectations of a story.
#[derive(Default)]
pub(super) struct SegmentProbe {
    frames: Arc<Mutex<Frames>>,
    /// Counters at the last `inject`.
    counters: BTreeMap<(DeviceId, ErrorCounter), u8>,
    tally: FrameTally,
    /// How long the log of the MainDevice was then.
    logged: usize,
    /// Counters that were named since.
    named: BTreeSet<(DeviceId, ErrorCounter)>,
}

impl SegmentProbe {
    /// Who looks on; the tap goes to the lab.
    pub(super) fn new() -> (Self, Tap) {
        let segment_probe = Self::default();
        let frames = Arc::clone(&segment_probe.frames);
        let tap = Box::new(move |seen: &FrameSeen<'_>| {
            frames.lock().unwrap_or_else(PoisonError::into_inner).note(seen);
        });
        (segment_probe, tap)
    }

    /// From now on differences count from here.
    pub(super) fn mark(&mut self, lab: &Lab) {
        self.counters = counters(lab).collect();
        self.tally = lab.segment().frames();
        self.logged = lab.log().len();
        self.named.clear();
    }

    /// A step names counters.
    pub(super) fn names(&mut self, lab: &Lab, assertion: &Assertion) {
        if let Assertion::Counters(moved) = assertion {
            let found =
                moved.iter().filter_map(|one| Some((device(lab, &one.device).ok()?, one.counter)));
            self.named.extend(found);
        }
    }

    /// Whether an entry of the log has these words, or none has, as it is expected.
    pub(super) fn logged(&self, words: &str, told: bool, lab: &Lab) -> Result<(), String> {
        let since = lab.log().get(self.logged..).unwrap_or_default();
        check(since.iter().any(|entry| entry.text.contains(words)) == told, || {
            let entries: Vec<&str> = since.iter().map(|entry| entry.text.as_str()).collect();
            let none = if told { "an" } else { "no" };
            format!("{none} entry of the log with \"{words}\"; it has\n{}", entries.join("\n"))
        })
    }

    /// Whether an expectation holds now; what is so instead if not.
    pub(super) fn holds(&self, assertion: &Assertion, lab: &Lab) -> Result<(), String> {
        match assertion {
            Assertion::Counters(moved) => self.counters_moved(moved, lab),
            Assertion::NoOtherCounter => {
                let others = self.moved(lab).filter(|(which, _)| !self.named.contains(which));
                let others: Vec<String> = others.map(|(which, by)| text(lab, which, by)).collect();
                check(others.is_empty(), || {
                    format!("no other counter to move, found {}", others.join(", "))
                })
            }
            Assertion::Port { device: name, port, open, link } => {
                let controller = controller(lab, name)?;
                let state = controller.dl_status().port_state(*port);
                let fits = open.is_none_or(|open| open != state.closed)
                    && link.is_none_or(|link| link == state.link);
                check(fits, || {
                    let open = if state.closed { "closed" } else { "open" };
                    let link = if state.link { "with" } else { "without" };
                    format!("another state of {name}.{port}: it is {open} {link} link")
                })
            }
            Assertion::State { device: name, state, error } => {
                let controller = controller(lab, name)?;
                let (status, code) = (controller.al_status(), controller.al_code());
                let visibility = status.error().then_some(code.0);
                let fits = status.state().state() == Some(*state) && visibility == *error;
                check(fits, || format!("another state of {name}: it is {status}, code {code}"))
            }
            Assertion::Frames { fate, amount } => {
                let (now, then) = (lab.segment().frames(), self.tally);
                let damaged = now.damaged - then.damaged;
                let vanished = now.vanished - then.vanished;
                let dropped = now.dropped - then.dropped;
                let count = match fate {
                    FrameFate::Lost => damaged + vanished + dropped,
                    FrameFate::Damaged => damaged,
                    FrameFate::Vanished => vanished,
                    FrameFate::Dropped => dropped,
                };
                check(amount.takes(count), || {
                    format!(
                        "{amount} such frames: {damaged} came back damaged, {vanished} not at all, \
                         {dropped} were lost by the host"
                    )
                })
            }
            Assertion::Answered(wanted) => self.answered(*wanted, lab),
            Assertion::WorkingCounter { full } => self.working_counter(*full, lab),
            Assertion::Reached(amount) => {
                let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
                let count = frames.last(Kind::Broadcast, lab.options().cycle);
                check(count.is_some_and(|count| amount.takes(u64::from(count))), || {
                    format!("{amount} controllers in the last broadcast, found {count:?}")
                })
            }
            Assertion::Carrier(wanted) => {
                let carrier = lab.segment().host(Path::A).carrier;
                check(carrier == *wanted, || format!("the other: carrier is {carrier}"))
            }
            Assertion::Register { device: name, address, bytes } => {
                let controller = controller(lab, name)?;
                let addresses = (address.0..).zip(bytes).map(|(at, _)| at);
                let found: Vec<u8> =
                    addresses.map(|at| controller.register(RegisterAddress(at))).collect();
                check(found == *bytes, || format!("{bytes:02X?} in {name}, found {found:02X?}"))
            }
            Assertion::Clock { device: name, nanoseconds } => {
                let controller = controller(lab, name)?;
                let start = SYSTEM_TIME_DIFFERENCE.address.0;
                let bytes: [u8; 4] = std::array::from_fn(|at| {
                    controller.register(RegisterAddress(start + at as u16))
                });
                let off = SystemTimeDifference::from(bytes).magnitude().as_nanos();
                check(nanoseconds.takes(off), || format!("{nanoseconds} ns in {name}, found {off}"))
            }
        }
    }

    fn counters_moved(&self, moved: &[Moved], lab: &Lab) -> Result<(), String> {
        for one in moved {
            let which = (device(lab, &one.device)?, one.counter);
            let by = self.moved(lab).find(|(found, _)| *found == which).map_or(0, |(_, by)| by);
            check(one.amount.takes(by), || {
                let all: Vec<String> =
                    self.moved(lab).map(|(which, by)| text(lab, which, by)).collect();
                let found = text(lab, which, by);
                let amount = one.amount;
                format!("{amount}, found {found}; moved: {}", all.join(", "))
            })?;
        }
        Ok(())
    }

    /// Counters that moved since the mark, and how far. One that was cleared counts from 0.
    fn moved(&self, lab: &Lab) -> impl Iterator<Item = ((DeviceId, ErrorCounter), u64)> {
        counters(lab).filter_map(|(which, value)| {
            let before = self.counters.get(&which).copied().unwrap_or(0);
            let by = value.checked_sub(before).unwrap_or(value);
            (by > 0).then_some((which, u64::from(by)))
        })
    }

    fn answered(&self, wanted: bool, lab: &Lab) -> Result<(), String> {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let long = lab.options().cycle * SILENCE;
        let recent = |at: Option<Instant>| at.is_some_and(|at| lab.now().since(at) <= long);
        let (asked, answered) = (recent(frames.last_sent), recent(frames.last_received));
        check(answered == wanted && asked, || {
            format!(
                "the other: within {SILENCE} cycles a frame {} sent, and one {} back",
                if asked { "was" } else { "was not" },
                if answered { "came" } else { "did not come" }
            )
        })
    }

    fn working_counter(&self, full: bool, lab: &Lab) -> Result<(), String> {
        if lab.options().habit == Habit::Soem {
            let why = "SOEM maps process data by itself, by no plan; use `expect reached`";
            return Err(why.to_owned());
        }
        let Some(plan) = lab.plan() else { return Err("there is no plan yet".to_owned()) };
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let cycle = lab.options().cycle;
        let reached = vec![true; plan.devices.len()];
        let kinds = plan.datagrams().filter_map(|(.., datagram)| match datagram.address {
            DatagramAddress::Logical(address) => Some(Kind::Logical(address.0)),
            DatagramAddress::Physical(..) => None,
        });
        let (mut came, mut short) = (0, Vec::new());
        for kind in kinds {
            let Some(counter) = frames.last(kind, cycle) else { continue };
            let wanted = expected(kind, plan, &reached, |_| true).unwrap_or(0);
            came += 1;
            if counter < wanted {
                short.push(format!("{counter} of {wanted}"));
            }
        }
        check(came > 0 && short.is_empty() == full, || {
            format!("the other: {came} process data came back, short: {}", short.join(", "))
        })
    }
}

fn check(held: bool, expected: impl FnOnce() -> String) -> Result<(), String> {
    if held { Ok(()) } else { Err(format!("expected {}", expected())) }
}

/// All counters of all controllers.
fn counters(lab: &Lab) -> impl Iterator<Item = ((DeviceId, ErrorCounter), u8)> {
    lab.segment().devices().flat_map(|id| {
        let controller = lab.segment().controller(id).filter(|known| known.is_powered());
        let counters = controller.map(|known| known.error_counters());
        let visibility: Vec<_> = counters
            .iter()
            .flat_map(|all| all.iter().map(|(which, value)| ((id, which), value)))
            .collect();
        visibility
    })
}

fn text(lab: &Lab, (id, counter): (DeviceId, ErrorCounter), by: u64) -> String {
    let name = lab.segment().name(id);
    match counter.port() {
        Some(port) => format!("{name}.{port} {} {by}", counter.name()),
        None => format!("{name} {} {by}", counter.name()),
    }
}

fn device(lab: &Lab, name: &str) -> Result<DeviceId, String> {
    let found = lab.segment().devices().find(|id| lab.segment().name(*id) == name);
    found.ok_or_else(|| format!("no SubDevice of this segment is called `{name}`"))
}

fn controller<'a>(
    lab: &'a Lab,
    name: &str,
) -> Result<&'a linesman_sim::controller::Controller, String> {
    let id = device(lab, name)?;
    lab.segment().controller(id).ok_or_else(|| format!("`{name}` is not there"))
}
