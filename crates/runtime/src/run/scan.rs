//! Scan before a run, or by itself.

use linesman_config::inventory::Inventory;
use linesman_link::error::LinkError;
use linesman_proto::time::Span;
pub use linesman_session::run::SCAN_PATIENCE as PATIENCE;

use super::note::RunError;
use crate::service_session::ServiceSession;
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
    scan_with(&mut ServiceSession::new(line, None), patience, stop)
}

/// The same of a line that is served afterwards.
///
/// # Errors
/// As [`scan`].
pub fn scan_with<L: Transport<Error = LinkError>>(
    session: &mut ServiceSession<L>,
    patience: Span,
    stop: &Stop,
) -> Result<Inventory, RunError> {
    if let Some(scanned) = session.scan(patience, stop)? {
        return scanned.map_err(|error| RunError::Scan(error.to_string()));
    }
    let why = if stop.is_set() {
        "the scan was ended before it was done".to_owned()
    } else {
        format!("the scan was not done after {patience}")
    };
    Err(RunError::Scan(format!("{why}. Do: scan again")))
}
