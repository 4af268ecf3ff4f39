//! The device behind a controller as the recording shows it: how long it takes for a state and for a
//! mailbox message, its dictionary, and inputs that come from outside.
//!
//! States, mailbox and SDO server are those of every device of the segment.

use std::collections::VecDeque;

use linesman_proto::mailbox::Counter;
use linesman_proto::register::{AlEvents, SmDirection, SmMode, SyncManagerConfig};
use linesman_proto::sii::Protocols;
use linesman_proto::state::{AlState, AlStatusCode, StateValue};
use linesman_proto::time::{Instant, Span};
use linesman_sim::controller::Pdi;
use linesman_sim::device::application_layer::{ApplicationLayer, Refusal};
use linesman_sim::device::dictionary::Dictionary;
use linesman_sim::device::files::Files;
use linesman_sim::device::mailbox::{ANSWERS, Mailbox, REQUESTS, Served};
use linesman_sim::device::{Firmware, SignalId, Signals, SoftwareFaults};

use super::learn::{AlStep, DeviceSeen, MailboxTurn};

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
    /// A request waits since, and is looked at then.
    asked_at: Option<Instant>,
    looks_at: Option<Instant>,
    mailbox: Mailbox,
    /// What the first answer counts, where the recording begins behind others.
    first_answer: Option<Counter>,
    turns: VecDeque<MailboxTurn>,
    message: Option<Message>,
    /// When the device begins to write behind each fetch, and whether that shows.
    openings: VecDeque<Option<(Span, bool)>>,
    opening: Option<(Instant, bool)>,
    /// The answer is in its mailbox.
    filled: bool,
    dictionary: Dictionary,
    files: Files,
    software_faults: SoftwareFaults,
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
    pub(super) fn new(seen: &DeviceSeen, inputs: Vec<SignalId>) -> Self {
        Self {
            application_layer: ApplicationLayer::new(true),
            steps: seen.steps.clone(),
            step: None,
            asked_at: None,
            looks_at: None,
            mailbox: Mailbox::new(AT_ONCE, Protocols(Protocols::COE | Protocols::FOE)),
            first_answer: seen.first_answer,
            turns: seen.mailbox.clone(),
            message: None,
            openings: seen.openings.clone(),
            opening: None,
            filled: false,
            dictionary: seen.objects.dictionary(),
            files: Files::default(),
            software_faults: SoftwareFaults::default(),
            inputs,
            buffer: Vec::new(),
        }
    }

    /// How long the next request for a state is not looked at.
    fn patience(&self, state: u8) -> Span {
        let step = self.steps.iter().find(|step| step.requested == state);
        step.map_or(Span::ZERO, |step| step.taken)
    }

    /// The next step as the recording shows it. Steps it shows beyond what is asked for are left out.
    fn next_step(&mut self, to: AlState) -> AlStep {
        let state = to.bits();
        let usual = AlStep {
            requested: state,
            taken: Span::ZERO,
            took: USUAL_STEP,
            status: u16::from(state),
            code: 0,
        };
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
        if self.step.is_some() || !pdi.events().contains(AlEvents::AL_CONTROL) {
            return;
        }
        // Until it looks, the request stays and no other is taken.
        let asked_at = *self.asked_at.get_or_insert(now);
        let requested = pdi.al_control().requested().bits();
        let looks_at = asked_at + self.patience(requested);
        if now < looks_at {
            self.looks_at = Some(looks_at);
            return;
        }
        (self.asked_at, self.looks_at) = (None, None);
        if let Some(to) = self.application_layer.take_request(pdi) {
            let step = self.next_step(to);
            self.step = Some((asked_at + step.took, step));
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

    /// The device begins to write the next answer some time behind the fetch of the last.
    fn serve_opening(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        let full = pdi.mailbox_full(ANSWERS);
        if std::mem::replace(&mut self.filled, full) && !full {
            let opening = self.openings.pop_front().flatten();
            self.opening = opening.map(|(behind, shown)| (now + behind, shown));
        }
        let (at, shown) = self.opening.filter(|_| !full)?;
        if now < at {
            return Some(at);
        }
        self.opening = None;
        pdi.open_sync_manager(ANSWERS, shown);
        None
    }

    fn serve(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        let mut served = Served {
            dictionary: &mut self.dictionary,
            files: &mut self.files,
            software_faults: &mut self.software_faults,
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
        if let Some(counter) = self.first_answer {
            self.mailbox.count_from(counter);
        }
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
        let opening = self.serve_opening(now, pdi);
        let step = self.step.map(|(due, _)| due);
        [mailbox, opening, step, self.looks_at].into_iter().flatten().min()
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
