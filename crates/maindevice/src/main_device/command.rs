//! The commands of the user: look, scan, start, stop, probe, SDO.

use std::sync::{Arc, Mutex};

use linesman_config::plan::{Plan, TimeSource};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Instant;

use super::{MainDevice, RunningPlan};
use crate::cyclic::Cyclic;
use crate::event::Event;
use crate::exchange::Target;
use crate::executor::{Handle, Wire, lock};
use crate::mailbox::queue::Pending;
use crate::mailbox::{MailboxQueues, MailboxRequest, ProtocolError, ProtocolErrors};
use crate::network_group::NetworkGroup;
use crate::procedure::scan::ScanCache;
use crate::procedure::{read_only_scan, scan, state};
use crate::service::{self, Service, ServiceContext, ServiceFailure, ServiceOnly, ServiceTicket};
use crate::supervisor::{self, Context, DeviceTable, loop_control};
use crate::watch::NetworkStatus;

/// One register access beside the cycle, for those who want to know more.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProbeRequest {
    /// Whom.
    pub target: Target,
    /// From where.
    pub register: RegisterAddress,
    /// Bytes to be read; with `write`, its length counts.
    pub len: u16,
    /// What is written, if it is a write. Whoever asks for it answers for what it does.
    pub write: Option<Vec<u8>>,
}

impl MainDevice {
    /// Looks at the line: nothing but reads. Ends in [`Event::ReadOnlyScanned`] or [`Event::ReadOnlyScanFailed`]. Runs
    /// beside whatever else is going on.
    pub fn read_only_scan(&mut self, now: Instant) {
        let (wire, network) = (self.aside.clone(), self.network);
        self.aside.spawn(async move {
            wire.emit(match read_only_scan::scan(wire.clone(), network, true).await {
                Ok(found) => Event::ReadOnlyScanned(Box::new(found)),
                Err(error) => Event::ReadOnlyScanFailed(error),
            });
        });
        self.handle_timeout(now);
    }

    /// Finds out what is there; see [its page](crate::procedure::scan) for what it writes. Ends in
    /// [`Event::Scanned`] or [`Event::ScanFailed`]. Another command that is going on is ended.
    pub fn scan(&mut self, now: Instant) {
        let (wire, network) = (self.command(), self.network);
        let scan_cache = Arc::clone(&self.scan_cache);
        let counters = self.options.polling.reads_counters();
        wire.clone().spawn(async move {
            wire.emit(match scan::scan(wire.clone(), network, counters).await {
                Ok(inventory) => {
                    *lock(&scan_cache) = Some(ScanCache::of(&inventory, wire.now()));
                    Event::Scanned(Box::new(inventory))
                }
                Err(error) => Event::ScanFailed(error),
            });
        });
        self.handle_timeout(now);
    }

    /// Drives every SubDevice of the plan to its target and keeps it there, and exchanges process
    /// data. Another command that is going on is ended.
    ///
    /// It begins with clearing the station addresses of all SubDevices, then gives those of the plan.
    /// A SubDevice that is not who the plan says, or that the plan does not have, is left alone.
    pub fn start(&mut self, now: Instant, mut plan: Plan) {
        let scan_cache = lock(&self.scan_cache).take();
        let wire = self.command();
        let follows = self.join_group(&mut plan);
        // Those that come behind it in its group may begin.
        self.turn = None;
        let plan = Arc::new(plan);
        let mut device_table = DeviceTable::new(&plan);
        device_table.set_hold(self.options.hold_at);
        let device_table = Arc::new(Mutex::new(device_table));
        let with_mailbox = plan.devices.iter().filter(|device| device.mailbox.is_some());
        let mailboxes = MailboxQueues::of(with_mailbox.map(|device| device.id));
        let context = Context {
            wire: wire.clone(),
            network: self.network,
            plan: Arc::clone(&plan),
            device_table: Arc::clone(&device_table),
            options: Arc::clone(&self.options),
            mailboxes: mailboxes.clone(),
            bad_rounds: Arc::default(),
            follows: follows.clone(),
        };
        wire.spawn(supervisor::supervise(context, scan_cache));
        let allowed = self.options.allowed_misses;
        let (shared, known) = (Arc::clone(&plan), Arc::clone(&device_table));
        let mut cyclic = Cyclic::new(shared, known, &mut self.exchange, allowed, now);
        cyclic.serve(mailboxes.clone());
        cyclic.lead_reference(follows, self.options.clock_epoch);
        cyclic.lead_group(self.lead.clone());
        let mut network_status = NetworkStatus::new(&plan);
        network_status.begin_reset();
        self.cards.locked = false;
        self.running = Some(RunningPlan { cyclic, plan, device_table, mailboxes, network_status });
        self.acyclic_left = self.options.frames_at_once;
        self.handle_timeout(now);
    }

