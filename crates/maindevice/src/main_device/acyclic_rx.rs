//! Acyclic receive path: frames of procedures, copies of a ring, late ones, strays.

use linesman_proto::address::Path;
use linesman_proto::time::Instant;

use super::MainDevice;
use crate::event::Event;
use crate::exchange::{Purpose, Received};
use crate::executor::lock;

impl MainDevice {
    /// A frame that is not a cyclic one as it comes back nearly always.
    #[inline(never)]
    pub(super) fn receive_unusual(&mut self, now: Instant, path: Path, frame: &[u8]) {
        let received = self.exchange.receive(now, path, frame);
        if let Received::Complete(slot) = received {
            self.statistics.frames_received += 1;
            self.complete(now, slot, frame);
        } else {
            self.receive_other(now, received, frame);
        }
        if self.options.ring {
            self.watch_ring();
        }
    }

    /// A frame with which no slot is complete.
    fn receive_other(&mut self, now: Instant, received: Received, frame: &[u8]) {
        match received {
            Received::Spare(slot) => {
                self.statistics.frames_spare += 1;
                self.complete_spare(now, slot, frame);
            }
            Received::Stray => self.statistics.frames_stray += 1,
            Received::Truncated => self.statistics.frames_truncated += 1,
            Received::FirstCopy => self.statistics.frames_received += 1,
            Received::Late => self.statistics.frames_late += 1,
            Received::Duplicate => self.statistics.frames_duplicate += 1,
            Received::Foreign => self.statistics.frames_foreign += 1,
            Received::Echo | Received::Complete(_) => {}
        }
    }

    fn watch_ring(&mut self) {
        let ring_intact = self.exchange.ring_intact();
        let mut shared = self.executor.shared();
        if shared.ring_intact != ring_intact {
            shared.ring_intact = ring_intact;
            if let Some(intact) = ring_intact {
                shared.events.push_back(Event::Ring { intact });
                drop(shared);
                self.executor.note_event();
                if let Some(running) = self.running.as_ref().filter(|_| intact) {
                    lock(&running.device_table).note_ring_whole();
                }
            }
        }
    }

    /// One more copy of a cyclic frame: taken only when the first was not good.
    fn complete_spare(&mut self, now: Instant, slot: u8, last: &[u8]) {
        let Purpose::Cyclic { frame } = self.exchange.slot(slot).purpose else { return };
        let Some(running) = &mut self.running else { return };
        if !self.options.ring && running.cyclic.is_bad(frame) {
            let withheld = self.exchange.slot(slot).withheld;
            let (executor, statistics) = (&self.executor, &mut self.statistics);
            let emit = &mut |event| executor.emit(event);
            running.cyclic.judge(now, frame, withheld, last, statistics, emit);
        }
    }
}
