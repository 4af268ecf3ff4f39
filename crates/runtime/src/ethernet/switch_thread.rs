//! The thread that has the switch: frames of the interface, and of SubDevices.

use std::collections::BTreeMap;
use std::sync::PoisonError;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError};
use std::time::Instant as HostInstant;

use linesman_link::socket::{TapInterface, Waitable, WakeHandle, Waker, wait_for};
use linesman_maindevice::virtual_switch::{
    LONGEST_FRAME, SubDevicePort, SwitchLimits, SwitchPort, VirtualSwitch,
};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};

use super::report::{EthernetPortReport, EthernetReport};
use super::{AT_ONCE, EthernetWatch, FrameToSend, PlannedPort, SwitchInput};

/// Frames that are taken from the interface before others have their turn.
const PER_ROUND: usize = 64;
/// How long at most the thread sleeps: then its counts are brought up to date.
const LONGEST_SLEEP: Span = Span::s(1);
/// How long the interface is left alone after it has failed.
const REST: Span = Span::s(1);

/// A SubDevice with a port.
struct ConnectedDevice {
    name: String,
    port: SwitchPort,
    fragments: SubDevicePort,
    /// Frames that the MainDevice has.
    under_way: usize,
    frames_to: u64,
    fragments_to: u64,
    resent: u64,
    refused: u64,
}

/// The thread, and what it has.
pub(super) struct SwitchThread {
    tap: Option<TapInterface>,
    switch: VirtualSwitch,
    devices: BTreeMap<DeviceId, ConnectedDevice>,
    without_port: Vec<String>,
    /// Frames that the interface did not take.
    not_taken: u64,
    failure: Option<String>,
    watch: EthernetWatch,
    frames: SyncSender<FrameToSend>,
    line: WakeHandle,
    started: HostInstant,
}

impl SwitchThread {
    pub(super) fn new(
        tap: Option<TapInterface>,
        limits: SwitchLimits,
        watch: EthernetWatch,
        frames: SyncSender<FrameToSend>,
        line: WakeHandle,
    ) -> Self {
        let thread = Self {
            tap,
            switch: VirtualSwitch::new(limits),
            devices: BTreeMap::new(),
            without_port: Vec::new(),
            not_taken: 0,
            failure: None,
            watch,
            frames,
            line,
            started: HostInstant::now(),
        };
        thread.publish();
        thread
    }

    fn now(&self) -> Instant {
        let passed = self.started.elapsed().as_nanos();
        Instant::ZERO + Span::ns(u64::try_from(passed).unwrap_or(u64::MAX))
    }

    /// Passes frames on until nobody drives the line any more.
    pub(super) fn run(mut self, waker: &Waker, inputs: &Receiver<SwitchInput>) {
        loop {
            waker.take();
            if !self.take(inputs) {
                return;
            }
            self.receive_from_interface();
            self.send_to_interface();
            self.hand_to_devices();
            self.publish();
            let sleeps = match (&self.tap, &self.failure) {
                (Some(tap), None) => wait_for([waker as &dyn Waitable, tap], Some(LONGEST_SLEEP)),
                _ => wait_for([waker as &dyn Waitable], Some(LONGEST_SLEEP)),
            };
            if sleeps.is_err() {
                std::thread::sleep(std::time::Duration::from_nanos(REST.as_nanos()));
            }
        }
    }