    /// Leads its group, where that has no lead yet; else gives the group that it follows. A network without clocks does
    /// neither, nor one whose plan says whose time it has; one below an upper network only follows.
    fn join_group(&mut self, plan: &mut Plan) -> Option<NetworkGroup> {
        let group = self.options.group.as_ref()?;
        let is_below = plan.time_source == Some(TimeSource::UpperNetwork);
        if (plan.time_source.is_some() && !is_below) || plan.reference_clock().is_none() {
            self.lead = None;
            return None;
        }
        if is_below {
            self.lead = None;
        } else if self.lead.is_none() {
            self.lead = group.lead().map(Arc::new);
        }
        (self.lead.is_none() && plan.add_clock_shift()).then(|| group.clone())
    }

    /// Asks for a state of one SubDevice of the running plan, or of all; it is kept there from now on.
    /// Ends in [`Event::TargetReached`], or in the event of the step that failed. False when no plan
    /// runs, or it has no such SubDevice.
    pub fn request_state(&mut self, now: Instant, id: Option<DeviceId>, state: AlState) -> bool {
        let Some(running) = &self.running else { return false };
        let mut device_table = lock(&running.device_table);
        let asked = match id {
            Some(id) => device_table.ask_for(id, state),
            None => {
                running.plan.devices.iter().all(|device| device_table.ask_for(device.id, state))
            }
        };
        drop(device_table);
        self.handle_timeout(now);
        asked
    }

