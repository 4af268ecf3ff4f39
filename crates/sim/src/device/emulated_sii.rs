//! A device whose processor plays the EEPROM of its controller.
//!
//! Read first: S1 11.2.4 (EEPROM emulation). Everything else it leaves to the firmware it wraps.

use linesman_proto::mailbox::coe::Emergency;
use linesman_proto::register::SiiCommand;
use linesman_proto::sii::word;
use linesman_proto::time::{Instant, Span};

use super::application_layer::Refusal;
use super::firmware::{Firmware, SampleAgain};
use super::signal::{SignalId, Signals};
use super::software_fault::SoftwareFault;
use crate::controller::{Pdi, SiiRequest, SyncSignal};

/// How long the processor takes for a request: an interrupt and a copy.
pub const EMULATION_TIME: Span = Span::us(30);
/// A word that was never written.
const BLANK: u8 = 0xFF;

/// A firmware with the SII in its own memory.
#[derive(Debug)]
pub struct EmulatedSii {
    inner: Box<dyn Firmware>,
    image: Vec<u8>,
    answers_at: Option<Instant>,
    wakes_at: Option<Instant>,
}

impl EmulatedSii {
    /// `inner` with an SII of this content, which a MainDevice may change.
    #[must_use]
    pub fn new(inner: Box<dyn Firmware>, image: Vec<u8>) -> Self {
        Self { inner, image, answers_at: None, wakes_at: None }
    }

    fn words(&self, word: u32) -> [u8; 8] {
        let start = (word as usize).saturating_mul(2);
        std::array::from_fn(|offset| {
            start.checked_add(offset).and_then(|at| self.image.get(at)).copied().unwrap_or(BLANK)
        })
    }

    fn answer(&mut self, request: SiiRequest, pdi: &mut Pdi<'_>) {
        match request.command {
            SiiCommand::Read => pdi.answer_sii(Some(&self.words(request.word))),
            SiiCommand::Reload => {
                let alias = word::STATION_ALIAS.byte() / 2;
                pdi.answer_sii(Some(&self.words(alias as u32)));
            }
            SiiCommand::Write => {
                let start = (request.word as usize).saturating_mul(2);
                match self.image.get_mut(start..).and_then(|rest| rest.first_chunk_mut::<2>()) {
                    Some(slot) => {
                        *slot = request.value.to_le_bytes();
                        pdi.answer_sii(Some(&[]));
                    }
                    // Behind its memory it refuses.
                    None => pdi.answer_sii(None),
                }
            }
            SiiCommand::None | SiiCommand::Reserved(_) => pdi.answer_sii(None),
        }
    }
}

impl Firmware for EmulatedSii {
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        (self.answers_at, self.wakes_at) = (None, None);
        let words = self.words((word::STATION_ALIAS.byte() / 2) as u32);
        pdi.set_station_alias(u16::from_le_bytes([words[0], words[1]]));
        self.inner.start(now, pdi);
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        match (pdi.sii_request(), self.answers_at) {
            (Some(request), Some(at)) if at <= now => {
                self.answers_at = None;
                self.answer(request, pdi);
            }
            (Some(_), None) => self.answers_at = Some(now + EMULATION_TIME),
            (Some(_), Some(_)) => {}
            (None, _) => self.answers_at = None,
        }
        // It is called for events that are its own, too: one call more does no harm to the inner.
        self.wakes_at = self.inner.run(now, pdi);
        self.answers_at.into_iter().chain(self.wakes_at).min()
    }

    fn emulates_sii(&self) -> bool {
        true
    }

    fn samples(&self) -> bool {
        self.inner.samples()
    }

    fn sample(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.inner.sample(now, pdi);
    }

    fn sample_again(&self, pdi: &Pdi<'_>) -> SampleAgain {
        self.inner.sample_again(pdi)
    }

    fn listens_to(&self) -> Vec<SignalId> {
        self.inner.listens_to()
    }

    fn slow_down(&mut self, takes: Option<Span>) {
        self.inner.slow_down(takes);
    }

    fn read_sii(&mut self) {
        self.inner.read_sii();
    }

    fn synchronises(&self) -> bool {
        self.inner.synchronises()
    }

    fn sync(&mut self, signal: SyncSignal, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        self.inner.sync(signal, now, pdi)
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.inner.refuse(refusal);
    }

    fn report(&mut self, emergency: Emergency) {
        self.inner.report(emergency);
    }

    fn has_processor(&self) -> bool {
        self.inner.has_processor()
    }

    fn has_mailbox(&self) -> bool {
        self.inner.has_mailbox()
    }

    fn software_fault(&mut self, software_fault: SoftwareFault, begins: bool) {
        self.inner.software_fault(software_fault, begins);
    }

    fn reboot(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.answers_at = None;
        self.inner.reboot(now, pdi);
    }

    fn identify(&mut self, id: u16, signals: &mut Signals) -> bool {
        self.inner.identify(id, signals)
    }

    fn stop(&mut self, signals: &mut Signals) {
        self.inner.stop(signals);
    }
}
