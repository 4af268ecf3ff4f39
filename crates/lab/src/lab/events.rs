//! Events of a lab: what the MainDevice, the diagnosis and the run told.

use std::sync::Arc;

use linesman_config::inventory::Inventory;
use linesman_diagnosis::Event as FindingEvent;
use linesman_diagnosis::observe::{HostEvent, HostObservation};
use linesman_maindevice::Event;
use linesman_maindevice::watch::Watch;
use linesman_proto::address::{Network, Path};
use linesman_session::{DiagnosisInput, RunEvent};

use super::Lab;
use super::ethernet::LabSwitch;
use crate::options::Begin;

/// Number of events that are kept; the oldest go first.
const KEPT_EVENTS: usize = 10_000;

impl Lab {
    /// Takes what the session has to tell.
    pub(super) fn hear(&mut self) {
        while let Some(event) = self.other.as_ref().and_then(|other| other.soem.poll_event()) {
            self.handle_event(event);
        }
        while let Some(event) = self.session.hooks_mut().poll_event() {
            match event {
                RunEvent::Scanned(inventory) => self.handle_event(Event::Scanned(inventory)),
                RunEvent::MainDevice(_, event) => self.handle_event(*event),
                RunEvent::Finding(event) => self.keep_finding_event(*event),
                RunEvent::Planned(_)
                | RunEvent::Host(_)
                | RunEvent::AwaitsTime(..)
                | RunEvent::Leaving(_) => {}
            }
        }
        let now = self.now();
        if let Some(watch) = &mut self.watch {
            watch.handle_timeout(now);
            self.log.extend(std::iter::from_fn(|| watch.poll_entry()));
        }
        let listener = self.line.capture.listener.as_mut();
        let told: Vec<FindingEvent> = listener
            .map(|one| std::iter::from_fn(|| one.poll_event()).collect())
            .unwrap_or_default();
        told.into_iter().for_each(|event| self.keep_finding_event(event));
    }

    fn keep_finding_event(&mut self, event: FindingEvent) {
        if self.finding_events.len() >= KEPT_EVENTS {
            self.finding_events.pop_front();
        }
        self.finding_events.push_back(event);
    }

    fn handle_event(&mut self, event: Event) {
        let now = self.now();
        if let Event::Scanned(inventory) = &event {
            self.inventory = Some((**inventory).clone());
            if self.options.begin == Begin::Run {
                self.start(inventory);
            }
        }
        if let Event::ScanFailed(error) = &event {
            self.failure = Some(error.to_string());
        }
        if let Some(watch) = &mut self.watch {
            watch.handle_event(now, &event);
        }
        if let Some(switch) = &mut self.switch {
            switch.handle_event(now, &event, self.session.main_mut());
        }
        if self.events.len() >= KEPT_EVENTS {
            self.events.drain(..KEPT_EVENTS / 2);
        }
        self.events.push((now, event));
    }

    fn start(&mut self, inventory: &Inventory) {
        match self.make_plan(inventory) {
            Ok(plan) => {
                let now = self.now();
                let (run, main) = self.session.parts_mut();
                run.start(now, plan.clone(), main);
                self.watch = self.options.log.then(|| Watch::new(Arc::new(plan.clone())));
                self.switch = LabSwitch::of_plan(&plan);
                self.plan = Some(plan);
            }
            Err(error) => self.failure = Some(error),
        }
    }

    /// The host sees something of a card: of one of the segment, or of one that is not used.
    pub fn observe_host(&mut self, path: Path, what: HostEvent) {
        let (network, time) = (Network::default(), self.now());
        let observation = HostObservation { network, path, time, what };
        if let Some(listener) = &mut self.line.capture.listener {
            listener.handle_host(&observation);
        }
        self.diagnosis_input().host(&observation);
    }
}
