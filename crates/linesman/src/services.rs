//! Services for single SubDevices beside the cycle: objects, files, EEPROM, registers, states.

mod object_value;
mod order;

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::Duration;

use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure};
use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::register::AlStatus;
use linesman_proto::sii::WordAddress;
use linesman_proto::state::{AlState, AlStatusCode};

use crate::handle::{DeviceHandle, PlanId};

pub use object_value::{ObjectValue, RegisterValue};
pub(crate) use order::{ServiceOrder, ServiceOrders};

/// Why a service gave nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RequestError {
    /// The SubDevice has refused, or does not answer; the code of a refusal is in
    /// [`ServiceFailure::refusal`].
    #[error(transparent)]
    Failed(#[from] ServiceFailure),
    /// The value has another size.
    #[error(
        "expected {expected} bytes for {wanted}, received {received}. Do: ask for a type of that size, \
         or for Vec<u8>"
    )]
    Size {
        /// The type.
        wanted: &'static str,
        /// Its size, in bytes.
        expected: usize,
        /// The size of the value, in bytes.
        received: usize,
    },
    /// A text is not in UTF-8.
    #[error("received bytes that are no text in UTF-8. Do: read them as Vec<u8>")]
    NoText,
    /// The MainDevice has answered something else, which is a fault of this library.
    #[error("the MainDevice answered {0:?}. Do: report it")]
    OtherAnswer(ServiceAnswer),
    /// The line does not run any more.
    #[error("the run has ended before it was done. Do: ask again in the next run")]
    Ended,
    /// No answer in this time.
    #[error(
        "no answer after {after:?}. Do: ask while the line runs, and allow the time that the SubDevice \
         takes"
    )]
    Late {
        /// The time that was waited.
        after: Duration,
    },
    /// The handle belongs to another plan.
    #[error(
        "the SubDevice was found in {found}, and {running} runs. Do: find it with `plan.device(…)` in \
         the plan that runs"
    )]
    OtherPlan {
        /// The plan of the handle.
        found: PlanId,
        /// The plan that runs.
        running: PlanId,
    },
}

/// State of a SubDevice, as it was read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ReadState {
    /// State and error bit.
    pub status: AlStatus,
    /// The reason of an error.
    pub code: AlStatusCode,
}

/// Asks SubDevices beside the cycle, from the application or from another thread: [`Segment::services`](
/// crate::Segment::services). Copies ask the same line. The cycle waits for nobody: requests are taken once a cycle,
/// and sent in its gaps. A request that is made while the line does not run waits for the next run, or for
/// [`ServedLine::ask`](crate::ServedLine::ask).
#[derive(Clone, Debug)]
pub struct Services {
    orders: Sender<ServiceOrder>,
}

impl Services {
    pub(crate) fn new() -> (Self, Receiver<ServiceOrder>) {
        let (orders, taken) = channel();
        (Self { orders }, taken)
    }

    /// Reads an object.
    pub fn sdo_read<T: ObjectValue>(
        &self,
        device: DeviceHandle,
        index: u16,
        subindex: u8,
    ) -> PendingAnswer<T> {
        let object = ObjectAddress::new(index, subindex);
        let request = MailboxRequest::Upload { object, complete: false };
        self.ask(device, Service::Mailbox(request), |answer| T::from_bytes(&data(answer)?))
    }

    /// Writes an object.
    pub fn sdo_write<T: ObjectValue>(
        &self,
        device: DeviceHandle,
        index: u16,
        subindex: u8,
        value: &T,
    ) -> PendingAnswer<()> {
        let (object, data) = (ObjectAddress::new(index, subindex), value.to_bytes());
        let request = MailboxRequest::Download { object, complete: false, data };
        self.ask(device, Service::Mailbox(request), |_| Ok(()))
    }

    /// Reads all entries of an object in one transfer (complete access), from the number of entries on.
    pub fn sdo_read_complete(&self, device: DeviceHandle, index: u16) -> PendingAnswer<Vec<u8>> {
        let object = ObjectAddress::new(index, 0);
        let request = MailboxRequest::Upload { object, complete: true };
        self.ask(device, Service::Mailbox(request), data)
    }

    /// Writes all entries of an object in one transfer (complete access), from the number of entries on.
    pub fn sdo_write_complete(
        &self,
        device: DeviceHandle,
        index: u16,
        data: Vec<u8>,
    ) -> PendingAnswer<()> {
        let object = ObjectAddress::new(index, 0);
        let request = MailboxRequest::Download { object, complete: true, data };
        self.ask(device, Service::Mailbox(request), |_| Ok(()))
    }

    /// Reads a file by FoE; `password` is 0 for none.
    pub fn foe_read(
        &self,
        device: DeviceHandle,
        name: &str,
        password: u32,
    ) -> PendingAnswer<Vec<u8>> {
        let request = MailboxRequest::ReadFile { name: name.to_owned(), password };
        self.ask(device, Service::Mailbox(request), data)
    }

