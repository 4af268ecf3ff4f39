//! Survey of a capture: takes its frames beside a diagnosis, and reports what they show.

use std::collections::BTreeMap;

use linesman_config::profile::MappedPdo;
use linesman_diagnosis::model::NetworkModel;
use linesman_diagnosis::observe::Exchange;
use linesman_diagnosis::observe::capture_probe::ProbePort;
use linesman_diagnosis::report::Number;
use linesman_diagnosis::rule::damage_at_probe::port_place;
use linesman_diagnosis::{Engine, FrameSeen};
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::frame::FrameView;
use linesman_proto::frame::size::wire_time;
use linesman_proto::register::SmMode;
use linesman_proto::time::{Instant, Span};

use crate::access::accesses;
use crate::dialogue::Dialogue;
use crate::network::commands::CommandCounts;
use crate::network::counters::CounterPolls;
use crate::network::cyclic::{CyclicFrames, rounded};
use crate::network::report::{
    CaptureReport, MailboxesReport, NetworkSummary, ProbePortReport, RecordingReport,
    ReferenceClockReport, SCHEMA,
};
use crate::network::ring::RingLog;
use crate::network::states::{StateLog, named};
use crate::network::{devices, image, unknown};
use crate::timing::durations::{Durations, bars};
use crate::timing::report::{FrameGapReport, TimingReport};

/// Process data that come so soon after the first frame were set up before it.
const AT_ONCE: Span = Span::ms(20);
/// Most gaps that are told.
const MOST_GAPS: usize = 32;

/// Facts that frames show beside a diagnosis.
#[derive(Clone, Default, Debug)]
pub struct Survey {
    commands: CommandCounts,
    states: StateLog,
    counters: CounterPolls,
    ring: RingLog,
    cyclic: CyclicFrames,
    dialogue: Dialogue,
    responses: Durations,
    on_wire: Span,
    first: Option<Instant>,
    last: Instant,
    first_process_data: Option<Instant>,
    /// PDOs of device descriptions.
    described: BTreeMap<DeviceId, Vec<MappedPdo>>,
}

impl Survey {
    /// Takes a frame: hands it to the engine, and learns from each exchange that it completes.
    pub fn handle_frame(&mut self, engine: &mut Engine, frame: &FrameSeen<'_>) {
        if let Ok(view) = FrameView::parse(frame.bytes) {
            self.commands.frame(&view);
            self.first.get_or_insert(frame.time);
            self.last = self.last.max(frame.time);
        }
        engine
            .handle_frame_with(frame, None, &mut |model, exchange| self.exchange(model, exchange));
    }

    /// Takes the PDOs of a SubDevice by its device description, as they are assigned by default. They name its process
    /// data where the frames themselves do not, and where they fit to its SyncManagers.
    pub fn describe(&mut self, device: DeviceId, pdos: Vec<MappedPdo>) {
        self.described.insert(device, pdos);
    }

    /// The capture has ended. `complete` is whether all of it could be read.
    pub fn finish(&mut self, engine: &mut Engine, at: Instant, complete: bool) {
        engine.finish_with(at, complete, &mut |model, exchange| self.exchange(model, exchange));
    }

    fn exchange(&mut self, model: &NetworkModel, exchange: &Exchange<'_>) {
        let counted = model.traffic.broadcasts.counted();
        if let (Some(request), Some(reply), true) =
            (&exchange.request, &exchange.reply, exchange.is_last)
            && reply.time >= request.time
        {
            self.responses.record(reply.time.since(request.time));
        }
        if let Some(frame) = exchange.request.or(exchange.reply).filter(|_| exchange.is_last) {
            self.on_wire += wire_time(frame.bytes.len());
        }
        accesses(exchange, counted, |access| {
            if exchange.is_last {
                self.commands.access(access);
            }
            if matches!(access.target, crate::access::DatagramTarget::Logical(_)) {
                self.first_process_data.get_or_insert(access.at);
            }
            self.states.access(access);
            self.counters.access(access);
            self.ring.access(access);
            self.dialogue.access(model, access);
        });
        self.cyclic.exchange(exchange, counted);
    }

    /// What the frames show; `None` before the first one. Tool, source, start and interfaces are for whoever has read
    /// the file to fill in.
    #[must_use]
    pub fn report(&self, engine: &Engine) -> Option<CaptureReport> {
        let model = engine.model(Network(0))?;
        let diagnosis = engine.diagnosis();
        let recording = self.recording(model);
        let (cyclic, tasks) = self.cyclic.report(model);
        let (states, states_left_out) = self.states.report(model);
        let (transfers, transfers_left_out) = self.dialogue.report(model);
        let image = image::reports(model, &self.dialogue, &self.described);
        Some(CaptureReport {
            schema: SCHEMA.to_owned(),
            tool: diagnosis.tool,
            source: diagnosis.source,
            start: diagnosis.start,
            complete: diagnosis.complete,
            main_device: diagnosis.main_device,
            network: self.network(model),
            devices: devices::reports(model),
            links: devices::links(model),
            ring: self.ring.report(model),
            commands: self.commands.report(),
            cyclic,
            first_process_data_ns: self.first_process_data.map(|at| Number(at.as_nanos())),
            tasks,
            states,
            states_left_out,
            counters: self.counters.report(model),
            transfers,
            transfers_left_out,
            timing: self.timing(model),
            probe_ports: probe_ports(model),
            unknown: unknown::reports(model, &recording, &image),
            image,
            recording,
        })
    }

