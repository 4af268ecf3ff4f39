//! Process data as SOEM exchanges them: an LRW over all, in as many frames as it takes, with the time of the leading
//! clock in the first; what comes back lies where it was sent from, and goes out again in the next cycle.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use linesman_maindevice::{DatagramData, Departure, Request, Target};
use linesman_proto::address::LogicalAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::time::{Instant, Span};

use super::bus::{Bus, RETURN};
use super::mapping::Image;

/// What the exchange and those who look at it share.
#[derive(Default)]
pub(super) struct Exchanged {
    /// Outputs, then inputs.
    pub(super) bytes: Vec<u8>,
    pub(super) outputs: usize,
    /// Working counters of the last cycle together; 0 when nothing came back.
    pub(super) wkc: u32,
}

/// The process image.
#[derive(Clone, Default)]
pub(super) struct Shared(Arc<Mutex<Exchanged>>);

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, Exchanged> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The exchange.
pub(super) struct ProcessData {
    bus: Bus,
    shared: Shared,
    image: Image,
    cycle: Span,
    /// The clock that leads.
    leader: Option<Target>,
    /// Frames follow its time.
    follows: bool,
    time: u64,
    integral: i64,
}

impl ProcessData {
    pub(super) fn new(
        bus: &Bus,
        shared: &Shared,
        image: Image,
        cycle: Span,
        leader: Option<Target>,
        follows: bool,
    ) -> Self {
        let bytes = vec![0; image.len];
        *shared.lock() = Exchanged { bytes, outputs: image.outputs, wkc: image.expected };
        Self {
            bus: bus.clone(),
            shared: shared.clone(),
            image,
            cycle,
            leader,
            follows,
            time: 0,
            integral: 0,
        }
    }

    /// Exchanges in each cycle, without end.
    pub(super) async fn run(mut self) {
        let mut due = self.bus.now();
        loop {
            self.bus.sleep_until(due).await;
            self.exchange().await;
            // What was missed is not made up for.
            due = self.next(due).max(self.bus.now());
        }
    }

    async fn exchange(&mut self) {
        let segments = self.image.segments.clone();
        let mut out = Vec::with_capacity(segments.len());
        for (at, segment) in segments.into_iter().enumerate() {
            let data = self.shared.lock().bytes.get(segment.clone()).map(DatagramData::from_slice);
            let mut requests = vec![Request {
                command: Command::Lrw,
                address: DatagramAddress::Logical(LogicalAddress(segment.start as u32)),
                data: data.unwrap_or_default(),
                card: None,
                repeats: 0,
                departure: Departure::Together,
            }];
            requests.extend(self.leader.filter(|_| at == 0).map(|leader| self.time_of(leader)));
            out.push((self.bus.start(&requests), requests, segment));
        }
        let mut wkc = 0;
        for (index, requests, segment) in out {
            let mut replies = self.bus.receive(index, &requests, RETURN).await.into_iter();
            if let Some(reply) = replies.next() {
                wkc += u32::from(reply.wkc.0);
                if let Some(bytes) = self.shared.lock().bytes.get_mut(segment) {
                    bytes.copy_from_slice(&reply.data);
                }
            }
            if let Some(reply) = replies.next() {
                self.time = u64::from_le_bytes(reply.bytes(0));
            }
        }
        self.shared.lock().wkc = wkc;
    }

    fn time_of(&self, leader: Target) -> Request {
        let command = Command::Frmw;
        let write = Request::write(leader, SYSTEM_TIME.address, &self.time.to_le_bytes());
        Request { command, ..write }
    }

    /// When the next cycle begins: where SYNC0 counts, a little sooner or later, so that frames stay half a cycle away
    /// from it (`ec_sync` of SOEM's `red_test`, which stays 50 µs away, less than a computer is late at times).
    fn next(&mut self, due: Instant) -> Instant {
        let next = due + self.cycle;
        let cycle = self.cycle.as_nanos() as i64;
        if !self.follows || self.time == 0 || cycle == 0 {
            return next;
        }
        let mut delta = (self.time as i64).wrapping_sub(cycle / 2) % cycle;
        if delta > cycle / 2 {
            delta -= cycle;
        }
        self.integral += delta.signum();
        let offset = -(delta / 100) - self.integral / 20;
        let span = Span::ns(cycle.saturating_add(offset).max(1).unsigned_abs());
        due + span
    }
}
