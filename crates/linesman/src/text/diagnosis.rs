//! A whole diagnosis: the verdict, what was looked at, the findings, the network in numbers.

use linesman_diagnosis::report::{Diagnosis, Verdict};

use super::finding::{Writer, tally};
use super::quantity::count;
use crate::output::wrapped;

/// The diagnosis as text.
pub(crate) fn write(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let mut text = verdict(diagnosis, writer);
    text.push_str(&network(diagnosis, writer));
    for finding in &diagnosis.findings {
        text.push('\n');
        text.push_str(&writer.finding(finding));
    }
    if !diagnosis.findings.is_empty() {
        let code = &diagnosis.findings[0].code;
        let hint = format!("\n`linesman explain {code}` says how such a finding is made.\n");
        text.push_str(&writer.paint.faint(&hint));
        if writer.timed && diagnosis.network.devices.0 > 0 && !writer.names.has_any() {
            text.push_str(&writer.paint.faint(NAMED));
        }
    }
    text
}

/// What makes numbers into names.
const NAMED: &str = "`--project machine.toml`, as `linesman scan WHERE --save machine.toml` writes it, gives the \
                     SubDevices names.\n";

fn verdict(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let paint = writer.paint;
    let (word, rest) = match diagnosis.verdict {
        Verdict::Healthy => (paint.good("HEALTHY"), "nothing is wrong with the line"),
        Verdict::Faulty => (paint.bad("FAULTY"), ""),
        Verdict::Inconclusive => {
            (paint.warning("INCONCLUSIVE"), "too little was seen to call the line healthy")
        }
    };
    let tally = tally(&diagnosis.findings);
    let parts: Vec<&str> =
        [rest, tally.as_str()].into_iter().filter(|part| !part.is_empty()).collect();
    wrapped(
        &format!("{word}  "),
        &format!("{}: {}", short(&diagnosis.source), parts.join("; ")),
        writer.width,
    )
}

/// The source without the directories of a file.
fn short(source: &str) -> &str {
    match source.split_once(':') {
        Some(("capture" | "sim", path)) => path.rsplit('/').next().unwrap_or(path),
        Some(_) | None => source,
    }
}

fn network(diagnosis: &Diagnosis, writer: &Writer<'_>) -> String {
    let network = &diagnosis.network;
    let mut parts = vec![count(network.devices.0, "SubDevice")];
    parts.extend(network.al_state_highest.as_ref().map(|state| format!("highest state {state}")));
    if writer.timed {
        parts.push(count(network.frames.0, "frame"));
        parts.push(format!(
            "{} judged, {} unanswered",
            count(network.datagrams.0, "datagram"),
            network.unanswered.0
        ));
    }
    if network.lost.0 > 0 {
        parts.push(format!("{} lost", count(network.lost.0, "frame")));
    }
    if network.damaged.0 > 0 {
        parts.push(format!("{} damaged", count(network.damaged.0, "frame")));
    }
    let mut text = wrapped("  ", &parts.join(", "), writer.width);
    if let Some(start) = &diagnosis.start {
        text.push_str(&wrapped(
            "  ",
            &format!("begun {start}; times count from there"),
            writer.width,
        ));
    }
    if !diagnosis.complete {
        let words = "the input could not be read to its end: judged as far as it goes";
        text.push_str(&wrapped("  ", &writer.paint.warning(words), writer.width));
    }
    text
}

#[cfg(test)]
mod tests {
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
        let names = Names::new(["K1".to_owned(), "B3".to_owned()]);
        let writer = Writer { names: &names, paint: Paint::PLAIN, width: 100, timed: true };
        let expected = "\
FAULTY  trace.pcapng: 1 error
  2 SubDevices, highest state OP, 40,000 frames, 20,000 datagrams judged, 3 unanswered, 1 frame lost
  the input could not be read to its end: judged as far as it goes

ERROR   H104 port-errors (over)
  where    link 1 (K1) port C → 2 (B3) port A, in this direction
  cause    cable-degraded (70 %): A cable, plug or contact is worn: symbol errors that come and go
           with movement and heat.
  or       emc-noise (20 %)
  or       receiver-damaged (10 %), SubDevice 2 (B3)
  when     from 2.000 ms to 5.000 ms, for 3.000 ms
  evidence at 2.000 ms, frame 12: invalid frames rose (2 (B3) port A, register 0x0300, 3 → 18)
  do       1. Replace the cable.
           2. Check the plugs.
  so also  S201 port-errors: link 1 (K1) port C → 2 (B3) port A, in this direction

`linesman explain H104` says how such a finding is made.
";
        assert_eq!(write(&sample(), &writer), expected);
    }

    #[test]
    fn a_healthy_line_takes_two_lines() {
        let mut diagnosis = sample();
        diagnosis.verdict = Verdict::Healthy;
        diagnosis.findings.clear();
        diagnosis.complete = true;
        let names = Names::default();
        let writer = Writer { names: &names, paint: Paint::PLAIN, width: 100, timed: true };
        let text = write(&diagnosis, &writer);
        assert!(
            text.starts_with("HEALTHY  trace.pcapng: nothing is wrong with the line\n"),
            "{text}"
        );
        assert_eq!(text.lines().count(), 2, "{text}");
    }
}