    /// Writes a file by FoE; `password` is 0 for none.
    pub fn foe_write(
        &self,
        device: DeviceHandle,
        name: &str,
        password: u32,
        data: Vec<u8>,
    ) -> PendingAnswer<()> {
        let request = MailboxRequest::WriteFile { name: name.to_owned(), password, data };
        self.ask(device, Service::Mailbox(request), |_| Ok(()))
    }

    /// Reads what the EEPROM (SII) has in use, as bytes.
    pub fn sii_read(&self, device: DeviceHandle) -> PendingAnswer<Vec<u8>> {
        self.ask(device, Service::ReadSii { whole: false }, data)
    }

    /// Writes words of the EEPROM (SII) from a word address on, two bytes a word, and reads them back. Gives how
    /// many words were different before.
    pub fn sii_write(&self, device: DeviceHandle, word: u32, data: Vec<u8>) -> PendingAnswer<u32> {
        let service = Service::WriteSii { at: WordAddress(word), data };
        self.ask(device, service, |answer| {
            let ServiceAnswer::Written { words } = answer else {
                return Err(RequestError::OtherAnswer(answer));
            };
            Ok(words)
        })
    }

    /// Reads a register of the controller; [`register`](linesman_proto::register) names them.
    pub fn register_read<T: RegisterValue>(
        &self,
        device: DeviceHandle,
        address: RegisterAddress,
    ) -> PendingAnswer<T> {
        let service = Service::ReadRegister { address, len: T::LEN };
        self.ask(device, service, |answer| T::from_bytes(&data(answer)?))
    }

    /// Reads registers of the controller, or the memory behind them: 1 to 1,486 bytes.
    pub fn register_read_bytes(
        &self,
        device: DeviceHandle,
        address: RegisterAddress,
        len: u16,
    ) -> PendingAnswer<Vec<u8>> {
        self.ask(device, Service::ReadRegister { address, len }, data)
    }

    /// Writes a register of the controller. It may stop the SubDevice: the one who asks answers for it.
    pub fn register_write<T: RegisterValue>(
        &self,
        device: DeviceHandle,
        address: RegisterAddress,
        value: T,
    ) -> PendingAnswer<()> {
        let data = value.to_bytes();
        self.ask(device, Service::WriteRegister { address, data }, |_| Ok(()))
    }

    /// Reads the state of a SubDevice.
    pub fn state(&self, device: DeviceHandle) -> PendingAnswer<ReadState> {
        self.ask(device, Service::State, read_state)
    }

    /// Takes a SubDevice to a state and keeps it there, step by step, with all that each step needs. An error that
    /// stands is acknowledged first.
    pub fn enter(&self, device: DeviceHandle, state: AlState) -> PendingAnswer<ReadState> {
        self.ask(device, Service::Enter(state), read_state)
    }

    fn ask<T>(
        &self,
        device: DeviceHandle,
        service: Service,
        convert: fn(ServiceAnswer) -> Result<T, RequestError>,
    ) -> PendingAnswer<T> {
        let (answer, answered) = channel();
        // Of a segment that is gone nobody takes it; the pending answer says so.
        let _ = self.orders.send(ServiceOrder { device, service, answer });
        PendingAnswer { answered, convert }
    }
}

fn data(answer: ServiceAnswer) -> Result<Vec<u8>, RequestError> {
    let ServiceAnswer::Data(data) = answer else { return Err(RequestError::OtherAnswer(answer)) };
    Ok(data)
}

fn read_state(answer: ServiceAnswer) -> Result<ReadState, RequestError> {
    let ServiceAnswer::State { status, code } = answer else {
        return Err(RequestError::OtherAnswer(answer));
    };
    Ok(ReadState { status, code })
}

/// An answer that is on its way.
#[derive(Debug)]
pub struct PendingAnswer<T> {
    answered: Receiver<Result<ServiceAnswer, RequestError>>,
    convert: fn(ServiceAnswer) -> Result<T, RequestError>,
}

impl<T> PendingAnswer<T> {
    /// The answer, once it is there; for an application in its cycle, which must not wait. The answer is given
    /// once.
    pub fn poll(&mut self) -> Option<Result<T, RequestError>> {
        match self.answered.try_recv() {
            Ok(answer) => Some(answer.and_then(self.convert)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(RequestError::Ended)),
        }
    }

    /// Waits for the answer so long, by the clock of the host; for another thread than that of the cycle, which it
    /// would stop.
    ///
    /// # Errors
    /// When the SubDevice refuses or does not answer, the value has another size, the run ends, or the time is over.
    pub fn wait(self, timeout: Duration) -> Result<T, RequestError> {
        match self.answered.recv_timeout(timeout) {
            Ok(answer) => answer.and_then(self.convert),
            Err(RecvTimeoutError::Timeout) => Err(RequestError::Late { after: timeout }),
            Err(RecvTimeoutError::Disconnected) => Err(RequestError::Ended),
        }
    }
}
