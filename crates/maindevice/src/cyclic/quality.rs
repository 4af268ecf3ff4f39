//! Quality and age of the process data of a SubDevice; status of each frame that came back.

use linesman_config::plan::Plan;
use linesman_config::plan::expect::Presence;
use linesman_proto::address::DeviceId;
use linesman_proto::sii::Direction;
use linesman_proto::time::{Instant, Span};

use super::Cyclic;
use super::frame_batch::BatchFrame;

/// The process data of one SubDevice as the application sees them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Quality {
    /// Every datagram with its data came back with the right working counter the last time, and it
    /// is known to take part: inputs are of the last cycle, outputs have arrived. False does not say
    /// that this SubDevice is at fault: a datagram is shared with others (PLC-04).
    pub valid: bool,
    /// When its inputs were taken over last; `None`: never, or it has none.
    pub updated_at: Option<Instant>,
}

impl Quality {
    /// How old its inputs are at `now`; `None` when there never were any.
    #[must_use]
    pub fn age(&self, now: Instant) -> Option<Span> {
        self.updated_at.map(|at| now.since(at))
    }
}

/// How a cyclic frame went the last time: bit *n* is its datagram *n*, for the first fifteen
/// (PLC-02, PLC-08).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct FrameStatus {
    /// Its outputs were withheld; bit 15: the frame was not sent at all.
    pub not_sent: u16,
    /// Its working counter was wrong; bit 15: the whole frame did not come back.
    pub wrong_counter: u16,
    /// Turned over with each good answer.
    pub input_toggle: u16,
}

impl FrameStatus {
    /// The bit that stands for the whole frame.
    pub const WHOLE: u16 = 0x8000;

    /// The bit of a datagram, counted from 0; none for those behind the fifteenth.
    #[must_use]
    pub const fn bit(datagram: usize) -> u16 {
        if datagram < 15 { 1 << datagram } else { 0 }
    }

    /// The bits of all datagrams before this one.
    #[must_use]
    pub const fn before(datagram: usize) -> u16 {
        if datagram < 15 { (1 << datagram) - 1 } else { Self::WHOLE - 1 }
    }
}

impl Cyclic {
    /// How good the process data of a SubDevice are.
    pub(crate) fn quality(&self, id: DeviceId) -> Quality {
        let Some(share) = self.shares.get(id.index()) else { return Quality::default() };
        share.quality(&self.least, id, |frame, at| {
            let datagram = self.frames.get(frame).and_then(|frame| frame.datagrams.get(at));
            datagram.map_or((false, None, 0), |one| (one.good, one.good_at(), one.receipts))
        })
    }

    /// How a frame of a task went the last time.
    pub(crate) fn frame_status(&self, task: usize, number: usize) -> Option<FrameStatus> {
        let frame = self.frames.iter().find(|one| one.task == task && one.number == number);
        frame.map(|frame| frame.status)
    }
}

/// What is remembered of each SubDevice beside its datagrams.
#[derive(Clone, Debug, Default)]
pub(super) struct Share {
    /// The datagrams with its data, by frame and place in it, and whether inputs are among them.
    pub(super) datagrams: Vec<(usize, usize, bool)>,
    /// When its inputs were last good before it stopped to give any.
    frozen_at: Option<Instant>,
    /// Receipts of its first datagram with inputs when it began to take part.
    joined: u64,
    serving: bool,
}

/// Who has a share in which datagrams of the frames in this order, by [`DeviceId`].
pub(super) fn shares(plan: &Plan, order: &[BatchFrame]) -> Vec<Share> {
    let mut shares = vec![Share::default(); plan.devices.len()];
    // The first datagram with inputs is that of the first frame as planned.
    let mut frames: Vec<(usize, &BatchFrame)> = order.iter().enumerate().collect();
    frames.sort_by_key(|(_, one)| one.planned);
    for (frame, one) in frames {
        let planned = &plan.tasks[one.task].frames[one.number];
        for (at, datagram) in planned.datagrams.iter().enumerate() {
            for owned in &datagram.ownership {
                let Some(share) = shares.get_mut(owned.device.index()) else { continue };
                let inputs = owned.direction == Direction::Inputs;
                match share.datagrams.iter_mut().find(|one| (one.0, one.1) == (frame, at)) {
                    Some(one) => one.2 |= inputs,
                    None => share.datagrams.push((frame, at, inputs)),
                }
            }
        }
    }
    shares
}

impl Share {
    /// Takes over whether the SubDevice gives its data; `last` is its first datagram with inputs:
    /// when it was good, and how often. Returns whether it has just stopped.
    pub(super) fn serve(&mut self, serving: bool, last: Option<(Option<Instant>, u64)>) -> bool {
        let before = std::mem::replace(&mut self.serving, serving);
        let (at, receipts) = last.unwrap_or_default();
        if serving && !before {
            self.joined = receipts;
        }
        if before && !serving {
            if receipts > self.joined {
                self.frozen_at = at;
            }
            return true;
        }
        false
    }

    /// How it is; `of` gives of a datagram whether it was good, when, and how often.
    pub(super) fn quality(
        &self,
        present: &Presence,
        id: DeviceId,
        of: impl Fn(usize, usize) -> (bool, Option<Instant>, u64),
    ) -> Quality {
        // Who has no process data has none that could be wrong.
        if self.datagrams.is_empty() {
            return Quality { valid: true, updated_at: None };
        }
        let mut valid = self.serving && present.of(id).reached_by.is_some();
        let mut updated_at = None;
        for (frame, at, inputs) in &self.datagrams {
            let (good, good_at, receipts) = of(*frame, *at);
            valid &= good;
            if *inputs && updated_at.is_none() {
                let since = if self.serving && receipts > self.joined { good_at } else { None };
                updated_at = Some(since.or(self.frozen_at));
                valid &= since.is_some();
            }
        }
        Quality { valid, updated_at: updated_at.flatten() }
    }
}
