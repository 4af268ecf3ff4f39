//! Lint of a plan: what is doubtful about it before anything is switched on.

use linesman_proto::address::DeviceId;
use linesman_proto::register::SmDirection;
use linesman_proto::sii::PortKind;
use linesman_proto::time::Span;

use super::{DevicePlan, IoAt, Plan, Task, reference};

mod hot_connect;
mod ring_clocks;

/// Share of the wire's time that cyclic frames should leave to others, in percent.
const MUCH_LOAD: f64 = 80.0;
/// Cycles that should fit into a watchdog: one that is lost, one that is late.
const WATCHDOG_CYCLES: u64 = 3;
/// Watchdog step of a controller that is told nothing: 100 µs, and 1,000 of them (S2 2.7).
const DEFAULT_DIVIDER: u16 = 2498;
/// SubDevices with outputs and inputs of one sync unit from which on a split is worth a thought.
const MANY: usize = 64;
/// Time that a SubDevice with a cable, or a terminal, delays a frame at least, in ns (SYN-17).
const CABLE_DELAY_NS: u64 = 1_000;
const EBUS_DELAY_NS: u64 = 300;

/// How bad it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Severity {
    /// Worth knowing.
    Info,
    /// It may fail.
    Warning,
    /// It cannot work.
    Error,
}

/// Something doubtful.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Doubt {
    /// How bad it is.
    pub severity: Severity,
    /// Short name that scripts can look for.
    pub name: &'static str,
    /// Whose it is, if it is one SubDevice's.
    pub device: Option<DeviceId>,
    /// What it is.
    pub text: String,
    /// What to do.
    pub advice: String,
}

impl DevicePlan {
    /// True if it has a port for a cable, or nobody says what its ports are.
    #[must_use]
    pub fn has_cable_port(&self) -> bool {
        self.ports.is_none_or(|ports| ports.0.contains(&PortKind::Mii))
    }

    /// The least time by which it delays a frame on the way out and back (SYN-17).
    #[must_use]
    pub fn least_delay(&self) -> Span {
        Span::ns(if self.has_cable_port() { CABLE_DELAY_NS } else { EBUS_DELAY_NS })
    }
}

impl Plan {
    /// Share of the wire's time that a task's frames take, in percent.
    #[must_use]
    pub fn task_load_percent(&self, task: &Task) -> f64 {
        let wire: u64 = task.frames.iter().map(|frame| frame.wire_time().as_nanos()).sum();
        wire as f64 * 100.0 / task.cycle.as_nanos().max(1) as f64
    }

    /// Share of the wire's time that all cyclic frames take, in percent.
    #[must_use]
    pub fn load_percent(&self) -> f64 {
        // A sum of nothing is -0.
        self.tasks.iter().map(|task| self.task_load_percent(task)).sum::<f64>() + 0.0
    }

    /// The least time a frame needs for the way out and back, without cables: what the SubDevices
    /// delay it.
    #[must_use]
    pub fn least_delay(&self) -> Span {
        let delays = self.devices.iter().map(|device| device.least_delay().as_nanos());
        Span::ns(delays.sum())
    }

    /// All that is doubtful, the worst first.
    #[must_use]
    pub fn doubts(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        self.power(&mut doubts);
        self.load(&mut doubts);
        for device in &self.devices {
            self.watchdog(device, &mut doubts);
            self.clock(device, &mut doubts);
        }
        self.ethernet_addresses(&mut doubts);
        self.reference(&mut doubts);
        doubts.extend(self.time_source_doubt());
        self.units(&mut doubts);
        self.ports(&mut doubts);
        self.groups(&mut doubts);
        self.ring_end(&mut doubts);
        self.ring_clocks(&mut doubts);
        doubts.sort_by_key(|doubt| std::cmp::Reverse(doubt.severity));
        doubts
    }

    fn name(&self, id: DeviceId) -> &str {
        self.device(id).map_or("", |device| device.name.as_str())
    }

    fn power(&self, doubts: &mut Vec<Doubt>) {
        for group in self.ebus_groups() {
            let overload = group.overload(|id| self.name(id).to_owned());
            doubts.extend(overload.map(|overload| Doubt {
                severity: Severity::Error,
                name: "ebus-overload",
                device: Some(overload.first),
                text: overload.text,
                advice: overload.advice,
            }));
        }
    }

    fn load(&self, doubts: &mut Vec<Doubt>) {
        let load = self.load_percent();
        if load >= MUCH_LOAD {
            doubts.push(Doubt {
                severity: if load >= 100.0 { Severity::Error } else { Severity::Warning },
                name: "load",
                device: None,
                text: format!("cyclic frames take {load:.1} % of the wire's time"),
                advice: "choose longer cycle times, or fewer PDOs".to_owned(),
            });
        }
        for task in &self.tasks {
            let wire: u64 = task.frames.iter().map(|frame| frame.wire_time().as_nanos()).sum();
            let back = Span::ns(wire + self.least_delay().as_nanos());
            if back >= task.cycle && load < 100.0 && !task.frames.is_empty() {
                doubts.push(Doubt {
                    severity: Severity::Warning,
                    name: "late-frames",
                    device: None,
                    text: format!(
                        "the frames of task \"{}\" come back after {:.1} µs at least, when the next cycle of \
                         {:.1} µs has begun",
                        task.name,
                        back.as_nanos() as f64 / 1e3,
                        task.cycle.as_nanos() as f64 / 1e3
                    ),
                    advice: "choose a longer cycle time, or split the line into two networks".to_owned(),
                });
            }
        }
    }

