//! States of one controller over time, and the errors it signalled.

use std::collections::VecDeque;

use linesman_proto::register::{AlControl, AlStatus};
use linesman_proto::state::{AlState, AlStatusCode, StateTimeouts, StateValue};
use linesman_proto::time::{Instant, Span};

use super::{Seen, push_kept};

/// States over time.
#[derive(Clone, Default, Debug)]
pub struct AlHistory {
    /// AL status (0x0130) as last read.
    pub status: Option<Seen<AlStatus>>,
    /// AL status code (0x0134) as last read.
    pub code: Option<Seen<AlStatusCode>>,
    /// Time of the latest reading of AL status, whether or not it was news.
    pub latest_reading: Option<Instant>,
    /// The lowest state that was asked for and not reached yet.
    lowest_asked: Option<AlState>,
    /// The state last asked for (0x0120).
    pub requested: Option<Seen<StateValue>>,
    /// The highest state it was ever seen in.
    pub highest: Option<AlState>,
    /// Changes of status, oldest first, at most [`CHANGES_KEPT`](super::CHANGES_KEPT).
    pub changes: VecDeque<AlChange>,
    /// All changes, also those forgotten.
    pub change_count: u64,
    /// Errors it signalled, oldest first, at most [`CHANGES_KEPT`](super::CHANGES_KEPT).
    pub errors: VecDeque<AlError>,
    /// Whether it was in the state last asked for, without error, since it was asked.
    pub has_arrived: bool,
    /// Requests for a state and how they fared, oldest first: the latest, and at most
    /// [`CHANGES_KEPT`](super::CHANGES_KEPT) that waited longer than a step may take.
    pub requests: VecDeque<StateRequest>,
    /// The latest order back to INIT in a higher state and without an error that was read.
    pub sent_back: Option<Seen<()>>,
    /// The latest order that acknowledges an error though none was read, for a state in which it was or that is lower.
    pub acknowledged: Option<Seen<()>>,
    /// The latest request that the controller did not take (working counter 0): its processor had not fetched the one
    /// before.
    pub untaken: Option<Seen<StateValue>>,
}

/// A request for a state, and those that followed it before the controller moved.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StateRequest {
    /// The first one, written to AL control (0x0120).
    pub asked: Seen<StateValue>,
    /// The state that was asked for last.
    pub to: AlState,
    /// The state in which it was, and stays.
    pub from: AlState,
    /// How often it was asked.
    pub times: u32,
    /// How often its controller did not take the request, because the one before was not fetched yet
    /// (working counter 0).
    pub untaken: u32,
    /// How often AL status was read since and showed nothing new.
    pub polls: u32,
    /// When it was last read so.
    pub polled: Option<Seen<()>>,
    /// When AL status changed: it had heard.
    pub ended: Option<Instant>,
}

impl StateRequest {
    /// Nobody is late by less, whatever the step: requests are looked after in turns.
    const LEAST: Span = Span::s(1);

    /// For how long AL status has been seen not to move.
    #[must_use]
    pub fn waited(&self) -> Span {
        self.polled.map_or(Span::ZERO, |polled| polled.at.since(self.asked.at))
    }

    /// How long the step may take at most.
    #[must_use]
    pub fn limit(&self) -> Span {
        let to = self.asked.value.state().unwrap_or(self.to);
        StateTimeouts::DEFAULT.of(self.from, to).max(Self::LEAST)
    }

    /// Whether it has not been answered for longer than the step may take.
    #[must_use]
    pub fn is_overdue(&self) -> bool {
        self.waited() >= self.limit()
    }
}

/// An error that a controller signalled in AL status.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AlError {
    /// AL status with the error bit, when it was first read.
    pub status: Seen<AlStatus>,
    /// The code, as far as it was read while the error stood.
    pub code: Option<Seen<AlStatusCode>>,
    /// Whether the code was read while the error stood, and was 0.
    pub has_no_code: bool,
    /// The state before; `None` when none was read.
    pub from: Option<AlState>,
    /// The state asked for at that time.
    pub requested: Option<Seen<StateValue>>,
    /// Whether it had been in the state asked for: then it left it by itself, else it refused.
    pub had_arrived: bool,
    /// When the error was gone.
    pub ended: Option<Instant>,
}

