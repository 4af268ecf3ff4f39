//! A scan of a virtual segment, in virtual time.

use std::path::Path;

use linesman_lab::lab::Lab;
use linesman_lab::options::{Begin, LabOptions};
use linesman_maindevice::Event;
use linesman_proto::time::Span;

use super::Scan;
use crate::command::driven;
use crate::failure::Failure;
use crate::files;

/// Virtual seconds cost little: so many in any case, and one more for each SubDevice.
const PATIENCE_S: u64 = 60;
/// Between two looks whether it is done, on a line of usual length.
const STEP: Span = Span::ms(1);

/// Scans the segment of a file.
pub(super) fn scan(path: &Path) -> Result<Scan, Failure> {
    let file = files::segment_file(path)?;
    // Nobody asks what is wrong with the line.
    let options = LabOptions { begin: Begin::Scan, diagnosis: false, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).map_err(|error| files::in_file(path, &error))?;
    let ended = |lab: &Lab| lab.events().iter().any(|(_, event)| outcome(event).is_some());
    let patience = Span::s(PATIENCE_S + lab.segment().tree().len() as u64);
    let step = STEP.max(lab.segment().longest_way());
    lab.run_while(patience, step, ended).map_err(|error| files::in_file(path, &error))?;
    let result = lab.events().iter().find_map(|(_, event)| outcome(event));
    let inventory = result.unwrap_or_else(|| {
        let reason =
            format!("{}: the scan was not done after {patience} in virtual time", path.display());
        Err(Failure::new(reason, "this is a fault of the program, please report it with the file"))
    })?;
    Ok(Scan { inventory, start: None })
}

/// What came of the scan, once it ended.
fn outcome(event: &Event) -> Option<Result<linesman_config::inventory::Inventory, Failure>> {
    if let Event::Scanned(inventory) = event {
        Some(Ok((**inventory).clone()))
    } else if let Event::ScanFailed(error) = event {
        Some(Err(driven::nobody(error)))
    } else {
        None
    }
}
