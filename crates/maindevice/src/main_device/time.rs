//! Time of the network for programs, and a time outside that they tell.

use std::sync::Arc;

use linesman_proto::time::{DcTime, Instant};

use super::MainDevice;
use crate::cyclic::{OutsideTime, TaskTimes};
use crate::executor::lock;
use crate::network_group::NetworkGroup;
use crate::supervisor::BringUpTimes;

impl MainDevice {
    /// The time of the network at a time of the run (ns since 2000): that which the reference clock has when a frame
    /// is there that leaves at `at`. Before it has told its time, the host's:
    /// [`Options::clock_epoch`](crate::Options::clock_epoch) and what has passed since.
    #[must_use]
    pub fn network_time(&self, at: Instant) -> DcTime {
        let by_host = || DcTime(self.options.clock_epoch.0.wrapping_add(at.as_nanos()));
        let known = self.running.as_ref().and_then(|running| running.cyclic.network_time(at));
        known.unwrap_or_else(by_host)
    }

    /// Times that bringing up the running plan took so far; `None` unless one is running.
    #[must_use]
    pub fn bring_up_times(&self) -> Option<BringUpTimes> {
        self.running.as_ref().and_then(|running| lock(&running.device_table).times().cloned())
    }

    /// The three times of a task at `now`, by [`MainDevice::network_time`]: when its cycle began, the last base tick,
    /// now (DC-08). Without that task all are now.
    #[must_use]
    pub fn task_times(&self, task: usize, now: Instant) -> TaskTimes {
        let begun = self.running.as_ref().and_then(|running| running.cyclic.begun(task, now));
        let (start, tick) = begun.unwrap_or((now, now));
        let [task_start, base_tick, now] = [start, tick, now].map(|at| self.network_time(at));
        TaskTimes { task_start, base_tick, now }
    }

    /// True if this network leads the others of its [`Options::group`](crate::Options::group).
    #[must_use]
    pub const fn leads_group(&self) -> bool {
        self.lead.is_some()
    }

    /// True while a network before it in its group has neither begun nor given up: then it is to wait, if the first is to
    /// lead. Of a group [in order](crate::NetworkGroup::in_order) only.
    #[must_use]
    pub fn waits_for_group(&self) -> bool {
        self.turn.is_some() && self.options.group.as_ref().is_some_and(NetworkGroup::waits)
    }

    /// Lets the networks behind it in its group begin, although it has not started yet: it waits for the time of one of them.
    pub fn give_up_turn(&mut self) {
        self.turn = None;
    }

    /// True if this network is in a group with others.
    #[must_use]
    pub fn is_in_group(&self) -> bool {
        self.options.group.is_some()
    }

    /// True once the network that leads its group has told its time: a network below it that starts now begins in that time.
    #[must_use]
    pub fn knows_group_time(&self) -> bool {
        self.options.group.as_ref().is_some_and(|group| group.is_led() && group.told().is_some())
    }

    /// By how many ns the time of this network is ahead of that of the network that leads its group, as its frames have it;
    /// negative: it is behind. `None` where it leads, follows nobody, or the time of one of both is not known yet.
    #[must_use]
    pub fn ahead_of_group(&self) -> Option<i64> {
        self.running.as_ref()?.cyclic.ahead_of_group()
    }

    /// Tells a time outside of the network, as it was at `at`, where the plan has the network follow a time that a program
    /// tells ([`TimeSource::Program`](linesman_config::plan::TimeSource)). To be told about once a cycle; times that are
    /// off by their jitter are averaged. Told before the start, it is the time that clocks are set to, in place of
    /// [`Options::clock_epoch`](crate::Options::clock_epoch). A time that is within 1 ms of that of the network is taken over
    /// itself, of any other only the speed.
    pub fn tell_outside_time(&mut self, at: Instant, time: DcTime) {
        match &mut self.running {
            Some(running) => running.cyclic.take_outside_time(at, time),
            None => {
                let options = Arc::make_mut(&mut self.options);
                options.clock_epoch = DcTime(time.0.wrapping_sub(at.as_nanos()));
            }
        }
    }

    /// How far the clock outside is ahead that the network follows, as it was last read or told (DC-11); `None` where it
    /// follows none, or nothing is known of it yet.
    #[must_use]
    pub fn outside_time(&self) -> Option<OutsideTime> {
        self.running.as_ref()?.cyclic.outside_time()
    }
}