impl AlError {
    /// Whether it stood already when its controller was first read, and nobody had asked for anything yet.
    #[must_use]
    pub const fn was_left_over(&self) -> bool {
        self.from.is_none() && self.requested.is_none()
    }

    /// Whether the bit may be the acknowledgement that a MainDevice writes with each request: a SubDevice whose
    /// controller emulates the device copies AL control to AL status, error bit and all, and has no AL status code
    /// (register 0x0140 bit 8). Only one that stood from the first reading on, so that nobody saw it come; and where
    /// nobody has read the code, only in OP, which an error of its own would have taken it out of.
    #[must_use]
    pub fn may_be_echo(&self) -> bool {
        let is_op = self.status.value.state().state() == Some(AlState::Op);
        self.was_left_over() && self.code.is_none() && (self.has_no_code || is_op)
    }

    /// Whether the watchdog of its outputs may have expired: its code says so (0x001B), or nobody has read the code and it
    /// is in SAFEOP, where an expired watchdog takes it to.
    #[must_use]
    pub fn may_be_watchdog(&self) -> bool {
        match self.code {
            Some(code) => code.value == AlStatusCode::SYNC_MANAGER_WATCHDOG,
            None => !self.has_no_code && self.status.value.state().state() == Some(AlState::SafeOp),
        }
    }
}

/// A change of AL status.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AlChange {
    /// As it was.
    pub from: AlStatus,
    /// As it is then.
    pub to: AlStatus,
    /// When it was last read as it was.
    pub after: Instant,
    /// When, by which frame.
    pub at: Instant,
    /// The number of the frame that showed it.
    pub frame: Option<u64>,
    /// The state asked for at that time, where a request was seen.
    pub requested: Option<AlState>,
    /// The lowest state that was asked for before that and not reached.
    pub lowest_asked: Option<AlState>,
}

impl AlChange {
    /// Whether it went to a lower state though nobody asked for one, and without an error.
    #[must_use]
    pub fn is_own_fall(&self) -> bool {
        let (from, to) = (self.from.state().state(), self.to.state().state());
        let (Some(from), Some(to)) = (from, to) else { return false };
        let was_asked = self.requested.is_none_or(|requested| requested < from)
            || self.lowest_asked.is_some_and(|asked| asked < from);
        to < from && !was_asked && !self.to.error()
    }
}

impl AlHistory {
    /// Takes a reading of AL status. Says whether it is news.
    pub fn record_status(&mut self, status: AlStatus, at: Instant, frame: Option<u64>) -> bool {
        let after = self.latest_reading.unwrap_or(at);
        let lowest_asked = self.lowest_asked;
        if status.state().state() <= lowest_asked {
            self.lowest_asked = None;
        }
        self.latest_reading = self.latest_reading.max(Some(at));
        let was_overdue = self.record_answer(status, Seen::new((), at, frame));
        self.record_error(status, at, frame);
        let before = self.status.replace(Seen::new(status, at, frame));
        self.highest = self.highest.max(status.state().state());
        let Some(before) = before else { return true };
        if before.value == status {
            // The first sighting is the evidence, not the thousandth.
            self.status = Some(before);
            return was_overdue;
        }
        self.change_count += 1;
        let requested = self.requested.and_then(|requested| requested.value.state());
        push_kept(
            &mut self.changes,
            AlChange { from: before.value, to: status, after, at, frame, requested, lowest_asked },
        );
        true
    }

    /// AL status was read: an answer to what was asked is whatever is new in it. Says whether somebody has
    /// just waited too long.
    fn record_answer(&mut self, status: AlStatus, seen: Seen<()>) -> bool {
        let Some(open) = self.requests.back_mut().filter(|request| request.ended.is_none()) else {
            return false;
        };
        if status.error() || status.state().state() != Some(open.from) {
            open.ended = Some(seen.at);
            return false;
        }
        let was_overdue = open.is_overdue();
        open.polls = open.polls.saturating_add(1);
        open.polled = Some(seen);
        !was_overdue && open.is_overdue()
    }

