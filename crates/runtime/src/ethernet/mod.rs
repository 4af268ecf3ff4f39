//! Ethernet over EtherCAT of a running MainDevice: a virtual switch between its SubDevices and a network interface of
//! this computer.
//!
//! Reference: ETG.1000.6, EoE; S0 L2849-2897. A thread of its own has the switch and the interface (`switch_thread`). The
//! thread that runs the line only hands frames to the MainDevice and fragments back ([`VirtualEthernet`]); it waits
//! for nobody. Frames that find no room are dropped and counted, as a switch does.

mod report;
mod switch_thread;

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};

use linesman_config::plan::Plan;
use linesman_link::socket::{TapInterface, WakeHandle, Waker};
use linesman_maindevice::MainDevice;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::virtual_switch::SwitchLimits;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::MailboxType;
use linesman_proto::time::Instant;

pub use self::report::{EthernetPortReport, EthernetReport};
use self::switch_thread::SwitchThread;

/// Frames that are handed to the MainDevice between two frames on the line.
const PER_TURN: usize = 8;
/// Messages on their way to the thread of the switch.
const ROOM: usize = 4_096;
/// Frames of one SubDevice that the MainDevice has at once: one is sent, the next is ready.
const AT_ONCE: usize = 2;

/// What the thread of the switch learns.
enum SwitchInput {
    /// The plan is known: the SubDevices that speak EoE.
    Ports(Vec<PlannedPort>),
    /// What follows the mailbox header of a message that a SubDevice sent unasked.
    Message { id: DeviceId, data: Vec<u8> },
    /// What became of a frame: how many fragments, and how many repetitions; `None`: it was not sent.
    Sent { id: DeviceId, outcome: Option<[u32; 2]> },
}

/// A SubDevice that gets a port.
struct PlannedPort {
    id: DeviceId,
    name: String,
}

/// A frame for a SubDevice.
struct FrameToSend {
    id: DeviceId,
    number: u8,
    frame: Vec<u8>,
}

/// What both threads see.
#[derive(Debug, Default)]
struct SharedReport {
    report: Mutex<EthernetReport>,
    /// Messages of SubDevices that found no room on their way to the switch.
    missed: AtomicU64,
}

/// How often the counts are asked for before they are left out.
const TRIES: usize = 10_000;

impl SharedReport {
    /// The same for the thread that runs the line, which must not wait for one without its priority.
    fn try_get(&self) -> Option<EthernetReport> {
        for _ in 0..TRIES {
            if let Ok(report) = self.report.try_lock() {
                let missed = self.missed.load(Ordering::Relaxed);
                return Some(EthernetReport { missed, ..report.clone() });
            }
            std::hint::spin_loop();
        }
        None
    }

    fn get(&self) -> EthernetReport {
        let report = self.report.lock().unwrap_or_else(PoisonError::into_inner).clone();
        EthernetReport { missed: self.missed.load(Ordering::Relaxed), ..report }
    }
}

/// Counts of a switch, for whoever shows them.
#[derive(Clone, Debug, Default)]
pub struct EthernetWatch(Arc<SharedReport>);

impl EthernetWatch {
    /// What has gone through the switch so far.
    #[must_use]
    pub fn report(&self) -> EthernetReport {
        self.0.get()
    }
}

/// The switch, as the thread that runs the line knows it. With this its interface is removed.
pub struct VirtualEthernet {
    inputs: Option<SyncSender<SwitchInput>>,
    frames: Receiver<FrameToSend>,
    thread: WakeHandle,
    /// Frames on their way to SubDevices.
    pending: Vec<(ServiceTicket, DeviceId)>,
    /// What became of frames, where the thread could not be told yet: it waits for that.
    untold: Vec<(DeviceId, Option<[u32; 2]>)>,
    watch: EthernetWatch,
    /// The SubDevices of the plan were told to the thread; whether there is one that speaks EoE.
    active: Option<bool>,
}

