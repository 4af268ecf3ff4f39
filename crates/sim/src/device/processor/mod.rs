//! A device with a processor: state machine, process data and mailbox.
//!
//! Read first: ETG.1000.6, EtherCAT state machine. [`application_layer`](super::application_layer)
//! has what all devices share, `check` what this one looks at before it enters a state.

mod check;
mod process_image;

use linesman_proto::mailbox::coe::{Emergency, ObjectAddress, ObjectIndex};
use linesman_proto::register as r;
use linesman_proto::sii::MailboxPair;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{Instant, Span};

use self::process_image::ProcessImage;
use super::application::Channel;
use super::application_layer::{ApplicationLayer, Refusal};
use super::dictionary::Dictionary;
use super::firmware::{Firmware, SampleAgain};
use super::mailbox::Mailbox;
use super::signal::Signals;
use crate::controller::Pdi;

/// The outputs of a device with a mailbox are assigned here.
const OUTPUT_ASSIGNMENT: ObjectIndex = ObjectIndex(0x1C12);
/// The inputs.
const INPUT_ASSIGNMENT: ObjectIndex = ObjectIndex(0x1C13);

/// Emergencies that wait for a mailbox; further ones are forgotten.
const UNTOLD: usize = 8;

/// How long a processor takes for what it does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ResponseTimes {
    /// From INIT to PREOP or BOOT.
    pub to_preop: Span,
    /// From PREOP to SAFEOP.
    pub to_safeop: Span,
    /// From SAFEOP to OP, once outputs are there.
    pub to_op: Span,
    /// Down, wherever to.
    pub down: Span,
    /// For the answer to a mailbox message.
    pub mailbox: Span,
    /// Between two samples of the inputs.
    pub sample: Span,
    /// How long it waits for outputs on the way to OP.
    pub outputs: Span,
}

impl ResponseTimes {
    /// A terminal with a small processor.
    pub const TERMINAL: Self = Self {
        to_preop: Span::ms(12),
        to_safeop: Span::ms(6),
        to_op: Span::ms(2),
        down: Span::us(700),
        mailbox: Span::us(600),
        sample: Span::us(500),
        outputs: Span::s(1),
    };

    /// A drive, which has more to prepare and samples more often.
    pub const DRIVE: Self = Self {
        to_preop: Span::ms(35),
        to_safeop: Span::ms(18),
        to_op: Span::ms(9),
        sample: Span::us(250),
        ..Self::TERMINAL
    };
}

/// What a processor is made of.
#[derive(Debug)]
pub struct Description {
    /// Its objects as they are after power-on.
    pub dictionary: Dictionary,
    /// What its process data do.
    pub channels: Vec<Box<dyn Channel>>,
    /// The mailbox it likes best; a longer one it does not take.
    pub mailbox: MailboxPair,
    /// The mailbox in BOOT, for a device that knows BOOT.
    pub bootstrap: Option<MailboxPair>,
    /// How quick it is.
    pub times: ResponseTimes,
}

/// A device with a processor.
#[derive(Debug)]
pub struct Processor {
    description: Description,
    application_layer: ApplicationLayer,
    dictionary: Dictionary,
    mailbox: Mailbox,
    outputs: ProcessImage,
    inputs: ProcessImage,
    /// The step that is being worked on.
    step: Option<Step>,
    next_sample: Instant,
    /// Errors to tell of.
    emergencies: Vec<Emergency>,
    buffer: Vec<u8>,
}

/// A requested state on its way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Step {
    to: AlState,
    /// When the checks are done.
    due: Instant,
    /// When it gives up waiting.
    deadline: Instant,
}

/// What became of a step.
enum Outcome {
    Entered,
    Failed(AlState, AlStatusCode),
    Waits,
}

impl Processor {
    /// A device that has not started yet.
    #[must_use]
    pub fn new(description: Description) -> Self {
        Self {
            application_layer: ApplicationLayer::new(description.bootstrap.is_some()),
            dictionary: description.dictionary.clone(),
            mailbox: Mailbox::new(description.times.mailbox),
            outputs: ProcessImage::default(),
            inputs: ProcessImage::default(),
            step: None,
            next_sample: Instant::ZERO,
            emergencies: Vec::new(),
            buffer: Vec::new(),
            description,
        }
    }

    fn make_safe(&mut self, pdi: &mut Pdi<'_>) {
        let now = pdi.now();
        for channel in &mut self.description.channels {
            channel.make_safe(now, &self.dictionary, pdi.signals_mut());
        }
    }

    // ---- states ----

