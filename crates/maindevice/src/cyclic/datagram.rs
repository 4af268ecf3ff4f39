//! One cyclic datagram: what it must come back with, and what its data mean.

use linesman_config::plan::expect::{PathView, Presence, expect};
use linesman_config::plan::{DatagramPlan, OnWrongCounter, Plan, Role};
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::frame::WKC_LEN;
use linesman_proto::sii::Direction;
use linesman_proto::time::Instant;

use super::copy_range::CopyRanges;
use crate::event::Event;
use crate::exchange::prebuilt;

/// A datagram with what is known of it.
#[derive(Debug)]
pub(super) struct Datagram {
    pub(super) role: Role,
    /// Where its data begin in the frame.
    pub(super) data_at: usize,
    /// How many bytes they are.
    pub(super) len: usize,
    /// Where its working counter is in the frame.
    wkc_at: u32,
    /// What it must come back with: as planned, and with its outputs withheld.
    expected: [Expected; 2],
    /// The same, where it carries process data and came back so the last time; else nothing fits.
    usual: [Usual; 2],
    /// The datagram with its outputs withheld, where that makes a difference.
    without_outputs: Option<DatagramPlan>,
    /// Inputs of those that surely give theirs.
    inputs: CopyRanges,
    /// Inputs that become zero when the working counter is wrong.
    cleared: CopyRanges,
    /// Whether it came back as it should the last time.
    pub(super) good: bool,
    /// How often it did.
    pub(super) receipts: u64,
    /// When it did last, if ever.
    good_at: Instant,
    /// The wrong counter that was last told of; `None` when all is well.
    pub(super) told: Option<WorkingCounter>,
}

/// Working counters with which a datagram comes back nearly always: from the least on, so many more.
#[derive(Clone, Copy, Debug)]
struct Usual {
    least: u32,
    more: u32,
}

impl Usual {
    /// No working counter fits.
    const NONE: Self = Self { least: u32::MAX, more: 0 };

    fn new(expected: Expected) -> Self {
        let Expected { least, most } = expected;
        match most.0.checked_sub(least.0) {
            Some(more) => Self { least: u32::from(least.0), more: u32::from(more) },
            None => Self::NONE,
        }
    }

    #[inline]
    fn fits(self, wkc: WorkingCounter) -> bool {
        u32::from(wkc.0).wrapping_sub(self.least) <= self.more
    }
}

/// Where a datagram is among those of a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) task: usize,
    /// Its frame within the task.
    pub(super) frame: usize,
    /// Its place within the frame.
    pub(super) datagram: usize,
}

/// A working counter that is not known exactly while SubDevices are on their way between states.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Expected {
    /// What those that surely serve it add.
    pub(super) least: WorkingCounter,
    /// What it is when those that are on their way add to it, too.
    pub(super) most: WorkingCounter,
}

impl Expected {
    #[inline]
    pub(super) fn fits(self, wkc: WorkingCounter) -> bool {
        self.least <= wkc && wkc <= self.most
    }
}

impl Datagram {
    pub(super) fn new(plan: &Plan, datagram: &DatagramPlan, data_at: usize) -> Self {
        let command = prebuilt::withheld(datagram.command);
        let differs = command != datagram.command;
        let mut cleared = CopyRanges::default();
        for owned in &datagram.ownership {
            let clears = plan
                .device(owned.device)
                .is_some_and(|device| device.settings.on_wrong_counter == OnWrongCounter::Clear);
            if owned.direction == Direction::Inputs && clears {
                cleared.push(owned, data_at);
            }
        }
        // Room for every bit-wise run, so that taking over who is present allocates nothing.
        let most = datagram.ownership.iter().map(|owned| match owned.is_bytewise() {
            true => 1,
            false => owned.range.len(),
        });
        Self {
            role: datagram.role,
            data_at,
            len: datagram.len,
            wkc_at: (data_at + datagram.len) as u32,
            expected: [Expected::default(); 2],
            usual: [Usual::NONE; 2],
            without_outputs: differs.then(|| DatagramPlan { command, ..datagram.clone() }),
            inputs: CopyRanges::with_room(most.sum()),
            cleared,
            good: false,
            receipts: 0,
            good_at: Instant::ZERO,
            told: None,
        }
    }

