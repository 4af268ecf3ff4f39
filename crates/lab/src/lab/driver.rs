//! Driver of the line: requests to our MainDevice or to one of others.

use linesman_config::plan::Plan;
use linesman_maindevice::ProbeRequest;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::SegmentFile;

use super::other_session::OtherSession;
use super::{Lab, LabError};
use crate::habit::Habit;
use crate::options::{Begin, LabOptions};
use crate::soem::{Hook, Order, Settings, Soem};

/// How long the line as planned is scanned at most.
const SCAN: Span = Span::s(20);

impl Lab {
    /// Starts the MainDevice of others. Its program was written for the line as planned.
    pub(super) fn start_other(&mut self, file: &SegmentFile) {
        match self.planned(file) {
            Ok(plan) => {
                let hooks = plan.devices.iter().map(|device| Hook {
                    clock: device.settings.clock.filter(|clock| clock.sync0()),
                    start_up: device.start_up.clone(),
                });
                let settings = Settings {
                    cycle: self.options.cycle,
                    ring: self.line.line.paths().count() == 2,
                    hooks: hooks.collect(),
                };
                self.plan = Some(plan);
                self.other = Some(OtherSession::new(Soem::new(self.now(), settings)));
            }
            Err(error) => self.failure = Some(error),
        }
    }

    /// The plan that a configurator makes of the line without its faults.
    fn planned(&self, file: &SegmentFile) -> Result<Plan, String> {
        let file = SegmentFile { faults: Vec::new(), ..file.clone() };
        let options = LabOptions {
            habit: Habit::Own,
            project: false,
            begin: Begin::Scan,
            ..self.options.clone()
        };
        let in_words = |error: LabError| error.to_string();
        let mut lab = Self::with_project(&file, self.project.clone(), options).map_err(in_words)?;
        let is_over = |lab: &Self| lab.inventory.is_some() || lab.failure.is_some();
        lab.run_while(SCAN, Span::ms(1), is_over).map_err(in_words)?;
        let inventory = lab.inventory.take().ok_or("the line as planned was not found")?;
        lab.make_plan(&inventory)
    }

    /// Asks for registers.
    pub(super) fn probe(&mut self, request: ProbeRequest) {
        let now = self.now();
        match &self.other {
            Some(other) => other.soem.order(Order::Probe(request)),
            None => self.session.main_mut().probe(now, request),
        }
    }

    /// Asks for an object of a SubDevice of the plan.
    pub(super) fn upload(&mut self, of: DeviceId, object: ObjectAddress) {
        let now = self.now();
        match &self.other {
            Some(other) => other.soem.order(Order::Upload(of, object)),
            None => self.session.main_mut().sdo_upload(now, of, object, false),
        }
    }

    /// Brings a SubDevice of the plan, or all, to a state and leaves it there.
    pub fn request_state(&mut self, of: Option<DeviceId>, state: AlState) {
        let now = self.now();
        match &self.other {
            Some(other) => other.soem.order(Order::State(of, state)),
            None => {
                self.session.main_mut().request_state(now, of, state);
            }
        }
    }

    /// Changes each byte of the outputs.
    pub fn change_outputs(&mut self, change: impl FnMut(&mut u8)) {
        match &self.other {
            Some(other) => other.soem.change_outputs(change),
            None => self.session.main_mut().outputs_mut().iter_mut().for_each(change),
        }
    }

    /// Brings all to a state and ends the MainDevice.
    pub fn stop_main(&mut self, down: AlState) {
        let now = self.now();
        match &self.other {
            Some(other) => other.soem.order(Order::Stop(down)),
            None => self.session.main_mut().stop(now, down),
        }
    }

    /// Starts the MainDevice again by this plan; one of others finds out by itself what it needs.
    pub fn start_main(&mut self, plan: Plan) {
        let now = self.now();
        match &mut self.other {
            Some(other) => other.soem.start(now),
            None => self.session.main_mut().start(now, plan),
        }
    }
}
