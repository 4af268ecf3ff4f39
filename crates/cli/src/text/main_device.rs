//! The MainDevice that drives the line in words: its name, its cycle, what it reads and what not.

use linesman_diagnosis::main_device::{Access, Certainty};
use linesman_diagnosis::report::MainDeviceReport;
use linesman_diagnosis::report::main_device::PollReport;
use linesman_proto::time::Span;

/// Registers that are named one by one.
const NAMED: usize = 6;

/// The sentences: who drives, and what it reads.
pub(crate) fn sentences(main: &MainDeviceReport) -> Vec<String> {
    let marks = main.marks.join(", ");
    let who = match main.certainty {
        Certainty::Likely => format!("driven by {}: {marks}", main.kind.name()),
        Certainty::Perhaps => format!("driven perhaps by {}: {marks} alone", main.kind.name()),
        Certainty::None => "driven by a MainDevice that is not recognised".to_owned(),
    };
    let cycle = main.cycle_ns.map(|cycle| format!("; cycle {}", Span::ns(cycle.0)));
    let mut sentences = vec![who + &cycle.unwrap_or_default()];
    let polls: Vec<String> = main.polls.iter().take(NAMED).map(poll).collect();
    let more = main.polls.len().saturating_sub(NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let never: Vec<&str> = main.never_reads.iter().map(|one| one.name.as_str()).collect();
    let reads = if polls.is_empty() {
        String::new()
    } else {
        format!("it reads {}{more}", polls.join(", "))
    };
    let never =
        if never.is_empty() { String::new() } else { format!("never read: {}", never.join(", ")) };
    let both = [reads, never].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
    if !both.is_empty() {
        sentences.push(both.join("; "));
    }
    sentences
}

/// A register that is read again and again: `AL status of all every 50 ms`.
fn poll(poll: &PollReport) -> String {
    let name = &poll.name;
    let every =
        poll.every_ns.map_or_else(String::new, |every| format!(" every {}", Span::ns(every.0)));
    match poll.how {
        Access::Broadcast => format!("{name} of all{every}"),
        Access::Station | Access::Position => format!("{name} of each{every}"),
        Access::Distributed => format!("{name} (distributed){every}"),
        Access::Cleared => format!("{name}, which it clears{every}"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_main_device_reads_from_its_name_to_what_it_never_reads() {
        let main: MainDeviceReport = serde_json::from_value(json!({
            "kind": "soem", "certainty": "likely", "cycle_ns": 4_000_000,
            "marks": ["source address 01:01:01:01:01:01", "first station address 0x1001"],
            "polls": [{ "register": 0x0130, "len": 2, "name": "AL status", "how": "broadcast", "every_ns": 50_000_000 }],
            "never_reads": [{ "register": 0x0300, "name": "error counters" }],
        }))
        .unwrap();
        let expected = [
            "driven by SOEM: source address 01:01:01:01:01:01, first station address 0x1001; cycle 4 ms",
            "it reads AL status of all every 50 ms; never read: error counters",
        ];
        assert_eq!(sentences(&main), expected);
        let unknown = MainDeviceReport {
            certainty: Certainty::None,
            cycle_ns: None,
            polls: Vec::new(),
            never_reads: Vec::new(),
            ..main.clone()
        };
        assert_eq!(sentences(&unknown), ["driven by a MainDevice that is not recognised"]);
        let perhaps = MainDeviceReport { certainty: Certainty::Perhaps, ..unknown };
        assert!(sentences(&perhaps)[0].starts_with("driven perhaps by SOEM: "), "{perhaps:?}");
    }
}