    /// A state is asked for in which it is not. What it is told while it signals an error is for that.
    fn note_request(&mut self, requested: Seen<StateValue>, was_taken: bool) {
        let (Some(from), Some(to)) = (self.state(), requested.value.state()) else { return };
        if to == from {
            // Who was to go lower, and is where it is to be again, is waited for no longer.
            if let Some(open) = self.requests.back_mut().filter(|open| open.to < open.from) {
                open.ended.get_or_insert(requested.at);
            }
            return;
        }
        if self.has_error() {
            return;
        }
        let untaken = u32::from(!was_taken);
        match self.requests.back_mut() {
            Some(open) if open.ended.is_none() => {
                open.times = open.times.saturating_add(1);
                open.untaken = open.untaken.saturating_add(untaken);
                open.to = to;
                return;
            }
            Some(last) if !last.is_overdue() => {
                self.requests.pop_back();
            }
            Some(_) | None => {}
        }
        let (polled, ended) = (None, None);
        let new =
            StateRequest { asked: requested, to, from, times: 1, untaken, polls: 0, polled, ended };
        push_kept(&mut self.requests, new);
    }

    /// Whether the error bit is but an echo: a controller without a processor behind it copies AL
    /// control to AL status, with the bit that acknowledges errors. An error of its own would keep
    /// a SubDevice from the state asked for.
    fn is_echo(&self, status: AlStatus) -> bool {
        match self.requested {
            Some(requested) => requested.value == status.state(),
            // Nobody was seen asking: a MainDevice that starts does so with INIT and acknowledge.
            None => status.state().state() == Some(AlState::Init),
        }
    }

    fn record_error(&mut self, status: AlStatus, at: Instant, frame: Option<u64>) {
        // What a code belongs to is no echo, and goes on for as long as the bit does.
        let goes_on = self.has_error_with_code() && self.state_bits() == Some(status.0);
        let is_error = status.error() && (goes_on || !self.is_echo(status));
        let open = self.errors.back_mut().filter(|error| error.ended.is_none());
        if !is_error {
            if let Some(error) = open {
                error.ended = Some(at);
            }
            let requested = self.requested.map(|requested| requested.value);
            self.has_arrived |= requested == Some(status.state());
            return;
        }
        if open.is_some() {
            return;
        }
        let from = self.status.and_then(|status| status.value.state().state());
        self.push_error(Seen::new(status, at, frame), from);
        // The code is read after the status; what was read earlier is about something else.
        self.code = None;
    }

    fn push_error(&mut self, status: Seen<AlStatus>, from: Option<AlState>) {
        push_kept(
            &mut self.errors,
            AlError {
                status,
                code: None,
                has_no_code: false,
                from,
                requested: self.requested,
                had_arrived: self.has_arrived,
                ended: None,
            },
        );
    }

    /// Whether the error that stands since `since` was acknowledged already.
    fn is_acknowledged(&self, since: Instant) -> bool {
        self.errors.back().is_some_and(|error| error.status.at >= since && error.ended.is_some())
    }

    fn has_error_with_code(&self) -> bool {
        self.errors.back().is_some_and(|error| error.ended.is_none() && error.code.is_some())
    }

    fn state_bits(&self) -> Option<u16> {
        Some(self.status?.value.0)
    }

