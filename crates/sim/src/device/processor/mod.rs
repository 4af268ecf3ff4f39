//! A device with a processor: state machine, process data and mailbox.
//!
//! Read first: ETG.1000.6, EtherCAT state machine. [`application_layer`](super::application_layer)
//! has what all devices share, `check` what this one looks at before it enters a state.

mod areas;
mod check;
mod firmware;
mod in_step;
mod mismatch;
mod note;
mod process_image;
mod sync_mode;
mod synchronisation;
mod update;

use linesman_proto::mailbox::coe::Emergency;
use linesman_proto::register as r;
use linesman_proto::sii::{Direction, MailboxPair, Protocols};
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{Instant, Span};

use self::areas::Areas;
pub use self::areas::ProcessBuffer;
pub use self::check::BusAccess;
use self::synchronisation::Synchronisation;
use super::application::Channel;
use super::application_layer::ApplicationLayer;
use super::dictionary::Dictionary;
use super::ethernet::EthernetFunction;
use super::files::Files;
use super::history::History;
use super::mailbox::Mailbox;
use super::signal::Signals;
use super::software_fault::{SoftwareFault, SoftwareFaults};
use crate::controller::Pdi;

/// Emergencies that wait for a mailbox; further ones are forgotten.
const UNTOLD: usize = 8;
/// How long new firmware takes to start.
const FIRST_START: Span = Span::ms(400);

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
    /// Its process data.
    pub buffers: Vec<ProcessBuffer>,
    /// Pairs of PDOs that cannot be assigned together.
    pub excludes: Vec<(u16, u16)>,
    /// The mailbox it likes best; a longer one it does not take. Without a size there is none.
    pub mailbox: MailboxPair,
    /// What its mailbox speaks.
    pub protocols: Protocols,
    /// What it does with Ethernet frames, where it speaks EoE.
    pub ethernet: EthernetFunction,
    /// The mailbox in BOOT, for a device that knows BOOT.
    pub bootstrap: Option<MailboxPair>,
    /// How quick it is.
    pub times: ResponseTimes,
    /// How its software reaches memory, where its bus has 16 bits.
    pub bus: BusAccess,
    /// It takes a clock unit that is on and makes neither SYNC0 nor SYNC1 (0x0981 is 0x01) as no
    /// synchronisation at all. Others refuse that.
    pub unit_alone: bool,
}

/// A device with a processor.
#[derive(Debug)]
pub struct Processor {
    description: Description,
    application_layer: ApplicationLayer,
    dictionary: Dictionary,
    mailbox: Mailbox,
    process_data: Areas,
    synchronisation: Synchronisation,
    /// The step that is being worked on.
    step: Option<RequestedStep>,
    next_sample: Instant,
    files: Files,
    history: History,
    software_faults: SoftwareFaults,
    /// Its application has run since it started: there are values.
    has_values: bool,
    /// Inputs were fetched between the last signal of its clock and the end of copying new ones.
    fetched_early: bool,
    /// It reads its SII itself on the way to PREOP.
    reads_sii: bool,
    /// It has locked all buffers of its process data.
    has_locked: bool,
    /// Settings before they were made not to fit.
    former: Vec<mismatch::Former>,
    /// Errors to tell of.
    emergencies: Vec<Emergency>,
    buffer: Vec<u8>,
}

/// A requested state on its way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct RequestedStep {
    to: AlState,
    /// When the checks are done.
    due: Instant,
    /// When it gives up waiting.
    deadline: Instant,
}