    fn recording(&self, model: &NetworkModel) -> RecordingReport {
        let traffic = &model.traffic;
        let (sent, returned) = (traffic.requests.sent(), traffic.returns.count());
        let ways = match (sent, returned) {
            (0, 0) => None,
            (_, 0) => Some("requests"),
            _ if traffic.returns.alone() == returned => Some("returns"),
            (_, _) => Some("both"),
        };
        let first = self.first.unwrap_or_default();
        let began_in_run =
            self.first_process_data.is_some_and(|process_data| process_data.since(first) < AT_ONCE);
        RecordingReport {
            frames: Number(traffic.recording.frames()),
            lasts_ns: Number(self.last.since(first).as_nanos()),
            interfaces: Vec::new(),
            ways: ways.map(str::to_owned),
            requests: Number(sent),
            returns: Number(returned),
            returns_alone: Number(traffic.returns.alone()),
            lost: Number(traffic.losses.frames().sum),
            damaged: Number(traffic.losses.damaged().sum),
            cut: Number(traffic.recording.cut()),
            foreign: Number(traffic.foreign.count()),
            senders: traffic.requests.senders().iter().map(|one| one.mac.to_string()).collect(),
            began_in_run,
        }
    }

    fn network(&self, model: &NetworkModel) -> NetworkSummary {
        NetworkSummary {
            devices: Number(model.device_count() as u64),
            al_state_highest: model.highest_state().map(|state| state.name().to_owned()),
            reference_clock: self.reference_clock(model),
            mailboxes: self.mailboxes(model),
        }
    }

    fn reference_clock(&self, model: &NetworkModel) -> Option<ReferenceClockReport> {
        let clock = self.cyclic.clock?;
        let (station, position_no) = named(clock.target);
        let device = clock.target.device(model);
        let reference =
            model.references.iter().rev().find(|reference| Some(reference.device) == device);
        Some(ReferenceClockReport {
            no: device.map(|id| id.no()).or(position_no),
            station: station.or_else(|| Some(model.device(device?)?.station?.value())),
            position_no: position_no
                .or_else(|| Some(u32::from(model.device(device?)?.position?.value()) + 1)),
            command: clock.command.name().to_owned(),
            datagrams: Number(clock.count),
            takes_part: clock.wkc,
            ppm: reference.and_then(|reference| reference.ppm()),
        })
    }

    fn mailboxes(&self, model: &NetworkModel) -> Option<MailboxesReport> {
        let is_mailbox = |device: &&linesman_diagnosis::model::Device| {
            let managers = device.set_up.sync_managers.values();
            managers.into_iter().any(|one| one.control.mode() == SmMode::Mailbox && one.is_active())
        };
        let set_up = model.devices.iter().filter(is_mailbox).count() as u16;
        let (count, by) = match (self.cyclic.status_bits, set_up, self.dialogue.mailboxes()) {
            (Some(bits), _, _) => (bits, "status-bits"),
            (None, 1.., _) => (set_up, "sync-managers"),
            (None, 0, 1..) => (self.dialogue.mailboxes() as u16, "messages"),
            (None, 0, 0) => return None,
        };
        Some(MailboxesReport { count, by: by.to_owned() })
    }

    fn timing(&self, model: &NetworkModel) -> TimingReport {
        let lasts = self.last.since(self.first.unwrap_or_default());
        let gap = |pause: linesman_diagnosis::model::Pause| FrameGapReport {
            from_ns: Number(pause.from.as_nanos()),
            to_ns: Number(pause.to.as_nanos()),
        };
        let share =
            |of: Span| rounded(of.as_nanos() as f64 * 100.0 / lasts.as_nanos() as f64).min(100.0);
        TimingReport {
            response: self.responses.report(),
            response_bars: bars(self.responses.steps().map(|(span, n)| (span.as_nanos(), n))),
            late: Number(model.round_trips.late_count),
            lost: Number(model.traffic.losses.frames().sum),
            load_percent: (lasts > Span::ZERO).then(|| share(self.on_wire)),
            gaps: model.quiet().take(MOST_GAPS).map(gap).collect(),
            clock_back_ns: Number(model.traffic.recording.clock_back().as_nanos()),
        }
    }
}
/// Ports of the capture probe that recorded the frames.
fn probe_ports(model: &NetworkModel) -> Vec<ProbePortReport> {
    let order = &model.capture_probe.order;
    let report = |port: &ProbePort| ProbePortReport {
        port: port.number,
        channel: port.number / 2,
        is_way_back: order.is_back(port.number),
        subdevices_before: order.before(port.number),
        place: port_place(model, port.number),
        frames: Number(port.frames),
        damaged: Number(port.damaged),
        marked: Number(port.marked),
    };
    order.ports().iter().map(report).collect()
}
