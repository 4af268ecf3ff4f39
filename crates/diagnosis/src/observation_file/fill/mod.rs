//! From an observation file to the line that the rules look at.

mod clock;
mod counters;
mod device;
mod main_device;
mod process_data;
mod states;

use linesman_config::project::Project;
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::mailbox::coe::{Emergency, ErrorRegister, ObjectAddress, ObjectIndex};
use linesman_proto::time::{Instant, Span};

use self::clock::Clock;
use self::device::Values;
use super::{ExchangedPart, ObservationFile, ObservedMainDevice, ObservedWorkingCounter};
use crate::line::mailbox::Refusal;
use crate::line::reported::{Outcome, Part, PartExchange, WiringBasis};
use crate::line::{Line, Seen, SharedBy};

/// Between earlier values and those of the file, since it does not say. Long enough that nothing in
/// it is taken for one event.
const WATCH: Span = Span::s(60);

/// What was read at one time.
pub(super) struct Step<'f> {
    at: Instant,
    devices: Vec<(usize, Values)>,
    main: Option<&'f ObservedMainDevice>,
    counters: Vec<(usize, &'f ObservedWorkingCounter)>,
}

impl ObservationFile {
    /// The line as the file describes it. Earlier values are at 0, the first others 60 s later.
    ///
    /// What was planned comes from `project` where there is one and it has as many devices.
    #[must_use]
    pub fn line(&self, project: Option<&Project>) -> Line {
        let own = self.project();
        let planned = project.filter(|project| project.devices.len() == own.devices.len());
        let mut line = Line::planned(Network(0), planned.unwrap_or(&own));
        let clock = Clock::of(self);
        let steps = self.steps(&clock);
        line.now = clock.end();
        let tree = line.tree.clone();
        let mut by_device: Vec<Vec<(Instant, Values)>> = vec![Vec::new(); self.devices.len()];
        for step in &steps {
            for (index, values) in &step.devices {
                by_device[*index].push((step.at, values.clone()));
            }
        }
        for (index, observed) in self.devices.iter().enumerate() {
            let Some(device) = line.device_mut(DeviceId(index as u32)) else { continue };
            if planned.is_none() {
                device.name.clone_from(&observed.name);
            }
            device.type_name = device.type_name.take().or_else(|| some_text(&observed.type_name));
            observed.teach(device, tree.as_ref(), &by_device[index], clock.end(), self.totals);
        }
        share_addresses(&mut line, clock.base());
        states::teach(&mut line, &steps);
        main_device::teach(&mut line, &steps);
        process_data::teach(self, &mut line, &steps);
        self.teach_events(&mut line, &clock);
        line.reported.kind = self.kind;
        line.reported.wiring = if planned.is_some() { WiringBasis::Told } else { self.wiring };
        // Whoever wrote the file saw a place for each of them, also for those that are silent.
        line.traffic.positions_seen = u16::try_from(line.devices.len()).unwrap_or(u16::MAX);
        line.touch();
        line
    }

    /// All that was read, in order of time.
    fn steps(&self, clock: &Clock) -> Vec<Step<'_>> {
        let own = Step {
            at: clock.base(),
            devices: self.devices.iter().map(Values::of).enumerate().collect(),
            main: self.maindevice.as_ref(),
            counters: self.working_counters.iter().enumerate().collect(),
        };
        let readings = self.readings.iter().map(|reading| Step {
            at: clock.at(reading.at, reading.at_s),
            devices: reading
                .devices
                .iter()
                .filter_map(|device| Some((self.find(&device.label()?)?, Values::read(device))))
                .collect(),
            main: reading.maindevice.as_ref(),
            counters: reading.working_counters.iter().enumerate().collect(),
        });
        let mut steps: Vec<Step<'_>> = readings.chain([own]).collect();
        steps.sort_by_key(|step| step.at);
        steps
    }

    fn teach_events(&self, line: &mut Line, clock: &Clock) {
        for one in &self.emergencies {
            let Some(code) = one.code else { continue };
            let mut data = [0; 5];
            data.iter_mut().zip(&one.data).for_each(|(to, from)| *to = *from);
            let register = ErrorRegister(one.register.unwrap_or(0));
            let emergency = Emergency { code: code.0, register, data };
            let at = clock.at(one.at, one.at_s);
            let device = self.find(&one.device).and_then(|index| line.devices.get_mut(index));
            if let Some(device) = device {
                device.record_emergency(Seen::new(emergency, at, None));
            }
        }
        for one in &self.aborts {
            let (Some(index), Some(code)) = (one.index, one.code) else { continue };
            let object = ObjectAddress { index: ObjectIndex(index.0), subindex: one.subindex };
            let refusal = Refusal::Abort { object, code: code.0, reads_whole: false };
            let at = clock.at(one.at, one.at_s);
            let device = self.find(&one.device).and_then(|index| line.devices.get_mut(index));
            if let Some(device) = device {
                device.mailbox.refusals.push_back(Seen::new(refusal, at, None));
            }
        }
        let Some(tree) = line.tree.clone() else { return };
        for one in &self.exchanges {
            let Ok((at, to)) = self.exchange_places(one, &tree) else { continue };
            let part = match one.what {
                ExchangedPart::Cable => Part::Cable,
                ExchangedPart::Device => Part::Device,
                ExchangedPart::Card => Part::Card,
            };
            let outcome = if one.moved { Outcome::Moved } else { Outcome::Stayed };
            line.reported.exchanges.push(PartExchange { part, at, to, outcome });
        }
    }
}

/// Notes who has the station address of another one.
fn share_addresses(line: &mut Line, at: Instant) {
    for index in 0..line.devices.len() {
        // 0 is the address of nobody.
        let station = line.devices[index].station.filter(|station| station.0 != 0);
        let Some(station) = station else { continue };
        let owner = line.devices[..index].iter().position(|one| one.station == Some(station));
        if let Some(owner) = owner {
            let shared = SharedBy::Reading(DeviceId(index as u32));
            line.devices[owner].shares_address(station, Seen::new(shared, at, None));
        }
    }
}

fn some_text(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}
