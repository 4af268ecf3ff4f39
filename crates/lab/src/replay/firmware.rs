//! The device behind a controller as the recording shows it: how long it takes for a state and for a
//! mailbox message, its dictionary, and inputs that come from outside.
//!
//! States, mailbox and SDO server are those of every device of the segment.

use std::collections::VecDeque;

use linesman_proto::register::{SmDirection, SmMode, SyncManagerConfig};
use linesman_proto::sii::Protocols;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::{Instant, Span};
use linesman_sim::controller::Pdi;
use linesman_sim::device::application_layer::{ApplicationLayer, Refusal};
use linesman_sim::device::dictionary::Dictionary;
use linesman_sim::device::files::Files;
use linesman_sim::device::mailbox::{Mailbox, REQUESTS, Served};
use linesman_sim::device::{Firmware, SignalId, Signals, Troubles};

use super::learn::{AlStep, MailboxTurn};

/// A step that the recording does not show takes this long.
const USUAL_STEP: Span = Span::us(500);
/// A message of which the recording shows nothing.
const USUAL_MESSAGE: MailboxTurn =
    MailboxTurn { taken: Span::us(100), answered: Some(Span::us(600)) };
/// A mailbox takes a message at once when it is told to serve.
const AT_ONCE: Span = Span::ns(1);
/// SyncManagers that are looked at for process data.
const SYNC_MANAGERS: u8 = 16;
/// SyncManager status: the answer was fetched, the next may come.
const LOOK_AGAIN: Span = Span::us(50);

/// A device as it was seen.
#[derive(Debug)]
pub(super) struct Learned {
    application_layer: ApplicationLayer,
    steps: VecDeque<AlStep>,
    step: Option<(Instant, AlStep)>,
    mailbox: Mailbox,
    turns: VecDeque<MailboxTurn>,
    message: Option<Message>,
    dictionary: Dictionary,
    files: Files,
    troubles: Troubles,
    /// One for each byte of its inputs, in the order of SyncManagers.
    inputs: Vec<SignalId>,
    buffer: Vec<u8>,
}

/// A mailbox message that is worked on.
#[derive(Clone, Copy, Debug)]
struct Message {
    take_at: Instant,
    taken: bool,
    answer_at: Option<Instant>,
}

impl Learned {
    pub(super) fn new(
        steps: VecDeque<AlStep>,
        turns: VecDeque<MailboxTurn>,
        dictionary: Dictionary,
        inputs: Vec<SignalId>,
    ) -> Self {
        Self {
            application_layer: ApplicationLayer::new(true),
            steps,
            step: None,
            mailbox: Mailbox::new(AT_ONCE, Protocols(Protocols::COE | Protocols::FOE)),
            turns,
            message: None,
            dictionary,
            files: Files::default(),
            troubles: Troubles::default(),
            inputs,
            buffer: Vec::new(),
        }
    }

    /// The next step as the recording shows it. Steps it shows beyond what is asked for are left out.
    fn next_step(&mut self, to: AlState) -> AlStep {
        let state = to.bits();
        let usual =
            AlStep { requested: state, took: USUAL_STEP, status: u16::from(state), code: 0 };
        match self.steps.iter().position(|step| step.requested == state) {
            Some(at) => self.steps.drain(..=at).next_back().unwrap_or(usual),
            None => usual,
        }
    }

    fn serve_states(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if let Some((due, step)) = self.step
            && due <= now
        {
            self.step = None;
            let StateValue::Known(state) = StateValue::from_bits(step.status as u8) else { return };
            let before = ApplicationLayer::state(pdi);
            if state.has_mailbox() != before.has_mailbox() {
                self.mailbox.restart();
                self.message = None;
            }
            if step.status & 0x10 != 0 {
                ApplicationLayer::fail(pdi, state, AlStatusCode(step.code));
            } else {
                self.application_layer.enter(pdi, state);
            }
        }
        if self.step.is_none()
            && let Some(to) = self.application_layer.take_request(pdi)
        {
            let step = self.next_step(to);
            self.step = Some((now + step.took, step));
        }
    }

