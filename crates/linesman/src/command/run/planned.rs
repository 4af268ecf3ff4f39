//! A line that is run by a plan made beforehand: from a network configuration (ENI), or from a project
//! that chooses more than who is where.

use std::path::Path;

use linesman_config::eni::Eni;
use linesman_runtime::plan_file::PlanFile;
use linesman_runtime::run::{Choices, Wanted};

use crate::failure::Failure;
use crate::files;

/// Longest file that is looked at, in bytes.
const MAX_LEN: u64 = 256 * 1024 * 1024;

/// The plan of the file; none for a project that only says who is where: what is there is planned then.
pub(super) fn planned(path: &Path) -> Result<Option<PlanFile>, Failure> {
    let bytes = files::bytes(path, "a project or network configuration", MAX_LEN)?;
    let is_xml = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("xml"));
    if !is_xml && !Eni::is_one(&bytes) && !files::project(path)?.chooses() {
        return Ok(None);
    }
    Ok(Some(PlanFile::open(path)?))
}

/// The plan with what the command line chooses.
pub(super) fn wanted(file: PlanFile, choices: Choices) -> Wanted {
    let mut plan = file.plan;
    for device in &mut plan.devices {
        device.target = device.target.min(choices.target);
    }
    if let (Some(cycle), Some(task)) = (choices.cycle, plan.tasks.first_mut()) {
        task.cycle = cycle;
    }
    Wanted::Plan(Box::new(plan))
}
