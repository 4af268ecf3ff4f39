//! A scan on real cards: listen first, look, then address and read.

use linesman_diagnosis::{FrameSeen, HostObservation};
use linesman_link::clock::HostClock;
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::time::{Instant, Span};
use linesman_runtime::drive::{Audience, Driver};

use super::Scan;
use crate::command::driven;
use crate::failure::Failure;

/// A scan of a thousand SubDevices takes a few seconds.
const PATIENCE: Span = Span::s(60);

/// Scans the line on these cards.
pub(super) fn scan(names: &[String]) -> Result<Scan, Failure> {
    driven::refuse(names)?;
    let stop = driven::stop()?;
    let clock = HostClock::start();
    let start = clock.started_at().rfc3339();
    let mut driver = Driver::open(names, clock)?;
    let mut scanning = Scanning::default();
    let until = clock.now() + PATIENCE;
    driver.run(until, &stop, &mut scanning)?;
    let name = names.join("+");
    match scanning.result {
        Some(Ok(inventory)) => Ok(Scan { inventory, start }),
        Some(Err(failure)) => {
            Err(Failure { reason: format!("{name}: {}", failure.reason), ..failure })
        }
        None => {
            let reason = format!("{name}: the scan was ended before it was done");
            Err(Failure::new(reason, "scan again"))
        }
    }
}

/// Waits for the one result.
#[derive(Default)]
struct Scanning {
    begun: bool,
    result: Option<Result<linesman_config::inventory::Inventory, Failure>>,
}

impl Audience for Scanning {
    fn frame(&mut self, _: &FrameSeen<'_>) {}

    fn host(&mut self, _: &HostObservation) {}

    fn event(&mut self, _: Instant, event: Event, _: &mut MainDevice) {
        if let Event::Scanned(inventory) = event {
            self.result = Some(Ok(*inventory));
        } else if let Event::ScanFailed(error) = event {
            self.result = Some(Err(driven::nobody(&error)));
        }
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if !self.begun {
            self.begun = true;
            // It looks, with nothing but reads, before it writes.
            main.scan(now);
        }
        self.result.is_none()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}
