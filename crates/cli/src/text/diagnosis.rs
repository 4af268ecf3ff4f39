//! A whole diagnosis: the verdict, what was looked at, the findings, the network in numbers.

use linesman_diagnosis::report::second_look::{PartReport, SecondLook, SecondLookOutcome};
use linesman_diagnosis::report::{Diagnosis, Number, Verdict};

use super::finding::{Writer, tally};
use super::quantity::{count, date, grouped};
use super::{coverage, devices, main_device, questions};
use crate::command::diagnose::READINGS;
use crate::hint;
use crate::output::wrapped;

/// The diagnosis as text.
pub(crate) fn write(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let mut text = diagnosis
        .understood
        .as_ref()
        .map_or_else(String::new, |understood| super::understood::write(understood, writer));
    text.push_str(&verdict(diagnosis, writer));
    text.push_str(&network(diagnosis, writer));
    text.push_str(&coverage::write(diagnosis, writer));
    if let Some(look) = &diagnosis.second_look {
        text.push('\n');
        text.push_str(&wrapped("Second look  ", &second_look(look, writer), writer.width));
    }
    for finding in &diagnosis.findings {
        text.push('\n');
        text.push_str(&writer.finding(finding));
    }
    if !diagnosis.findings.is_empty() {
        let code = &diagnosis.findings[0].code;
        let hint = format!("\n`linesman explain {code}` says how such a finding is made.\n");
        text.push_str(&writer.paint.faint(&hint));
        let can_scan = writer.timed && !devices::is_recording(diagnosis);
        if can_scan && diagnosis.network.devices.0 > 0 && !writer.names.has_any() {
            text.push_str(&writer.paint.faint(&hint::complete(NAMED, writer.place)));
        }
    }
    text
}

/// What makes numbers into names.
const NAMED: &str = "`--project machine.toml`, as `linesman scan WHERE --save machine.toml` writes it, gives the \
                     SubDevices names.\n";

/// Outcome of an earlier finding in words.
fn second_look(look: &SecondLook, writer: &Writer<'_>) -> String {
    let part = match look.part {
        PartReport::Cable => "the cable",
        PartReport::Device => "the SubDevice",
        PartReport::Card => "the network card",
    };
    let seconds = |ns: Number| ns.0 as f64 / 1e9;
    let (looked, shown) = (seconds(look.looked_ns), seconds(look.shown_after_ns));
    let place = writer.names.place(&look.place);
    let then = match look.outcome {
        SecondLookOutcome::Stayed => {
            format!("is there again: {part} that was exchanged is not it.")
        }
        SecondLookOutcome::Gone => format!(
            "did not come again in {looked:.1} s, and had shown after {shown:.1} s before: most likely it was {part}, or its \
             plugs."
        ),
        SecondLookOutcome::NotYet => format!(
            "did not come again in {looked:.1} s, which is too short, or too little was judged, to say that it \
             is gone: it had shown after {shown:.1} s before; look for {:.0} s or longer.",
            seconds(look.long_enough_ns).ceil()
        ),
    };
    format!("{} {} at {place} {then}", look.finding, look.code)
}

fn verdict(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let (paint, word) = (writer.paint, word(diagnosis.verdict));
    let word = match diagnosis.verdict {
        Verdict::Healthy => paint.good(word),
        Verdict::Faulty => paint.bad(word),
        Verdict::Inconclusive => paint.warning(word),
    };
    let source = source_name(&diagnosis.source);
    wrapped(&format!("{word}  "), &format!("{source}: {}", told(diagnosis)), writer.width)
}

/// The verdict in a word.
pub(crate) const fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Healthy => "HEALTHY",
        Verdict::Faulty => "FAULTY",
        Verdict::Inconclusive => "INCONCLUSIVE",
    }
}

