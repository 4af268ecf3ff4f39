//! Conversion of an observation file into the model that the rules read.

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
use crate::model::mailbox::MailboxRefusal;
use crate::model::reported::{ExchangeOutcome, Part, PartExchange, WiringBasis};
use crate::model::{NetworkModel, Seen, SharedBy};

/// Between earlier values and those of the file, since it does not say. Long enough that nothing in
/// it is taken for one event.
const WATCH: Span = Span::s(60);

/// What was read at one time.
pub(super) struct TimedReading<'f> {
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
    pub fn model(&self, project: Option<&Project>) -> NetworkModel {
        let own = self.project();
        let planned = project.filter(|project| project.devices.len() == own.devices.len());
        let mut model = NetworkModel::planned(Network(0), planned.unwrap_or(&own));
        let clock = Clock::of(self);
        let steps = self.steps(&clock);
        model.now = clock.end();
        let tree = model.tree.clone();
        let mut by_device: Vec<Vec<(Instant, Values)>> = vec![Vec::new(); self.devices.len()];
        for step in &steps {
            for (index, values) in &step.devices {
                by_device[*index].push((step.at, values.clone()));
            }
        }
        for (index, observed) in self.devices.iter().enumerate() {
            let Some(device) = model.device_mut(DeviceId(index as u32)) else { continue };
            if planned.is_none() {
                device.name.clone_from(&observed.name);
            }
            device.type_name = device.type_name.take().or_else(|| some_text(&observed.type_name));
            observed.teach(device, tree.as_ref(), &by_device[index], clock.end(), self.totals);
        }
        share_addresses(&mut model, clock.base());
        states::teach(&mut model, &steps);
        main_device::teach(&mut model, &steps);
        process_data::teach(self, &mut model, &steps);
        self.teach_events(&mut model, &clock);
        model.reported.kind = self.kind;
        model.reported.wiring = if planned.is_some() { WiringBasis::Told } else { self.wiring };
        // Whoever wrote the file saw a place for each of them, also for those that are silent.
        let count = u16::try_from(model.devices.len()).unwrap_or(u16::MAX);
        model.traffic.broadcasts.record_positions(count);
        model.touch();
        model
    }

    /// All that was read, in order of time.
    fn steps(&self, clock: &Clock) -> Vec<TimedReading<'_>> {
        let own = TimedReading {
            at: clock.base(),
            devices: self.devices.iter().map(Values::of).enumerate().collect(),
            main: self.maindevice.as_ref(),
            counters: self.working_counters.iter().enumerate().collect(),
        };
        let readings = self.readings.iter().map(|reading| TimedReading {
            at: clock.at(reading.at, reading.at_s),
            devices: reading
                .devices
                .iter()
                .filter_map(|device| Some((self.find(&device.label()?)?, Values::read(device))))
                .collect(),
            main: reading.maindevice.as_ref(),
            counters: reading.working_counters.iter().enumerate().collect(),
        });
        let mut steps: Vec<TimedReading<'_>> = readings.chain([own]).collect();
        steps.sort_by_key(|step| step.at);
        steps
    }

    fn teach_events(&self, model: &mut NetworkModel, clock: &Clock) {
        for one in &self.emergencies {
            let Some(code) = one.code else { continue };
            let mut data = [0; 5];
            data.iter_mut().zip(&one.data).for_each(|(to, from)| *to = *from);
            let register = ErrorRegister(one.register.unwrap_or(0));
            let emergency = Emergency { code: code.0, register, data };
            let at = clock.at(one.at, one.at_s);
            let device = self.find(&one.device).and_then(|index| model.devices.get_mut(index));
            if let Some(device) = device {
                device.record_emergency(Seen::new(emergency, at, None));
            }
        }
        for one in &self.aborts {
            let (Some(index), Some(code)) = (one.index, one.code) else { continue };
            let object = ObjectAddress { index: ObjectIndex(index.0), subindex: one.subindex };
            let refusal = MailboxRefusal::Abort { object, code: code.0, reads_whole: false };
            let at = clock.at(one.at, one.at_s);
            let device = self.find(&one.device).and_then(|index| model.devices.get_mut(index));
            if let Some(device) = device {
                device.mailbox.refusals.push_back(Seen::new(refusal, at, None));
            }
        }
        let Some(tree) = model.tree.clone() else { return };
        for one in &self.exchanges {
            let Ok((at, to)) = self.exchange_places(one, &tree) else { continue };
            let part = match one.what {
                ExchangedPart::Cable => Part::Cable,
                ExchangedPart::Device => Part::Device,
                ExchangedPart::Card => Part::Card,
            };
            let outcome = if one.moved { ExchangeOutcome::Moved } else { ExchangeOutcome::Stayed };
            model.reported.exchanges.push(PartExchange { part, at, to, outcome });
        }
    }
}

/// Notes who has the station address of another one.
fn share_addresses(model: &mut NetworkModel, at: Instant) {
    for index in 0..model.devices.len() {
        // 0 is the address of nobody.
        let station = model.devices[index].station.filter(|station| station.0 != 0);
        let Some(station) = station else { continue };
        let owner = model.devices[..index].iter().position(|one| one.station == Some(station));
        if let Some(owner) = owner {
            let shared = SharedBy::Reading(DeviceId(index as u32));
            model.devices[owner].shares_address(station, Seen::new(shared, at, None));
        }
    }
}

fn some_text(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}