/// What became of a step.
enum StepOutcome {
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
            mailbox: Mailbox::new(description.times.mailbox, description.protocols),
            process_data: Areas::default(),
            synchronisation: Synchronisation::new(&description.dictionary),
            step: None,
            next_sample: Instant::ZERO,
            files: Files::default(),
            history: History::default(),
            software_faults: SoftwareFaults::default(),
            has_values: false,
            fetched_early: false,
            reads_sii: false,
            has_locked: false,
            former: Vec::new(),
            emergencies: Vec::new(),
            buffer: Vec::new(),
            description,
        }
    }

    /// The same with files that FoE reads and writes.
    #[must_use]
    pub fn with_files(self, files: Files) -> Self {
        Self { files, ..self }
    }

    fn make_safe(&mut self, pdi: &mut Pdi<'_>) {
        let now = pdi.now();
        for channel in &mut self.description.channels {
            channel.make_safe(now, &self.dictionary, pdi.signals_mut());
        }
        self.hear_channels();
    }

    /// What channels have to tell of waits for the mailbox.
    fn hear_channels(&mut self) {
        for emergency in self.description.channels.iter_mut().filter_map(|one| one.emergency()) {
            if self.emergencies.len() < UNTOLD {
                self.emergencies.push(emergency);
            }
        }
    }

    // ---- states ----

    fn serve_requests(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        if self.software_faults.has(SoftwareFault::DeafToRequests) {
            return;
        }
        if let Some(step) = self.step.filter(|step| step.due <= now) {
            self.step = None;
            match self.go(step, now, pdi) {
                StepOutcome::Entered => self.application_layer.enter(pdi, step.to),
                StepOutcome::Failed(state, code) => self.fall(pdi, state, code),
                StepOutcome::Waits => self.step = Some(step),
            }
        }
        // While it waits for outputs it listens, while it works it does not.
        let listens = self.step.is_none_or(|step| step.due <= now);
        if listens && let Some(to) = self.application_layer.take_request(pdi) {
            let from = ApplicationLayer::state(pdi);
            // Whoever asks has seen the error, if there was one: outputs may come again.
            self.lock_outputs(pdi, false);
            let due = now + self.time_for(from, to);
            self.step =
                Some(RequestedStep { to, due, deadline: due + self.description.times.outputs });
        }
    }

    fn time_for(&self, from: AlState, to: AlState) -> Span {
        let times = &self.description.times;
        match (from, to) {
            (AlState::Init, AlState::PreOp | AlState::Boot) => times.to_preop,
            (AlState::PreOp, AlState::SafeOp) => times.to_safeop,
            (AlState::SafeOp, AlState::Op) => times.to_op,
            (AlState::Boot, AlState::Init) if self.files.has_new_firmware() => FIRST_START,
            (
                AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
                AlState::Init | AlState::Boot | AlState::PreOp | AlState::SafeOp | AlState::Op,
            ) => times.down,
        }
    }

    /// Tries to enter the state of a step.
    fn go(&mut self, step: RequestedStep, now: Instant, pdi: &mut Pdi<'_>) -> StepOutcome {
        let from = ApplicationLayer::state(pdi);
        if !step.to.has_outputs() {
            self.make_safe(pdi);
        }
        match step.to {
            AlState::Init => {
                self.mailbox.restart();
                if from == AlState::Boot { self.leave_boot(pdi) } else { StepOutcome::Entered }
            }
            AlState::PreOp => self.start_mailbox(from, pdi, AlStatusCode::INVALID_MAILBOX_PREOP),
            AlState::Boot => self.start_mailbox(from, pdi, AlStatusCode::INVALID_MAILBOX_BOOT),
            AlState::SafeOp => match self.set_up_process_data(pdi) {
                Ok(()) => {
                    self.sample_inputs(now, pdi);
                    StepOutcome::Entered
                }
                Err(code) => StepOutcome::Failed(AlState::PreOp, code),
            },
            AlState::Op => self.go_operational(step, now, pdi),
        }
    }

    fn start_mailbox(&mut self, from: AlState, pdi: &Pdi<'_>, code: AlStatusCode) -> StepOutcome {
        if !pdi.sii_load_ok() {
            return StepOutcome::Failed(AlState::Init, AlStatusCode::EEPROM_ERROR);
        }
        // The MainDevice has to leave the EEPROM to it: bit 0 of 0x0500.
        if self.reads_sii && pdi.register(r::SII_ACCESS_ECAT.address) & 1 == 0 {
            return StepOutcome::Failed(AlState::Init, AlStatusCode::EEPROM_NO_ACCESS);
        }
        if let Err(code) = self.check_mailbox(pdi, code) {
            return StepOutcome::Failed(AlState::Init, code);
        }
        if !from.has_mailbox() {
            self.mailbox.restart();
            if code == AlStatusCode::INVALID_MAILBOX_PREOP {
                self.note_communication(pdi);
            }
        }
        StepOutcome::Entered
    }

    /// Whether the mailbox is set up as the device wants it, if it has one; `wrong` is the code for
    /// most of what can be wrong.
    fn check_mailbox(&self, pdi: &Pdi<'_>, wrong: AlStatusCode) -> Result<(), AlStatusCode> {
        if !self.description.mailbox.is_present() {
            return Ok(());
        }
        let boot = wrong == AlStatusCode::INVALID_MAILBOX_BOOT;
        let areas = self.description.bootstrap.filter(|_| boot).unwrap_or(self.description.mailbox);
        let longest = areas.receive.size.max(areas.send.size);
        check::mailbox(pdi, longest, self.description.bus, wrong)
    }

    fn set_up_process_data(&mut self, pdi: &Pdi<'_>) -> Result<(), AlStatusCode> {
        let areas =
            Areas::of(&self.dictionary, &self.description.buffers, &self.description.excludes)?;
        check::modules(&self.dictionary)?;
        self.check_areas(pdi, &areas)?;
        let outputs = areas.len(Direction::Outputs) > 0;
        let alone = self.description.unit_alone;
        self.synchronisation.set_up(&mut self.dictionary, outputs, alone, pdi)?;
        self.process_data = areas;
        Ok(())
    }

    fn check_process_data(&self, pdi: &Pdi<'_>) -> Result<(), AlStatusCode> {
        self.check_areas(pdi, &self.process_data)
    }

    fn check_areas(&self, pdi: &Pdi<'_>, areas: &Areas) -> Result<(), AlStatusCode> {
        let mailbox = self.description.mailbox.is_present();
        check::process_data(pdi, areas, mailbox, self.description.bus)
    }

    fn has_outputs(&self) -> bool {
        self.process_data.len(Direction::Outputs) > 0
    }

    /// Locks the buffers of the outputs, or unlocks them.
    fn lock_outputs(&self, pdi: &mut Pdi<'_>, locked: bool) {
        for buffer in &self.description.buffers {
            if buffer.direction == Direction::Outputs {
                pdi.deactivate_sync_manager(buffer.sync_manager, locked);
            }
        }
    }

    /// Locks all buffers of its process data when that is wrong with it, and unlocks them when it is over.
    fn mind_locks(&mut self, pdi: &mut Pdi<'_>) {
        let locks = self.software_faults.has(SoftwareFault::LockedBuffers);
        if std::mem::replace(&mut self.has_locked, locks) != locks {
            self.lock_all(pdi, locks);
        }
    }

    fn lock_all(&self, pdi: &mut Pdi<'_>, locked: bool) {
        for buffer in &self.description.buffers {
            pdi.deactivate_sync_manager(buffer.sync_manager, locked);
        }
    }

    fn go_operational(
        &mut self,
        step: RequestedStep,
        now: Instant,
        pdi: &mut Pdi<'_>,
    ) -> StepOutcome {
        if let Err(code) = self.check_process_data(pdi) {
            return StepOutcome::Failed(AlState::PreOp, code);
        }
        // What stood still when it entered SAFEOP may run by now.
        if !self.has_values {
            self.sample_inputs(now, pdi);
        }
        if let Some(code) = self.values_missing() {
            return StepOutcome::Failed(AlState::SafeOp, code);
        }
        if let Some(outcome) = self.wait_for_clock(step, now) {
            return outcome;
        }
        if !self.has_outputs() {
            return StepOutcome::Entered;
        }
        if self.take_outputs(pdi) && !self.watchdog_ran_out(pdi) {
            self.drive_outputs(now, pdi.signals_mut());
            return StepOutcome::Entered;
        }
        if now < step.deadline {
            return StepOutcome::Waits;
        }
        StepOutcome::Failed(AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG)
    }

    /// The code to show when an application that has not run since the start gives no values to
    /// exchange.
    fn values_missing(&self) -> Option<AlStatusCode> {
        if self.has_values {
            return None;
        }
        let has = |direction| self.process_data.len(direction) > 0;
        match (has(Direction::Inputs), has(Direction::Outputs)) {
            (true, true) => Some(AlStatusCode::NO_VALID_INPUTS_AND_OUTPUTS),
            (true, false) => Some(AlStatusCode::NO_VALID_INPUTS),
            (false, true) => Some(AlStatusCode::NO_VALID_OUTPUTS),
            (false, false) => None,
        }
    }

    /// It leaves its state, or does not get further, because of an error. On the way out of OP it
    /// locks its outputs until the error is acknowledged, so that the MainDevice misses their working
    /// counter.
    fn fall(&mut self, pdi: &mut Pdi<'_>, state: AlState, code: AlStatusCode) {
        self.make_safe(pdi);
        if ApplicationLayer::is_operational(pdi) && self.has_outputs() {
            self.lock_outputs(pdi, true);
        }
        if !state.has_mailbox() {
            self.mailbox.restart();
        }
        ApplicationLayer::fail(pdi, state, code);
        self.note_failure(state, code, pdi);
    }

    /// A SyncManager was switched on or off: what the state needs is to be there still.
    fn check_again(&mut self, pdi: &mut Pdi<'_>) {
        let state = ApplicationLayer::state(pdi);
        let wrong = match state {
            AlState::Boot => AlStatusCode::INVALID_MAILBOX_BOOT,
            AlState::Init | AlState::PreOp | AlState::SafeOp | AlState::Op => {
                AlStatusCode::INVALID_MAILBOX_PREOP
            }
        };
        if state.has_mailbox()
            && let Err(code) = self.check_mailbox(pdi, wrong)
        {
            self.step = None;
            self.fall(pdi, AlState::Init, code);
        } else if state.has_inputs()
            && let Err(code) = self.check_process_data(pdi)
        {
            self.step = None;
            self.fall(pdi, AlState::PreOp, code);
        }
    }

    // ---- process data ----

    /// Fetches fresh outputs; false when none came yet.
    fn take_outputs(&mut self, pdi: &mut Pdi<'_>) -> bool {
        self.process_data.take_outputs(pdi, &mut self.dictionary, &mut self.buffer)
    }

    fn drive_outputs(&mut self, now: Instant, signals: &mut Signals) {
        if self.software_faults.has(SoftwareFault::FrozenApplication) {
            return;
        }
        for channel in &mut self.description.channels {
            channel.drive(now, &self.dictionary, signals);
        }
        self.hear_channels();
    }

    fn serve_process_data(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        let operational = ApplicationLayer::is_operational(pdi);
        if operational && self.has_outputs() && self.watchdog_ran_out(pdi) {
            self.fall(pdi, AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG);
        } else if ApplicationLayer::state(pdi).has_inputs() {
            self.serve_outputs(now, pdi);
        }
        self.serve_due(now, pdi);
    }

    /// Whether the outputs are watched and came too late.
    fn watchdog_ran_out(&self, pdi: &mut Pdi<'_>) -> bool {
        let watched = check::watched(pdi, &self.process_data);
        let expired = pdi.watchdog_expired();
        watched && expired && pdi.register_u16(r::WATCHDOG_TIME_PROCESS_DATA.address) != 0
    }
}
