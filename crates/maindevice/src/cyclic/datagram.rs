//! One cyclic datagram: what it must come back with, and what its data mean.

use linesman_config::plan::expect::{PathView, Presence, expect};
use linesman_config::plan::{DatagramPlan, OnWrongCounter, Plan, Role};
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::sii::Direction;
use linesman_proto::time::Instant;

use super::run::{self, Run};
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
    wkc_at: usize,
    /// What it must come back with: as planned, and with its outputs withheld.
    expected: [Expected; 2],
    /// The datagram with its outputs withheld, where that makes a difference.
    without_outputs: Option<DatagramPlan>,
    /// Inputs of those that surely give theirs.
    inputs: Vec<Run>,
    /// Inputs that become zero when the working counter is wrong.
    cleared: Vec<Run>,
    /// Whether it came back as it should the last time.
    pub(super) good: bool,
    /// When that was last the case.
    pub(super) good_at: Option<Instant>,
    /// How often it was.
    pub(super) receipts: u64,
    /// The wrong counter that was last told of; `None` when all is well.
    pub(super) told: Option<WorkingCounter>,
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
        let mut cleared = Vec::new();
        for owned in &datagram.ownership {
            let clears = plan
                .device(owned.device)
                .is_some_and(|device| device.settings.on_wrong_counter == OnWrongCounter::Clear);
            if owned.direction == Direction::Inputs && clears {
                run::push(&mut cleared, owned, data_at);
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
            wkc_at: data_at + datagram.len,
            expected: [Expected::default(); 2],
            without_outputs: differs.then(|| DatagramPlan { command, ..datagram.clone() }),
            inputs: Vec::with_capacity(most.sum()),
            cleared,
            good: false,
            good_at: None,
            receipts: 0,
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
        self.inputs.clear();
        for owned in &plan.ownership {
            if owned.direction == Direction::Inputs && least.of(owned.device).inputs {
                run::push(&mut self.inputs, owned, self.data_at);
            }
        }
    }

    /// The working counter in a frame that came back.
    #[inline]
    pub(super) fn counter(&self, frame: &[u8]) -> Option<WorkingCounter> {
        let bytes = frame.get(self.wkc_at..)?.first_chunk()?;
        Some(WorkingCounter(u16::from_le_bytes(*bytes)))
    }

    #[inline]
    pub(super) const fn expected(&self, withheld: bool) -> Expected {
        self.expected[withheld as usize]
    }

    /// Whether it carries process data and came back as it should, as the last time.
    #[inline]
    pub(super) fn is_usual(&self, withheld: bool, wkc: WorkingCounter) -> bool {
        self.role == Role::ProcessData && self.told.is_none() && self.expected(withheld).fits(wkc)
    }

    /// It came back as it should: its inputs are taken over.
    #[inline]
    pub(super) fn take(&mut self, now: Instant, frame: &[u8], inputs: &mut [u8]) {
        run::take(&self.inputs, frame, inputs);
        self.good = true;
        self.good_at = Some(now);
        self.receipts += 1;
    }

    /// Tells that it comes back as it should again.
    #[cold]
    pub(super) fn tell_good(&mut self, place: Place, events: &mut impl FnMut(Event)) {
        self.told = None;
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
        let Place { task, frame, datagram } = place;
        let expected = self.expected(withheld);
        let expected = received.clamp(expected.least, expected.most);
        events(Event::WorkingCounter { task, frame, datagram, expected, received });
    }

    /// It did not: inputs stay as they were, or become zero, as was chosen.
    #[cold]
    pub(super) fn refuse(&mut self, inputs: &mut [u8]) {
        self.good = false;
        run::clear_image(&self.cleared, inputs);
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
