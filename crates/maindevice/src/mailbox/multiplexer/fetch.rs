//! Fetching of messages, and of those again whose frames were lost.
//!
//! Reference: S1 8.2 (repeat), ETG.1000.4: the MainDevice turns a bit of SyncManager 1; the SubDevice puts the message in
//! again that was fetched last, takes out the next one for that, and turns its bit, too.

use linesman_proto::mailbox::{Counter, Header};
use linesman_proto::register::{SmActivate, SmPdiControl};
use linesman_proto::time::Span;

use super::{FIRST_POLL, IN, Multiplexer, byte_of};
use crate::exchange::{ExchangeError, Request};

const ACTIVATE_AT: u16 = 6;
const PDI_CONTROL_AT: u16 = 7;
const REPEAT_LIMIT: Span = Span::ms(100);

impl Multiplexer {
    /// The message in the mailbox, if there is a new one.
    pub(super) async fn fetch(&mut self) -> Result<Option<Vec<u8>>, ExchangeError> {
        if self.repetition_due {
            self.fetch_again().await?;
        }
        // What the cycle has seen need not be asked for, nor what a fragment's frame has told.
        let is_told = self.holds.take() == Some(true);
        let is_seen = self.queues.take_full(self.id);
        if !is_told && !is_seen && !self.is_full(IN).await? {
            return Ok(None);
        }
        let area = self.areas.send;
        let mut uncertain = false;
        for _ in 0..3 {
            let read = Request::read(self.target, area.offset, area.size);
            match self.wire.submit(read).await {
                Ok(reply) if reply.answered() => {
                    let counter = Header::parse(&reply.data).map(|header| header.counter);
                    let counter = counter.unwrap_or_default();
                    // Only after a repeated fetch can it be one that we have had: a SubDevice that
                    // does not count on is understood all the same.
                    let again = std::mem::take(&mut self.fetched_again);
                    if again && counter.repeats(self.received) {
                        return Ok(None);
                    }
                    self.missing |= uncertain && counter.skips(self.received);
                    (self.received, self.first_is_due) = (counter, false);
                    return Ok(Some(reply.data.into_vec()));
                }
                Ok(_) => return Ok(None),
                Err(error @ ExchangeError::WorkingCounter { .. }) => return Err(error),
                // The frame got lost on its way there or back.
                Err(ExchangeError::NoReply { .. }) => {
                    uncertain = true;
                    self.repetition_due = true;
                    self.fetch_again().await?;
                }
            }
        }
        Ok(None)
    }

    /// Makes sure that a message is not missed whose frame was lost. What is in the mailbox now is the
    /// same one or the next one, which only counters tell apart: a SubDevice that counts puts the one
    /// before in again in either case, and takes out the next one for it. While nothing is known of its
    /// counters it is asked only where the mailbox is empty: otherwise it might repeat what somebody else
    /// has fetched.
    async fn fetch_again(&mut self) -> Result<(), ExchangeError> {
        let known = self.received != Counter::NONE || self.first_is_due;
        if known && self.repeats_on_request || !self.is_full(IN).await? {
            self.repetitions = self.repetitions.wrapping_add(1);
            self.fetched_again = true;
            self.repeats_on_request = self.ask_for_repetition().await?;
        }
        self.repetition_due = false;
        Ok(())
    }

    /// Asks the SubDevice to put the last message in again. True once it says that it has.
    async fn ask_for_repetition(&self) -> Result<bool, ExchangeError> {
        let at = byte_of(IN, ACTIVATE_AT);
        let reply = self.wire.read_one(self.target, at, 1).await?;
        let activate = SmActivate(reply.bytes::<1>(0)[0]);
        let asked = !activate.repeat_request();
        let toggled = activate.with_repeat_request(asked);
        self.wire.write_one(self.target, at, &[toggled.0]).await?;
        let until = self.wire.now() + REPEAT_LIMIT;
        while self.wire.now() < until {
            let reply = self.wire.read_one(self.target, byte_of(IN, PDI_CONTROL_AT), 1).await?;
            let acknowledged = SmPdiControl(reply.bytes::<1>(0)[0]).repeat_acknowledge();
            if acknowledged == asked {
                return Ok(true);
            }
            self.wire.sleep(FIRST_POLL).await;
        }
        Ok(false)
    }
}