    fn serve_requests(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if let Some(step) = self.step.filter(|step| step.due <= now) {
            self.step = None;
            match self.go(step, now, pdi) {
                Outcome::Entered => ApplicationLayer::enter(pdi, step.to),
                Outcome::Failed(state, code) => self.fall(pdi, state, code),
                Outcome::Waits => self.step = Some(step),
            }
        }
        // While it waits for outputs it listens, while it works it does not.
        let listens = self.step.is_none_or(|step| step.due <= now);
        if listens && let Some(to) = self.application_layer.take_request(pdi) {
            let from = ApplicationLayer::state(pdi);
            // Whoever asks has seen the error, if there was one: outputs may come again.
            pdi.deactivate_sync_manager(check::OUTPUTS, false);
            let due = now + self.time_for(from, to);
            self.step = Some(Step { to, due, deadline: due + self.description.times.outputs });
        }
    }

    fn time_for(&self, from: AlState, to: AlState) -> Span {
        let times = &self.description.times;
        match (from, to) {
            (AlState::Init, AlState::PreOp | AlState::Boot) => times.to_preop,
            (AlState::PreOp, AlState::SafeOp) => times.to_safeop,
            (AlState::SafeOp, AlState::Op) => times.to_op,
            (
                AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
                AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
            ) => times.down,
        }
    }

    /// Tries to enter the state of a step.
    fn go(&mut self, step: Step, now: Instant, pdi: &mut Pdi<'_>) -> Outcome {
        let from = ApplicationLayer::state(pdi);
        if !step.to.has_outputs() {
            self.make_safe(pdi);
        }
        match step.to {
            AlState::Init => {
                self.mailbox.restart();
                Outcome::Entered
            }
            AlState::PreOp => self.start_mailbox(from, pdi, AlStatusCode::INVALID_MAILBOX_PREOP),
            AlState::Boot => self.start_mailbox(from, pdi, AlStatusCode::INVALID_MAILBOX_BOOT),
            AlState::SafeOp => match self.set_up_process_data(pdi) {
                Ok(()) => {
                    self.sample_inputs(now, pdi);
                    Outcome::Entered
                }
                Err(code) => Outcome::Failed(AlState::PreOp, code),
            },
            AlState::Op => self.go_operational(step, now, pdi),
        }
    }

    fn start_mailbox(&mut self, from: AlState, pdi: &Pdi<'_>, code: AlStatusCode) -> Outcome {
        if !pdi.sii_load_ok() {
            return Outcome::Failed(AlState::Init, AlStatusCode::EEPROM_ERROR);
        }
        if !self.has_mailbox(pdi, code == AlStatusCode::INVALID_MAILBOX_BOOT) {
            return Outcome::Failed(AlState::Init, code);
        }
        if !from.has_mailbox() {
            self.mailbox.restart();
        }
        Outcome::Entered
    }

    fn has_mailbox(&self, pdi: &Pdi<'_>, boot: bool) -> bool {
        let areas = self.description.bootstrap.filter(|_| boot).unwrap_or(self.description.mailbox);
        check::mailbox(pdi, areas.receive.size.max(areas.send.size))
    }

    fn set_up_process_data(&mut self, pdi: &Pdi<'_>) -> Result<(), AlStatusCode> {
        let image =
            |assignment, code| ProcessImage::of(&self.dictionary, assignment).map_err(|_| code);
        let inputs = image(INPUT_ASSIGNMENT, AlStatusCode::INVALID_INPUT_MAPPING)?;
        let outputs = image(OUTPUT_ASSIGNMENT, AlStatusCode::INVALID_OUTPUT_MAPPING)?;
        check::process_data(pdi, outputs.len(), inputs.len())?;
        (self.inputs, self.outputs) = (inputs, outputs);
        Ok(())
    }

    fn go_operational(&mut self, step: Step, now: Instant, pdi: &mut Pdi<'_>) -> Outcome {
        if let Err(code) = check::process_data(pdi, self.outputs.len(), self.inputs.len()) {
            return Outcome::Failed(AlState::PreOp, code);
        }
        if self.outputs.len() == 0 {
            return Outcome::Entered;
        }
        if self.take_outputs(pdi) && !watchdog_ran_out(pdi) {
            self.drive_outputs(now, pdi.signals_mut());
            return Outcome::Entered;
        }
        if now < step.deadline {
            return Outcome::Waits;
        }
        Outcome::Failed(AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG)
    }

    /// It leaves its state, or does not get further, because of an error. On the way out of OP it
    /// locks its outputs until the error is acknowledged, so that the MainDevice misses their working
    /// counter.
    fn fall(&mut self, pdi: &mut Pdi<'_>, state: AlState, code: AlStatusCode) {
        self.make_safe(pdi);
        if ApplicationLayer::is_operational(pdi) && self.outputs.len() > 0 {
            pdi.deactivate_sync_manager(check::OUTPUTS, true);
        }
        if !state.has_mailbox() {
            self.mailbox.restart();
        }
        ApplicationLayer::fail(pdi, state, code);
    }

