//! Firmware interface of a device with a processor, as its controller calls it.

use linesman_proto::mailbox::coe::{Emergency, ObjectAddress};
use linesman_proto::sii::Protocols;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::{Instant, Span};

use super::areas::Areas;
use super::{Processor, UNTOLD};
use crate::controller::{Pdi, SyncSignal};
use crate::device::application_layer::{ApplicationLayer, Refusal};
use crate::device::ethernet::{EthernetFunction, EthernetSetup, EthernetSide, HostAddress};
use crate::device::firmware::{Firmware, SampleAgain};
use crate::device::history::History;
use crate::device::mailbox::{FragmentsLeftOut, Served};
use crate::device::signal::Signals;
use crate::device::software_fault::SoftwareFault;

impl Firmware for Processor {
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        self.dictionary.restart(&self.description.dictionary);
        self.history = History::default();
        self.mailbox.restart();
        // An update that the loss of the supply broke off is forgotten; the old firmware runs.
        self.files.take_broken_update();
        self.start_new_firmware(pdi);
        self.process_data = Areas::default();
        self.synchronisation.start(&self.description.dictionary, &mut self.dictionary);
        self.step = None;
        self.emergencies.clear();
        self.has_locked = false;
        self.has_values = false;
        self.next_sample = now;
        self.make_safe(pdi);
    }

    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        self.mind_locks(pdi);
        self.serve_process_data(now, pdi);
        self.serve_requests(now, pdi);
        // Behind requests, and not while one is worked on, as the main loop of the ETG's Slave Stack Code does: whoever
        // orders INIT takes the mailbox away at once.
        let works = self.step.is_some_and(|step| step.due > now);
        if !works && pdi.take_activation_event() {
            self.check_again(pdi);
        }
        let state = ApplicationLayer::state(pdi);
        let again = if state.has_mailbox() && self.description.mailbox.is_present() {
            self.tell_emergencies(pdi);
            self.tell_time(pdi);
            let mut served = Served {
                dictionary: &mut self.dictionary,
                files: &mut self.files,
                software_faults: &mut self.software_faults,
                state,
            };
            let again = self.mailbox.serve(now, pdi, &mut served);
            self.follow_up();
            again
        } else {
            None
        };
        let step = self.step.map(|step| if step.due > now { step.due } else { step.deadline });
        let due = self.synchronisation.next(ApplicationLayer::is_operational(pdi));
        [again, step, due].into_iter().flatten().min()
    }

    fn refuse(&mut self, refusal: Option<Refusal>) {
        self.application_layer.refuse(refusal);
    }

    fn report(&mut self, emergency: Emergency) {
        if self.emergencies.len() < UNTOLD {
            self.emergencies.push(emergency);
        }
    }

    fn has_processor(&self) -> bool {
        true
    }

    fn has_mailbox(&self) -> bool {
        self.description.mailbox.is_present()
    }

    fn software_fault(&mut self, software_fault: SoftwareFault, begins: bool) {
        if let SoftwareFault::Mismatch(what) = software_fault {
            self.mismatch(what, begins);
        }
        if begins {
            self.software_faults.begin(software_fault);
        } else {
            self.software_faults.end(software_fault);
        }
    }

    fn number(&self, address: ObjectAddress) -> Option<u64> {
        self.dictionary.find(address).map(|at| self.dictionary.number(at))
    }

    fn set_number(&mut self, address: ObjectAddress, value: u64) {
        if let Some(at) = self.dictionary.find(address) {
            self.dictionary.set_number(at, value);
        }
    }

    fn reboot(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        // What the MainDevice asked meanwhile nobody has heard.
        pdi.take_al_control_event();
        self.start(now, pdi);
        self.lock_all(pdi, false);
        ApplicationLayer::fail(pdi, AlState::Init, AlStatusCode::RESTARTED_LOCALLY);
        self.note_crash(pdi);
    }

    fn identify(&mut self, id: u16, _signals: &mut Signals) -> bool {
        self.application_layer.identify(id);
        true
    }

    fn connect_ethernet(&mut self, setup: &EthernetSetup) -> bool {
        let function = self.description.ethernet;
        let (ports, has_own) = match function {
            EthernetFunction::SwitchPorts(ports) => (ports, false),
            EthernetFunction::IpApplication => (0, true),
        };
        let fits = setup.hosts.iter().all(|host| (1..=ports).contains(&host.port))
            && (has_own || setup.address == HostAddress::None);
        let speaks = self.description.protocols.has(Protocols::EOE);
        if speaks && fits {
            self.mailbox.connect(EthernetSide::new(function, setup));
        }
        speaks && fits
    }

    fn ethernet(&self) -> Option<&EthernetSide> {
        self.mailbox.ethernet()
    }

    fn ethernet_mut(&mut self) -> Option<&mut EthernetSide> {
        self.mailbox.ethernet_mut()
    }

    fn fragments_left_out(&self) -> FragmentsLeftOut {
        self.mailbox.fragments_left_out()
    }

    fn read_sii(&mut self) {
        self.reads_sii = true;
    }

    fn samples(&self) -> bool {
        self.description.channels.iter().any(|channel| channel.has_inputs())
    }

    fn sample(&mut self, now: Instant, pdi: &mut Pdi<'_>) {
        let with_frames = self.synchronisation.samples_with_frames();
        if with_frames && now >= self.next_sample && ApplicationLayer::state(pdi).has_inputs() {
            self.sample_inputs(now, pdi);
        }
    }

    fn sample_again(&self, pdi: &Pdi<'_>) -> SampleAgain {
        let samples =
            self.synchronisation.samples_with_frames() && ApplicationLayer::state(pdi).has_inputs();
        SampleAgain::From(if samples { self.next_sample } else { Instant::MAX })
    }

    fn synchronises(&self) -> bool {
        true
    }

    fn sync(&mut self, signal: SyncSignal, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant> {
        self.keep_step(signal, now, pdi)
    }

    fn slow_down(&mut self, takes: Option<Span>) {
        self.synchronisation.set_takes(takes);
    }

    fn stop(&mut self, signals: &mut Signals) {
        for channel in &mut self.description.channels {
            channel.lose_supply(signals);
        }
    }
}