impl VirtualEthernet {
    /// Starts the thread of a switch, with an interface of this computer or without. It is active once a plan is run in
    /// which a SubDevice speaks EoE. `wake_handle` wakes the thread that calls [`VirtualEthernet::turn`].
    ///
    /// # Errors
    /// When the system has no more threads or sockets.
    pub fn open(
        tap: Option<TapInterface>,
        limits: SwitchLimits,
        wake_handle: WakeHandle,
    ) -> io::Result<Self> {
        let waker = Waker::new()?;
        let thread = waker.wake_handle();
        let (inputs, taken) = mpsc::sync_channel(ROOM);
        let (given, frames) = mpsc::sync_channel(ROOM);
        let watch = EthernetWatch::default();
        let switch = SwitchThread::new(tap, limits, watch.clone(), given, wake_handle);
        std::thread::Builder::new()
            .name("virtual switch".to_owned())
            .spawn(move || switch.run(&waker, &taken))?;
        Ok(Self {
            inputs: Some(inputs),
            frames,
            thread,
            pending: Vec::with_capacity(ROOM),
            untold: Vec::with_capacity(ROOM),
            watch,
            active: None,
        })
    }

    /// Its counts.
    #[must_use]
    pub fn watch(&self) -> EthernetWatch {
        self.watch.clone()
    }

    /// What has gone through it; `None` where no SubDevice speaks EoE and no interface was wanted, and, which is rare, where the
    /// other thread is just counting: nobody waits for it here.
    #[must_use]
    pub fn report(&self) -> Option<EthernetReport> {
        let report = self.watch.0.try_get()?;
        (self.active == Some(true) || !report.is_idle()).then_some(report)
    }

    /// Hands frames to the MainDevice.
    pub(crate) fn turn(&mut self, now: Instant, main: &mut MainDevice) {
        if self.active.is_none() {
            let Some(plan) = main.plan() else { return };
            self.begin(plan);
        }
        if self.active == Some(false) {
            return;
        }
        while let Some((id, outcome)) = self.untold.pop() {
            if !self.try_tell(SwitchInput::Sent { id, outcome }) {
                self.untold.push((id, outcome));
                break;
            }
        }
        for _ in 0..PER_TURN {
            let Ok(FrameToSend { id, number, frame }) = self.frames.try_recv() else { return };
            // Nobody uses the port numbers of a SubDevice: 0 is the whole of it.
            let request = MailboxRequest::SendFrame { port: 0, number, frame };
            let ticket = main.serve(now, id, Service::Mailbox(request));
            self.pending.push((ticket, id));
        }
    }

    /// A plan is run: its SubDevices that speak EoE get ports.
    #[cold]
    fn begin(&mut self, plan: &Plan) {
        let ports: Vec<PlannedPort> = plan
            .ethernet_devices()
            .map(|device| PlannedPort { id: device.id, name: device.name.clone() })
            .collect();
        self.active = Some(!ports.is_empty());
        // Nothing was told before it: there is room.
        self.try_tell(SwitchInput::Ports(ports));
    }

    /// False when the thread has no room for it.
    fn try_tell(&self, input: SwitchInput) -> bool {
        let told = self.inputs.as_ref().is_some_and(|inputs| inputs.try_send(input).is_ok());
        self.thread.wake();
        told
    }

    /// A message of a SubDevice that nobody waits for. False when it is none of EoE.
    pub(crate) fn message(&mut self, id: DeviceId, kind: MailboxType, data: &mut Vec<u8>) -> bool {
        if kind != MailboxType::Eoe || self.active != Some(true) {
            return false;
        }
        if !self.try_tell(SwitchInput::Message { id, data: std::mem::take(data) }) {
            self.watch.0.missed.fetch_add(1, Ordering::Relaxed);
        }
        true
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        let Some(at) = self.pending.iter().position(|(pending, _)| *pending == ticket) else {
            return;
        };
        let (_, id) = self.pending.swap_remove(at);
        let outcome = match result {
            Ok(ServiceAnswer::Data(data)) => numbers(data),
            Ok(_) | Err(_) => None,
        };
        if !self.try_tell(SwitchInput::Sent { id, outcome }) {
            self.untold.push((id, outcome));
        }
    }
}

impl Drop for VirtualEthernet {
    fn drop(&mut self) {
        // The thread ends when nobody can tell it anything any more.
        self.inputs = None;
        self.thread.wake();
    }
}

/// The two numbers that a frame gives: fragments, and repetitions.
fn numbers(data: &[u8]) -> Option<[u32; 2]> {
    let (first, rest) = data.split_first_chunk()?;
    let (second, _) = rest.split_first_chunk()?;
    Some([u32::from_le_bytes(*first), u32::from_le_bytes(*second)])
}