/// Meaning of the verdict, and the number of findings.
pub(crate) fn told(diagnosis: &Diagnosis) -> String {
    let meaning = match diagnosis.verdict {
        Verdict::Healthy => "nothing wrong was found in what was judged",
        Verdict::Faulty => "",
        Verdict::Inconclusive => "too little was judged to call the line healthy",
    };
    let tally = tally(&diagnosis.findings);
    let parts: Vec<&str> =
        [meaning, tally.as_str()].into_iter().filter(|part| !part.is_empty()).collect();
    parts.join("; ")
}

/// Said of an input that could not be read to its end.
pub(crate) const NOT_COMPLETE: &str =
    "the input could not be read to its end: judged as far as it goes";

/// The source without the directories of a file.
pub(crate) fn source_name(source: &str) -> &str {
    match source.split_once(':') {
        Some(("capture", "-")) => "standard input",
        None if source == "-" => "standard input",
        Some(("capture" | "sim", path)) => path.rsplit('/').next().unwrap_or(path),
        Some(_) | None => source,
    }
}

/// The network in numbers, each with its unit.
pub(crate) fn numbers(diagnosis: &Diagnosis, timed: bool) -> Vec<String> {
    let network = &diagnosis.network;
    let mut parts = vec![count(network.devices.0, "SubDevice")];
    parts.extend(network.al_state_highest.as_ref().map(|state| format!("highest state {state}")));
    if timed && diagnosis.clock != READINGS {
        parts.push(count(network.frames.0, "frame"));
        parts.push(format!(
            "{} judged, {} unanswered",
            count(network.datagrams.0, "datagram"),
            grouped(network.unanswered.0)
        ));
    }
    if network.lost.0 > 0 {
        parts.push(format!("{} lost", count(network.lost.0, "frame")));
    }
    if network.damaged.0 > 0 {
        parts.push(format!("{} damaged", count(network.damaged.0, "frame")));
    }
    parts
}

fn network(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let parts = numbers(diagnosis, writer.timed);
    let mut text = wrapped("  ", &parts.join(", "), writer.width);
    for sentence in diagnosis.main_device.iter().flat_map(main_device::sentences) {
        text.push_str(&wrapped("  ", &sentence, writer.width));
    }
    for sentence in diagnosis.asking.iter().flat_map(questions::sentences) {
        text.push_str(&wrapped("  ", &sentence, writer.width));
    }
    if let Some(start) = &diagnosis.start {
        text.push_str(&wrapped(
            "  ",
            &format!("begun {}; times count from there", date(start)),
            writer.width,
        ));
    }
    if !diagnosis.complete {
        text.push_str(&wrapped("  ", &writer.paint.warning(NOT_COMPLETE), writer.width));
    }
    text
}

#[cfg(test)]
mod tests {
    use linesman_diagnosis::report::CoverageReport;
    use serde_json::json;

    use super::super::names::Names;
    use super::*;
    use crate::output::Paint;

    fn sample() -> Diagnosis {
        let finding = |id: &str, code: &str| {
            json!({
                "id": id, "code": code, "name": "port-errors", "severity": "error",
                "class": "hardware", "state": "closed", "opened_ns": 2_000_000,
                "confirmed_ns": 2_500_000, "closed_ns": 5_000_000,
                "place": { "kind": "link", "network": 0, "a": { "no": 1, "port": "C" },
                           "b": { "no": 2, "port": "A" }, "direction": "a-to-b" },
                "cause": "cable-degraded", "confidence": 0.7,
                "alternatives": [
                    { "cause": "emc-noise", "confidence": 0.2 },
                    { "cause": "receiver-damaged",
                      "place": { "kind": "device", "network": 0, "no": 2 }, "confidence": 0.1 }
                ],
                "evidence": [
                    { "kind": "register", "time_ns": 2_000_000, "frame": 12, "no": 2, "port": "A",
                      "register": 0x0300, "before": 3, "after": 18, "text": "invalid frames rose" }
                ],
                "actions": ["Replace the cable.", "Check the plugs."],
                "consequences": []
            })
        };
        let mut cause = finding("F1", "H104");
        cause["consequences"] = json!([finding("F2", "S201")]);
        serde_json::from_value(json!({
            "schema": "linesman.diagnosis/1", "tool": "linesman", "start": null, "clock": "capture",
            "source": "capture:/tmp/trace.pcapng", "complete": false, "verdict": "faulty",
            "network": { "devices": 2, "al_state_highest": "OP", "datagrams": 20_000,
                         "unanswered": 3, "frames": 40_000, "lost": 1, "damaged": 0 },
            "findings": [cause]
        }))
        .unwrap()
    }