    /// A SyncManager was switched on or off: what the state needs is to be there still.
    fn check_again(&mut self, pdi: &mut Pdi<'_>) {
        let state = ApplicationLayer::state(pdi);
        if state.has_mailbox() && !self.has_mailbox(pdi, state == AlState::Boot) {
            let code = match state {
                AlState::Boot => AlStatusCode::INVALID_MAILBOX_BOOT,
                AlState::Init | AlState::PreOp | AlState::SafeOp | AlState::Op => {
                    AlStatusCode::INVALID_MAILBOX_PREOP
                }
            };
            self.step = None;
            self.fall(pdi, AlState::Init, code);
        } else if state.has_inputs()
            && let Err(code) = check::process_data(pdi, self.outputs.len(), self.inputs.len())
        {
            self.step = None;
            self.fall(pdi, AlState::PreOp, code);
        }
    }

    /// Hands over what is to be told, and keeps the error register.
    fn tell_emergencies(&mut self, pdi: &Pdi<'_>) {
        for emergency in self.emergencies.drain(..) {
            let register = ObjectAddress { index: ObjectIndex::ERROR_REGISTER, subindex: 0 };
            if let Some(register) = self.dictionary.find(register) {
                self.dictionary.set_number(register, u64::from(emergency.register.0));
            }
            self.mailbox.report(emergency, pdi);
        }
    }

    // ---- process data ----

    /// Fetches fresh outputs; false when none came yet.
    fn take_outputs(&mut self, pdi: &mut Pdi<'_>) -> bool {
        self.buffer.clear();
        self.buffer.resize(self.outputs.len(), 0);
        if pdi.read_sync_manager(check::OUTPUTS, &mut self.buffer).is_none() {
            return false;
        }
        self.outputs.unpack(&self.buffer, &mut self.dictionary);
        true
    }

    fn drive_outputs(&mut self, now: Instant, signals: &mut Signals) {
        for channel in &mut self.description.channels {
            channel.drive(now, &self.dictionary, signals);
        }
    }

    fn serve_process_data(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if !ApplicationLayer::is_operational(pdi) || self.outputs.len() == 0 {
            return;
        }
        if watchdog_ran_out(pdi) {
            self.fall(pdi, AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG);
        } else if self.take_outputs(pdi) {
            self.drive_outputs(now, pdi.signals_mut());
        }
    }

    fn sample_inputs(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.next_sample = now + self.description.times.sample;
        for channel in &mut self.description.channels {
            channel.sample(now, &mut self.dictionary, pdi.signals());
        }
        if self.inputs.len() > 0 {
            let mut buffer = std::mem::take(&mut self.buffer);
            self.inputs.pack(&self.dictionary, &mut buffer);
            pdi.write_sync_manager(check::INPUTS, &buffer);
            self.buffer = buffer;
        }
    }
}

/// Whether the outputs are watched and came too late.
fn watchdog_ran_out(pdi: &mut Pdi<'_>) -> bool {
    let watched =
        pdi.sync_manager(check::OUTPUTS).is_some_and(|manager| manager.control.watchdog());
    let expired = pdi.watchdog_expired();
    watched && expired && pdi.register_u16(r::WATCHDOG_TIME_PROCESS_DATA.address) != 0
}

impl Firmware for Processor {
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.dictionary.restart(&self.description.dictionary);
        self.mailbox.restart();
        (self.inputs, self.outputs) = (ProcessImage::default(), ProcessImage::default());
        self.step = None;
        self.emergencies.clear();
        self.next_sample = now;
        self.make_safe(pdi);
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        if pdi.take_activation_event() {
            self.check_again(pdi);
        }
        self.serve_process_data(now, pdi);
        self.serve_requests(now, pdi);
        let state = ApplicationLayer::state(pdi);
        let again = if state.has_mailbox() {
            self.tell_emergencies(pdi);
            self.mailbox.serve(now, pdi, &mut self.dictionary, state)
        } else {
            None
        };
        let step = self.step.map(|step| if step.due > now { step.due } else { step.deadline });
        [again, step].into_iter().flatten().min()
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn report(&mut self, emergency: Emergency) {
        if self.emergencies.len() < UNTOLD {
            self.emergencies.push(emergency);
        }
    }

    fn samples(&self) -> bool {
        self.description.channels.iter().any(|channel| channel.has_inputs())
    }

    fn sample(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if now >= self.next_sample && ApplicationLayer::state(pdi).has_inputs() {
            self.sample_inputs(now, pdi);
        }
    }

    fn sample_again(&self, pdi: &Pdi<'_>) -> SampleAgain {
        let samples = ApplicationLayer::state(pdi).has_inputs();
        SampleAgain::From(if samples { self.next_sample } else { Instant::MAX })
    }

    fn stop(&mut self, signals: &mut Signals) {
        for channel in &mut self.description.channels {
            channel.lose_supply(signals);
        }
    }
}