    /// Takes a write to AL control.
    pub fn record_request(&mut self, control: AlControl, requested: Seen<StateValue>) {
        if control.acknowledges_error()
            && let Some(error) = self.errors.back_mut()
        {
            error.ended.get_or_insert(requested.at);
        }
        let asked = requested.value.state();
        if asked == Some(AlState::Init)
            && self.errors.is_empty()
            && self.state().is_some_and(|state| state.has_mailbox())
        {
            self.sent_back = Some(Seen::new((), requested.at, requested.frame));
        }
        // In INIT each start of a MainDevice acknowledges what may stand from before.
        let was_up = self.highest.is_some_and(AlState::has_mailbox);
        let is_no_step_up = was_up && asked.is_some() && asked <= self.highest;
        if control.acknowledges_error() && self.errors.is_empty() && is_no_step_up {
            self.acknowledged = Some(Seen::new((), requested.at, requested.frame));
        }
        self.lowest_asked = match (self.lowest_asked, asked) {
            (Some(one), Some(other)) => Some(one.min(other)),
            (one, other) => one.or(other),
        };
        let is_new = self.requested.is_none_or(|known| known.value != requested.value);
        if is_new {
            self.has_arrived = false;
        }
        self.requested = Some(requested);
        self.note_request(requested, true);
    }

    /// AL control was written, and the controller did not take it: its processor has not fetched what was
    /// written before. Reference: S2, AL control; the register can be written once until it was read.
    pub fn record_untaken(&mut self, requested: Seen<StateValue>) {
        self.untaken = Some(requested);
        self.note_request(requested, false);
    }

    /// Whether the MainDevice asked for a state without process data.
    #[must_use]
    pub fn is_asked_down(&self) -> bool {
        let requested = self.requested.and_then(|requested| requested.value.state());
        requested.is_some_and(|state| !state.has_inputs())
    }

    /// Whether it is in OP for all that was seen: neither read in another state, nor asked for one.
    #[must_use]
    pub fn may_be_in_op(&self) -> bool {
        let is_op = |state: Option<AlState>| state == Some(AlState::Op);
        self.status.is_none_or(|status| is_op(status.value.state().state()))
            && self.requested.is_none_or(|requested| is_op(requested.value.state()))
    }

    /// Whether it signals an error now.
    #[must_use]
    #[inline]
    pub fn has_error(&self) -> bool {
        self.errors.back().is_some_and(|error| error.ended.is_none())
    }

    /// Whether it signals an error now, other than an acknowledgement that it may have copied.
    #[must_use]
    pub fn has_own_error(&self) -> bool {
        self.errors.back().is_some_and(|error| error.ended.is_none() && !error.may_be_echo())
    }

    /// Takes a reading of AL status code. Says whether it is news.
    pub fn record_code(&mut self, code: AlStatusCode, at: Instant, frame: Option<u64>) -> bool {
        if let Some(error) = self.errors.back_mut().filter(|error| error.ended.is_none()) {
            error.has_no_code |= code.0 == 0;
        }
        if self.code.is_some_and(|known| known.value == code) {
            return false;
        }
        let seen = Seen::new(code, at, frame);
        self.code = Some(seen);
        // An error bit that was taken for an echo: whoever has a code for it means it.
        if let Some(status) = self.status.filter(|status| status.value.error())
            && code.0 != 0
            && !self.has_error()
            && !self.is_acknowledged(status.at)
        {
            let from = self.changes.back().and_then(|change| change.from.state().state());
            self.push_error(status, from);
        }
        if code.0 != 0
            && let Some(error) = self.errors.back_mut()
            && error.ended.is_none()
        {
            error.code.get_or_insert(seen);
        }
        true
    }

    /// True if this state was read last.
    #[must_use]
    #[inline]
    pub fn is_in(&self, state: AlState) -> bool {
        self.status.is_some_and(|status| status.value.0 & 0x0F == u16::from(state.bits()))
    }

    /// True if this state was read last, without the error bit, and no error stands: nothing but news changes that.
    #[must_use]
    pub(super) fn is_calm_in(&self, state: AlState) -> bool {
        let has_bit = self.status.is_some_and(|status| status.value.error());
        self.is_in(state) && !has_bit && !self.has_error()
    }

    /// The state, where one was read and it names one.
    #[must_use]
    #[inline]
    pub fn state(&self) -> Option<AlState> {
        self.status?.value.state().state()
    }
}