    #[test]
    fn a_diagnosis_reads_from_verdict_to_consequence() {
        let names =
            Names::new([("K1", "EK1100"), ("B3", "")].map(|(a, b)| (a.to_owned(), b.to_owned())));
        let writer =
            Writer { names: &names, paint: Paint::PLAIN, width: 100, timed: true, place: "" };
        let expected = "\
FAULTY  trace.pcapng: 1 error
  2 SubDevices, highest state OP, 40,000 frames, 20,000 datagrams judged, 3 unanswered, 1 frame lost
  the input could not be read to its end: judged as far as it goes

ERROR   H104 port-errors (over)
  where    link K1 (EK1100) port C → B3 port A, in this direction
  cause    cable-degraded (70 %): A cable, plug or contact is worn: symbol errors that come and go
           with movement and heat.
  or       emc-noise (20 %)
  or       receiver-damaged (10 %), B3
  when     from 2.000 ms to 5.000 ms, for 3.000 ms
  evidence at 2.000 ms, frame 12: invalid frames rose (B3 port A, register 0x0300, 3 → 18)
  do       1. Replace the cable.
           2. Check the plugs.
  so also  S201 port-errors: link K1 (EK1100) port C → B3 port A, in this direction

`linesman explain H104` says how such a finding is made.
";
        assert_eq!(write(&sample(), &writer), expected);
    }

    fn coverage(extents: &[(&str, &str)]) -> CoverageReport {
        let gap = json!({
            "reason": "counters-not-read", "essential": true, "places": [],
            "text": "nobody read them", "next_step": "read them",
        });
        let subject = |(subject, extent): &(&str, &str)| {
            let gaps = if *extent == "judged" { vec![] } else { vec![gap.clone()] };
            json!({ "subject": subject, "extent": extent, "faults": [], "gaps": gaps })
        };
        let subjects: Vec<_> = extents.iter().map(subject).collect();
        serde_json::from_value(json!({ "suffices": false, "subjects": subjects })).unwrap()
    }

    #[test]
    fn inconclusive_verdict_says_what_is_missing_and_the_next_step() {
        let mut diagnosis = sample();
        diagnosis.verdict = Verdict::Inconclusive;
        diagnosis.findings.clear();
        diagnosis.complete = true;
        diagnosis.coverage = coverage(&[("frames", "judged"), ("signal-quality", "not-judged")]);
        let names = Names::default();
        let writer =
            Writer { names: &names, paint: Paint::PLAIN, width: 100, timed: true, place: "" };
        let text = write(&diagnosis, &writer);
        assert!(
            text.contains("\n  missing  nobody read them\n           do: read them\n"),
            "{text}"
        );
    }

    #[test]
    fn healthy_line_says_what_was_judged_and_what_not() {
        let mut diagnosis = sample();
        diagnosis.verdict = Verdict::Healthy;
        diagnosis.findings.clear();
        diagnosis.complete = true;
        diagnosis.coverage = coverage(&[("frames", "judged"), ("signal-quality", "not-judged")]);
        let names = Names::default();
        let writer =
            Writer { names: &names, paint: Paint::PLAIN, width: 100, timed: true, place: "" };
        let text = write(&diagnosis, &writer);
        assert!(
            text.starts_with("HEALTHY  trace.pcapng: nothing wrong was found in what was judged\n"),
            "{text}"
        );
        let rest: Vec<&str> = text.lines().skip(2).collect();
        assert_eq!(
            rest,
            ["  judged   lost frames", "  not      error counters (nobody read them)"]
        );
    }
}