    fn serve_mailbox(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        let state = ApplicationLayer::state(pdi);
        if !state.has_mailbox() {
            return None;
        }
        if self.message.is_none() && pdi.mailbox_full(REQUESTS) {
            let turn = self.turns.pop_front().unwrap_or(USUAL_MESSAGE);
            self.message = Some(Message {
                take_at: now + turn.taken,
                taken: false,
                answer_at: turn.answered.map(|span| now + span.max(turn.taken + AT_ONCE)),
            });
        }
        let Some(mut message) = self.message else {
            // Repeats, and messages that wait for room.
            return self.serve(now, pdi);
        };
        if !message.taken {
            if now < message.take_at {
                return Some(message.take_at);
            }
            message.taken = true;
            self.message = Some(message);
            self.serve(now, pdi);
        }
        match message.answer_at {
            Some(at) if at <= now => {
                self.message = None;
                let again = self.serve(now, pdi);
                // The next one may be there already.
                if pdi.mailbox_full(REQUESTS) { Some(now + LOOK_AGAIN) } else { again }
            }
            Some(at) => Some(at),
            None if pdi.mailbox_full(REQUESTS) => {
                self.message = None;
                Some(now + LOOK_AGAIN)
            }
            None => None,
        }
    }

    fn serve(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        let mut served = Served {
            dictionary: &mut self.dictionary,
            files: &mut self.files,
            troubles: &mut self.troubles,
            state: ApplicationLayer::state(pdi),
        };
        self.mailbox.serve(now, pdi, &mut served)
    }

    fn is_ready(pdi: &Pdi<'_>) -> bool {
        pdi.emulates_device() || ApplicationLayer::state(pdi).has_inputs()
    }
}

/// The SyncManagers for inputs that are on, with where each begins among all input bytes.
pub(super) fn input_areas(
    config: impl Fn(u8) -> Option<SyncManagerConfig>,
) -> Vec<(u8, SyncManagerConfig, usize)> {
    let mut areas = Vec::new();
    let mut from = 0;
    for index in 0..SYNC_MANAGERS {
        let Some(manager) = config(index) else { break };
        let reads = manager.control.direction() == SmDirection::MainDeviceReads;
        if manager.is_active() && reads && manager.control.mode() == SmMode::Buffered {
            areas.push((index, manager, from));
            from += usize::from(manager.length);
        }
    }
    areas
}

impl Firmware for Learned {
    fn start(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {
        self.mailbox.restart();
        self.step = None;
        self.message = None;
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        pdi.take_activation_event();
        if !pdi.emulates_device() {
            self.serve_states(now, pdi);
        }
        for index in 2..SYNC_MANAGERS {
            let Some(manager) = pdi.sync_manager(index) else { break };
            if manager.is_active() && manager.control.mode() == SmMode::Buffered {
                self.buffer.resize(usize::from(manager.length), 0);
                let mut buffer = std::mem::take(&mut self.buffer);
                pdi.read_sync_manager(index, &mut buffer);
                self.buffer = buffer;
            }
        }
        let mailbox = self.serve_mailbox(now, pdi);
        let step = self.step.map(|(due, _)| due);
        [mailbox, step].into_iter().flatten().min()
    }

    fn samples(&self) -> bool {
        !self.inputs.is_empty()
    }

    fn sample(&mut self, _now: Instant, pdi: &mut Pdi<'_>) {
        if !Self::is_ready(pdi) {
            return;
        }
        for (index, manager, from) in input_areas(|index| pdi.sync_manager(index)) {
            let len = usize::from(manager.length);
            self.buffer.clear();
            self.buffer.extend((from..from + len).map(|at| {
                self.inputs.get(at).map_or(0, |signal| pdi.signals().value(*signal) as u8)
            }));
            if len == 1 {
                pdi.put_ram(manager.start, &self.buffer);
            } else {
                pdi.write_sync_manager(index, &self.buffer);
            }
        }
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn stop(&mut self, _signals: &mut Signals) {}
}
