//! Time of a network against that of the one that leads, in a sentence.

use linesman_runtime::run::group::GroupTime;

use super::quantity::time;

/// The sentence, without its end of line.
pub(crate) fn group_time(group: &GroupTime) -> String {
    let GroupTime { leads, lead, ahead_ns } = group;
    match (leads, lead, ahead_ns) {
        (true, ..) => "This network leads the time of all networks of the run.".to_owned(),
        (false, Some(lead), Some(ahead)) => {
            let how = if *ahead < 0 { "behind" } else { "ahead of" };
            let off = time(ahead.unsigned_abs());
            format!("Its time follows that of {lead}; it is {off} {how} it.")
        }
        (false, Some(lead), None) => {
            format!("{lead} leads the time of the run; this one does not follow it yet.")
        }
        (false, None, _) => "No network leads the time of the run.".to_owned(),
    }
}
