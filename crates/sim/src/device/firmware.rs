//! Interface between a controller and the firmware behind it.
//!
//! The controller calls; firmware answers through the [`Pdi`] it is handed. Everything happens at
//! an instant that is an argument, so that the same frames at the same times give the same bytes.

use std::fmt::Debug;

use linesman_proto::mailbox::coe::{Emergency, ObjectAddress};
use linesman_proto::time::{Instant, Span};

use super::application_layer::Refusal;
use super::ethernet::{EthernetSetup, EthernetSide};
use super::mailbox::FragmentsLeftOut;
use super::signal::{SignalId, Signals};
use super::software_fault::SoftwareFault;
use crate::controller::{Pdi, SyncSignal};

/// When inputs are to be sampled again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SampleAgain {
    /// With each frame.
    NextFrame,
    /// With the first frame from this instant on.
    From(Instant),
    /// Once any of the signals that it listens to has another value.
    OnceSignalsChange,
}

/// What is behind a controller: a processor with its software, or plain inputs and outputs.
pub trait Firmware: Debug + Send {
    /// The supply is there and the controller has tried to load the SII
    /// ([`Pdi::sii_load_ok`] says how that went). Whatever was before is forgotten, but for settings
    /// that the device stores.
    fn start(&mut self, now: Instant, pdi: &mut Pdi<'_>);

    /// Something happened on the EtherCAT side, or the wake-up time came. `now` is when that was:
    /// for a datagram the end of its frame. Returns the next wake-up, if one is wanted; it replaces
    /// the one before. A wake-up that is not after `now` comes 1 µs after it.
    ///
    /// It is called once after [`Firmware::start`], then when an AL event bit gets set (masked or
    /// not), when a SyncManager was written, when the outputs at 0x0F00 were written, and when
    /// device emulation changed AL status.
    fn run(&mut self, now: Instant, pdi: &mut Pdi<'_>) -> Option<Instant>;

    /// Whether [`Firmware::sample`] is wanted. Asked once, after [`Firmware::start`].
    fn samples(&self) -> bool {
        false
    }

    /// A frame begins: controllers that drive inputs themselves latch them now (S1, digital I/O,
    /// input sampling at start of frame). Called only where [`Firmware::samples`] asks for it.
    fn sample(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {}

    /// When [`Firmware::sample`] will do something again that it would not do now. Asked after each
    /// [`Firmware::sample`]; what a frame writes and every [`Firmware::run`] ask for the next frame
    /// anew. Who does not know says "with the next frame".
    fn sample_again(&self, _pdi: &Pdi<'_>) -> SampleAgain {
        SampleAgain::NextFrame
    }

    /// The signals on which what it samples depends, for one that says
    /// [`SampleAgain::OnceSignalsChange`].
    fn listens_to(&self) -> Vec<SignalId> {
        Vec::new()
    }

    /// Whether it plays the EEPROM (S1 11.2.4): then it answers
    /// [`Pdi::sii_request`]. Asked once, when the controller is made.
    fn emulates_sii(&self) -> bool {
        false
    }

    /// Whether [`Firmware::sync`] is wanted. Asked once, after [`Firmware::start`].
    fn synchronises(&self) -> bool {
        false
    }

    /// A pulse of the SYNC unit reaches the processor. Returns the next wake-up as
    /// [`Firmware::run`] does, but one that was asked for before stays. In acknowledge mode (0x0982
    /// is 0) the next pulse comes only after [`Pdi::acknowledge_sync`].
    fn sync(&mut self, _signal: SyncSignal, _now: Instant, _pdi: &mut Pdi<'_>) -> Option<Instant> {
        None
    }

    /// From now on a step into the state that `refusal` names is refused with its code; `None` ends
    /// that. It outlives a restart. Faults go through
    /// [`Controller::refuse`](crate::controller::Controller::refuse), which also makes a controller
    /// with device emulation leave the answer to this side.
    fn refuse(&mut self, refusal: Option<Refusal>);

    /// Tells the MainDevice of an error through the mailbox, as soon as there is one; a device without
    /// a mailbox cannot. Faults go through
    /// [`Controller::report`](crate::controller::Controller::report).
    fn report(&mut self, _emergency: Emergency) {}

    /// From now on its work in each cycle takes so long, whatever it needs otherwise; `None` ends that.
    /// It outlives a restart. Faults go through
    /// [`Controller::slow_down`](crate::controller::Controller::slow_down).
    fn slow_down(&mut self, _takes: Option<Span>) {}

    /// Whether a processor with software is behind the controller, which can fail.
    fn has_processor(&self) -> bool {
        false
    }

    /// Whether that software has a mailbox.
    fn has_mailbox(&self) -> bool {
        false
    }

    /// Its software misbehaves from now on, or no longer. It outlives a restart. Faults go through
    /// [`Controller::software_fault`](crate::controller::Controller::software_fault).
    fn software_fault(&mut self, _fault: SoftwareFault, _begins: bool) {}

    /// A number in its dictionary; `None` where it has none there. For what is wired to it inside its housing.
    fn number(&self, _address: ObjectAddress) -> Option<u64> {
        None
    }

    /// Sets such a number from the device's side.
    fn set_number(&mut self, _address: ObjectAddress, _value: u64) {}

    /// The processor crashed and has started anew, without its controller: registers stay, what the
    /// software knew is forgotten.
    fn reboot(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {}

    /// Its software reads the SII itself on the way to PREOP: it needs the MainDevice to leave the
    /// EEPROM to it (0x0500, bit 0), and refuses with 0x0050 otherwise.
    fn read_sii(&mut self) {}

    /// The value of its identification, as somebody sets it at its switches. False when it has no
    /// way of its own to tell it; then it goes into the station alias.
    fn identify(&mut self, _id: u16, _signals: &mut Signals) -> bool {
        false
    }

    /// What is at its Ethernet side, for a device that speaks EoE. False when it does not, or has no such ports.
    fn connect_ethernet(&mut self, _setup: &EthernetSetup) -> bool {
        false
    }

    /// Its Ethernet side; `None` where there is none.
    fn ethernet(&self) -> Option<&EthernetSide> {
        None
    }

    /// The same, to open ports of it and to hand frames to them. Frames go through
    /// [`Controller::handle_ethernet_frame`](crate::controller::Controller::handle_ethernet_frame).
    fn ethernet_mut(&mut self) -> Option<&mut EthernetSide> {
        None
    }

    /// Fragments of Ethernet frames that a fault of its software has left out; none without EoE.
    fn fragments_left_out(&self) -> FragmentsLeftOut {
        FragmentsLeftOut::default()
    }

    /// The supply is gone: outputs are no longer driven. Nothing else can be done any more.
    fn stop(&mut self, _signals: &mut Signals) {}
}

/// Nothing at all behind the controller. AL status follows AL control when the SII says "device
/// emulation"; otherwise, and while it is to refuse, no request is ever answered.
#[derive(Clone, Copy, Default, Debug)]
pub struct NoFirmware;

impl Firmware for NoFirmware {
    fn start(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) {}

    fn run(&mut self, _now: Instant, _pdi: &mut Pdi<'_>) -> Option<Instant> {
        None
    }

    fn refuse(&mut self, _refusal: Option<Refusal>) {}
}
