//! Scan before a run, or by itself.

use linesman_config::inventory::Inventory;
use linesman_diagnosis::{FrameSeen, HostObservation};
use linesman_link::error::LinkError;
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::time::{Instant, Span};
use linesman_session::SessionHooks;
pub use linesman_session::run::SCAN_PATIENCE as PATIENCE;

use super::note::RunError;
use crate::drive::Driver;
use crate::stop::Stop;
use crate::transport::Transport;

/// Finds out what is on a line: it gets station addresses, and keeps its states.
///
/// # Errors
/// When it does not answer, the scan is not done after `patience`, or the interface fails.
pub fn scan<L: Transport<Error = LinkError>>(
    line: L,
    patience: Span,
    stop: &Stop,
) -> Result<Inventory, RunError> {
    let settings = line.options();
    let scanning = Scanning { begun: false, result: None };
    let mut driver = Driver::new(line, settings, scanning);
    let until = driver.now() + patience;
    driver.run(until, stop)?;
    let unfinished = || {
        let why = if stop.is_set() {
            "the scan was ended before it was done".to_owned()
        } else {
            format!("the scan was not done after {patience}")
        };
        Err(RunError::Scan(format!("{why}. Do: scan again")))
    };
    driver.into_hooks().result.unwrap_or_else(unfinished)
}

/// Waits for the one result.
struct Scanning {
    begun: bool,
    result: Option<Result<Inventory, RunError>>,
}

impl SessionHooks for Scanning {
    fn frame(&mut self, _: &FrameSeen<'_>) {}

    fn host(&mut self, _: &HostObservation) {}

    fn event(&mut self, _: Instant, event: Event, _: &mut MainDevice) {
        if let Event::Scanned(inventory) = event {
            self.result = Some(Ok(*inventory));
        } else if let Event::ScanFailed(error) = event {
            self.result = Some(Err(RunError::Scan(error.to_string())));
        }
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if !std::mem::replace(&mut self.begun, true) {
            // It looks, with nothing but reads, before it writes.
            main.scan(now);
        }
        self.result.is_none()
    }
}