    /// True if all SubDevices of the running plan are where they shall be.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.running.as_ref().is_some_and(|running| {
            let device_table = lock(&running.device_table);
            running.plan.devices.iter().all(|device| device_table.has_reached(device.id))
        })
    }

    /// Lets SubDevices go beyond the state at which [`Options::hold_at`](crate::Options::hold_at)
    /// holds them.
    pub fn release(&mut self, now: Instant) {
        if let Some(running) = &self.running {
            lock(&running.device_table).set_hold(None);
        }
        self.handle_timeout(now);
    }

    /// Ends the exchange of process data and drives every SubDevice that is there down to `to`. Ends
    /// in [`Event::Stopped`].
    pub fn stop(&mut self, now: Instant, to: AlState) {
        let plan = self.running.as_ref().map(|running| Arc::clone(&running.plan));
        let wire = self.command();
        let options = Arc::clone(&self.options);
        wire.clone().spawn(async move {
            let devices = plan.iter().flat_map(|plan| &plan.devices);
            let steps: Vec<_> = devices
                .map(|device| {
                    let wire = wire.clone();
                    let step = state::Step {
                        to,
                        limit: options.state_timeouts.of(AlState::Op, to),
                        emulated: device.device_emulation,
                    };
                    let target = Target::Station(device.station);
                    let (plan, id) = (plan.clone(), device.id);
                    // Who does not follow was lost or refuses; the line is left all the same.
                    wire.clone().spawn(async move {
                        let _ = state::request(&wire, target, step).await;
                        let planned = plan.as_ref().and_then(|plan| Some((plan, plan.device(id)?)));
                        if let Some((plan, device)) = planned {
                            loop_control::release(&wire, plan, device).await;
                        }
                    })
                })
                .collect();
            for step in steps {
                step.await;
            }
            wire.emit(Event::Stopped);
        });
        self.handle_timeout(now);
    }

    /// Ends what is going on and gives a wire for the next command.
    fn command(&mut self) -> Wire {
        if let Some(control) = self.control.take() {
            self.executor.cancel(control.group());
        }
        self.running = None;
        self.service_only = None;
        *lock(&self.scan_cache) = None;
        self.exchange.abandon_cyclic();
        let wire = self.executor.group(self.options.repeats);
        self.control = Some(wire.clone());
        wire
    }

    /// Runs a procedure beside all else, in the gaps of the cycle; what it gives is fetched from the
    /// handle. Commands do not end it.
    pub fn perform<T, F>(&mut self, now: Instant, procedure: impl FnOnce(Wire) -> F) -> Handle<T>
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let handle = self.aside.spawn(procedure(self.aside.clone()));
        self.handle_timeout(now);
        handle
    }

    /// One register access beside all else. Ends in [`Event::Probed`]; whoever sees the frames sees
    /// the answer there, too.
    pub fn probe(&mut self, now: Instant, request: ProbeRequest) {
        let wire = self.aside.clone();
        self.aside.spawn(async move {
            let ProbeRequest { target, register, len, .. } = request;
            let result = match &request.write {
                Some(data) => wire.write(target, register, data).await,
                None => wire.read(target, register, len).await,
            };
            wire.emit(Event::Probed { request, result });
        });
        self.handle_timeout(now);
    }

    /// Fetches an object of a running SubDevice. Ends in [`Event::SdoUploaded`].
    pub fn sdo_upload(
        &mut self,
        now: Instant,
        id: DeviceId,
        object: ObjectAddress,
        complete: bool,
    ) {
        let pending = self.ask(id, MailboxRequest::Upload { object, complete });
        let wire = self.aside.clone();
        self.aside.spawn(async move {
            let result = pending.await;
            wire.emit(Event::SdoUploaded { id, object, result });
        });
        self.handle_timeout(now);
    }

    /// Brings an object to a running SubDevice. Ends in [`Event::SdoDownloaded`].
    pub fn sdo_download(
        &mut self,
        now: Instant,
        id: DeviceId,
        object: ObjectAddress,
        complete: bool,
        data: &[u8],
    ) {
        let data = data.to_vec();
        let pending = self.ask(id, MailboxRequest::Download { object, complete, data });
        let wire = self.aside.clone();
        self.aside.spawn(async move {
            let result = pending.await.map(|_| ());
            wire.emit(Event::SdoDownloaded { id, object, result });
        });
        self.handle_timeout(now);
    }

    /// Serves the SubDevices of a plan without driving them: each stays in its state until a
    /// [`Service`] takes it elsewhere. Another command that is going on is ended.
    pub fn serve_only(&mut self, now: Instant, plan: Plan) {
        let wire = self.command();
        self.service_only = Some(ServiceOnly::new(&wire, self.network, plan, &self.options));
        self.handle_timeout(now);
    }

    /// Does one service for a SubDevice, beside all else. Ends in [`Event::Served`].
    pub fn serve(&mut self, now: Instant, id: DeviceId, service: Service) -> ServiceTicket {
        let ticket = ServiceTicket(self.next_service);
        self.next_service += 1;
        let wire = self.aside.clone();
        let context = self.context();
        self.aside.spawn(async move {
            let result = match context {
                Some(context) => service::perform(&context, id, service).await,
                None => Err(ServiceFailure::Unknown { id }),
            };
            wire.emit(Event::Served { ticket, id, result: Box::new(result) });
        });
        self.handle_timeout(now);
        ticket
    }

    fn context(&self) -> Option<ServiceContext> {
        let (wire, options) = (self.aside.clone(), Arc::clone(&self.options));
        if let Some(RunningPlan { plan, device_table, mailboxes, .. }) = &self.running {
            let (plan, device_table, mailboxes) =
                (Arc::clone(plan), Arc::clone(device_table), mailboxes.clone());
            return Some(ServiceContext {
                wire,
                plan,
                device_table,
                mailboxes,
                driven: true,
                options,
            });
        }
        let ServiceOnly { plan, device_table, mailboxes } = self.service_only.clone()?;
        Some(ServiceContext { wire, plan, device_table, mailboxes, driven: false, options })
    }

    /// Asks a running SubDevice through its mailbox. Without a plan that runs nobody has one.
    fn ask(&self, id: DeviceId, request: MailboxRequest) -> Pending {
        let nobody = MailboxQueues::default();
        let queues = self.running.as_ref().map_or(&nobody, |running| &running.mailboxes);
        queues.ask(id, request)
    }

    /// What went wrong in the mailbox of a running SubDevice: the last error of each protocol until
    /// its next clean access, and the history. `None` for a SubDevice without a mailbox.
    #[must_use]
    pub fn protocol_errors(&self, id: DeviceId) -> Option<ProtocolErrors> {
        self.running.as_ref()?.mailboxes.errors(id)
    }

    /// The mailboxes of running SubDevices in which something went wrong so far: whose, how often, and
    /// the errors that the next clean access erases.
    #[must_use]
    pub fn mailbox_troubles(&self) -> Vec<(DeviceId, u64, Vec<ProtocolError>)> {
        self.running.as_ref().map(|running| running.mailboxes.troubles()).unwrap_or_default()
    }

    /// The states in which the SubDevices of the running plan shall be now: those of the plan unless others
    /// were asked for.
    #[must_use]
    pub fn wanted_states(&self) -> Vec<AlState> {
        self.running
            .as_ref()
            .map(|running| lock(&running.device_table).all_wanted())
            .unwrap_or_default()
    }

    /// Error and change counters of [`MainDevice::network_status`] begin at 0 again. No register is touched.
    pub fn clear_counts(&mut self) {
        if let Some(running) = &mut self.running {
            running.network_status.clear();
        }
    }
}