    /// The task that has a SubDevice's process data.
    #[must_use]
    pub fn task_of(&self, device: DeviceId) -> Option<&Task> {
        let has = |task: &&Task| task.sync_units.iter().any(|unit| unit.devices.contains(&device));
        self.tasks.iter().find(has)
    }

    fn watchdog(&self, device: &DevicePlan, doubts: &mut Vec<Doubt>) {
        let outputs = device
            .sync_managers
            .iter()
            .filter(|(_, manager)| manager.control.direction() == SmDirection::MainDeviceWrites);
        let mut outputs = outputs.map(|(_, manager)| manager.control).peekable();
        let Some(task) = self.task_of(device.id).filter(|_| outputs.peek().is_some()) else {
            return;
        };
        let chosen = device.settings.watchdog;
        if !outputs.any(|control| control.watchdog()) || chosen.process_data == Some(0) {
            doubts.push(Doubt {
                severity: Severity::Info,
                name: "no-watchdog",
                device: Some(device.id),
                text: format!(
                    "{} keeps its outputs when the MainDevice stops: no watchdog",
                    device.name
                ),
                advice: "switch its process data watchdog on, unless the device guards itself"
                    .to_owned(),
            });
            return;
        }
        let Some(steps) = chosen.process_data else { return };
        let divider = u64::from(chosen.divider.unwrap_or(DEFAULT_DIVIDER));
        let limit = Span::ns((divider + 2) * 40 * u64::from(steps));
        if limit < task.cycle * WATCHDOG_CYCLES {
            doubts.push(Doubt {
                severity: Severity::Warning,
                name: "watchdog-short",
                device: Some(device.id),
                text: format!(
                    "the watchdog of {} runs out after {:.1} ms, its task has a cycle of {:.1} ms",
                    device.name,
                    limit.as_nanos() as f64 / 1e6,
                    task.cycle.as_nanos() as f64 / 1e6
                ),
                advice: "let it last for three cycles at least".to_owned(),
            });
        }
    }

    fn clock(&self, device: &DevicePlan, doubts: &mut Vec<Doubt>) {
        let Some(clock) = &device.settings.clock else { return };
        let Some(task) = self.task_of(device.id) else { return };
        let (sync0, cycle) = (clock.sync0_cycle.as_nanos(), task.cycle.as_nanos());
        let even = sync0 > 0 && (sync0.is_multiple_of(cycle) || cycle.is_multiple_of(sync0));
        if clock.sync0() && !even {
            doubts.push(Doubt {
                severity: Severity::Warning,
                name: "sync0-uneven",
                device: Some(device.id),
                text: format!(
                    "SYNC0 of {} comes every {:.3} ms, its task every {:.3} ms: neither divides the other",
                    device.name,
                    sync0 as f64 / 1e6,
                    cycle as f64 / 1e6
                ),
                advice: "make one a multiple of the other".to_owned(),
            });
        }
        if clock.sync0() && task.io_at == IoAt::TaskEnd {
            doubts.push(Doubt {
                severity: Severity::Info,
                name: "sync-at-task-end",
                device: Some(device.id),
                text: format!(
                    "{} is clocked, and its frames leave when the application has finished: they jitter \
                     with it",
                    device.name
                ),
                advice: "send at the begin of the task (`io_at = \"task-begin\"`)".to_owned(),
            });
        }
    }

    /// Of couplers only newer ones have a clock that others can follow.
    fn reference(&self, doubts: &mut Vec<Doubt>) {
        let reference = self.reference_clock().and_then(|id| self.device(id));
        let Some(device) = reference else { return };
        let revision = device.identity.revision;
        if reference::is_possible(&device.type_name, revision) {
            return;
        }
        let (revision, since) = (revision >> 16, reference::since(&device.type_name).unwrap_or(0));
        doubts.push(Doubt {
            severity: Severity::Warning,
            name: "reference-clock",
            device: Some(device.id),
            text: format!(
                "{} is the reference clock, and is planned with revision {revision:04}: an {} can be that from \
                 revision {since:04} on",
                device.name, device.type_name
            ),
            advice: "take a newer one, or let another SubDevice near the MainDevice be the reference clock \
                     (`clock = { reference = true }`)"
                .to_owned(),
        });
    }

    fn units(&self, doubts: &mut Vec<Doubt>) {
        for task in &self.tasks {
            for unit in task.sync_units.iter().filter(|unit| unit.devices.len() > MANY) {
                doubts.push(Doubt {
                    severity: Severity::Info,
                    name: "sync-units",
                    device: None,
                    text: format!(
                        "{} SubDevices share sync unit {} of task \"{}\": when one of them is missing, the \
                         inputs of all in its datagram are held back",
                        unit.devices.len(),
                        unit.name,
                        task.name
                    ),
                    advice: "put what works closely together into one sync unit, and what is independent \
                             into another"
                        .to_owned(),
                });
            }
        }
    }
}