    /// Takes over who serves process data: `least` surely, `most` perhaps.
    pub(super) fn refresh(&mut self, plan: &DatagramPlan, least: &Presence, most: &Presence) {
        let expected = |datagram: &DatagramPlan| Expected {
            least: expect(datagram, least, PathView::Merged),
            most: expect(datagram, most, PathView::Merged),
        };
        let planned = expected(plan);
        self.expected = [planned, self.without_outputs.as_ref().map_or(planned, expected)];
        self.note_usual();
        self.inputs.clear();
        for owned in &plan.ownership {
            if owned.direction == Direction::Inputs && least.of(owned.device).inputs {
                self.inputs.push(owned, self.data_at);
            }
        }
    }

    fn note_usual(&mut self) {
        self.usual = match self.role == Role::ProcessData && self.told.is_none() {
            true => self.expected.map(Usual::new),
            false => [Usual::NONE; 2],
        };
    }

    /// When it came back as it should the last time; `None`: it never did.
    pub(super) fn good_at(&self) -> Option<Instant> {
        (self.receipts > 0).then_some(self.good_at)
    }

    /// The working counter in a frame that came back.
    #[inline]
    pub(super) fn counter(&self, frame: &[u8]) -> Option<WorkingCounter> {
        let at = self.wkc_at as usize;
        let bytes = frame.get(at..at + WKC_LEN)?.first_chunk()?;
        Some(WorkingCounter(u16::from_le_bytes(*bytes)))
    }

    #[inline]
    pub(super) const fn expected(&self, withheld: bool) -> Expected {
        self.expected[withheld as usize]
    }

    /// Whether it carries process data and came back as it should, as the last time.
    #[inline]
    pub(super) fn is_usual(&self, withheld: bool, wkc: WorkingCounter) -> bool {
        self.usual[usize::from(withheld)].fits(wkc)
    }

    /// It came back as it should: its inputs are taken over.
    #[inline]
    pub(super) fn take(&mut self, now: Instant, frame: &[u8], inputs: &mut [u8]) {
        self.good = true;
        self.good_at = now;
        self.receipts += 1;
        self.inputs.take(frame, inputs);
    }

    /// Tells that it comes back as it should again.
    #[cold]
    pub(super) fn tell_good(&mut self, place: Place, events: &mut impl FnMut(Event)) {
        self.told = None;
        self.note_usual();
        let Place { task, frame, datagram } = place;
        events(Event::WorkingCounterGood { task, frame, datagram });
    }

    /// Tells with which wrong working counter it comes back.
    #[cold]
    pub(super) fn tell_wrong(
        &mut self,
        place: Place,
        withheld: bool,
        received: WorkingCounter,
        events: &mut impl FnMut(Event),
    ) {
        self.told = Some(received);
        self.note_usual();
        let Place { task, frame, datagram } = place;
        let expected = self.expected(withheld);
        let expected = received.clamp(expected.least, expected.most);
        events(Event::WorkingCounter { task, frame, datagram, expected, received });
    }

    /// It did not: inputs stay as they were, or become zero, as was chosen.
    #[cold]
    pub(super) fn refuse(&mut self, inputs: &mut [u8]) {
        self.good = false;
        self.cleared.clear_image(inputs);
    }
}

/// Sets the inputs of a SubDevice that gives none any more to zero, if that was chosen.
pub(super) fn clear_lost(plan: &Plan, datagram: &DatagramPlan, id: DeviceId, inputs: &mut [u8]) {
    let clears = plan
        .device(id)
        .is_some_and(|device| device.settings.on_wrong_counter == OnWrongCounter::Clear);
    if !clears {
        return;
    }
    let mine = |owned: &&linesman_config::plan::Ownership| {
        owned.device == id && owned.direction == Direction::Inputs
    };
    for owned in datagram.ownership.iter().filter(mine) {
        for at in 0..owned.range.len() {
            if let Some(byte) = inputs.get_mut(owned.image_at + at) {
                *byte &= !owned.mask_of(at);
            }
        }
    }
}