    /// Takes what the line has to tell; false at its end.
    fn take(&mut self, inputs: &Receiver<SwitchInput>) -> bool {
        loop {
            match inputs.try_recv() {
                Ok(SwitchInput::Ports(ports)) => self.connect(ports),
                Ok(SwitchInput::Message { id, data }) => {
                    let now = self.now();
                    if let Some(device) = self.devices.get_mut(&id)
                        && let Some(frame) = device.fragments.handle_message(&data)
                    {
                        self.switch.handle_frame(now, device.port, frame);
                    }
                }
                Ok(SwitchInput::Sent { id, outcome }) => {
                    let Some(device) = self.devices.get_mut(&id) else { continue };
                    device.under_way = device.under_way.saturating_sub(1);
                    match outcome {
                        Some([fragments, again]) => {
                            device.frames_to += 1;
                            device.fragments_to += u64::from(fragments);
                            device.resent += u64::from(again);
                        }
                        None => device.refused += 1,
                    }
                }
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    fn connect(&mut self, ports: Vec<PlannedPort>) {
        for PlannedPort { id, name } in ports {
            match self.switch.add_port() {
                Some(port) => {
                    let fragments = SubDevicePort::default();
                    let device = ConnectedDevice {
                        name,
                        port,
                        fragments,
                        under_way: 0,
                        frames_to: 0,
                        fragments_to: 0,
                        resent: 0,
                        refused: 0,
                    };
                    self.devices.insert(id, device);
                }
                None => self.without_port.push(name),
            }
        }
    }

    fn receive_from_interface(&mut self) {
        let (Some(tap), None) = (&self.tap, &self.failure) else { return };
        let now = self.now();
        let mut buffer = [0; LONGEST_FRAME + 1];
        for _ in 0..PER_ROUND {
            match tap.receive(&mut buffer) {
                Ok(Some(len)) => {
                    let frame = buffer.get(..len).unwrap_or_default().to_vec();
                    self.switch.handle_frame(now, SwitchPort::HOST, frame);
                }
                Ok(None) => return,
                Err(error) => {
                    let name = tap.name();
                    self.failure = Some(format!(
                        "TAP interface {name}: receiving frames: {error}. Do: end other programs that change {name}, and \
                         start again"
                    ));
                    return;
                }
            }
        }
    }

    fn send_to_interface(&mut self) {
        while let Some(frame) = self.switch.poll_transmit(SwitchPort::HOST) {
            let taken = match (&self.tap, &self.failure) {
                (Some(tap), None) => tap.send(&frame),
                // Nobody is there: SubDevices have the switch for themselves.
                _ => Ok(false),
            };
            self.not_taken += u64::from(!matches!(taken, Ok(true)));
        }
    }

    /// Hands frames to the MainDevice, not many of each SubDevice at once: those of the port wait here.
    fn hand_to_devices(&mut self) {
        let mut any = false;
        for (id, device) in &mut self.devices {
            while device.under_way < AT_ONCE
                && let Some(frame) = self.switch.poll_transmit(device.port)
            {
                let number = device.fragments.next_number();
                let frame = FrameToSend { id: *id, number, frame: frame.to_vec() };
                match self.frames.try_send(frame) {
                    Ok(()) => {
                        device.under_way += 1;
                        any = true;
                    }
                    Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                        device.refused += 1;
                    }
                }
            }
        }
        if any {
            self.line.wake();
        }
    }

    fn publish(&self) {
        let host = self.switch.counts(SwitchPort::HOST);
        let port = |(id, device): (&DeviceId, &ConnectedDevice)| {
            let counts = self.switch.counts(device.port);
            let came = device.fragments.counts();
            EthernetPortReport {
                no: id.no(),
                name: device.name.clone(),
                frames_to: device.frames_to,
                fragments_to: device.fragments_to,
                frames_from: came.frames,
                fragments_from: came.fragments,
                lost: came.lost,
                resent: device.resent,
                refused: device.refused,
                dropped: counts.dropped_full,
                withheld: counts.dropped_flood + counts.malformed,
                most_waiting: counts.most_waiting,
            }
        };
        let report = EthernetReport {
            interface: self.tap.as_ref().map(|tap| tap.name().to_owned()),
            failure: self.failure.clone(),
            addresses: u32::try_from(self.switch.known_addresses(self.now())).unwrap_or(u32::MAX),
            from_host: host.received,
            to_host: host.sent - self.not_taken.min(host.sent),
            host_dropped: match self.tap {
                Some(_) => self.not_taken + host.dropped_full + host.dropped_flood + host.malformed,
                None => 0,
            },
            missed: 0,
            ports: self.devices.iter().map(port).collect(),
            without_port: self.without_port.clone(),
        };
        let mut shared = self.watch.0.report.lock().unwrap_or_else(PoisonError::into_inner);
        *shared = report;
    }
}
