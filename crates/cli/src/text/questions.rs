//! Questions beside another MainDevice in words: how many, how it fared, and why there are none.

use linesman_diagnosis::ask::report::CarrierName;
use linesman_diagnosis::ask::{AskingReport, AskingState};
use linesman_proto::time::Instant;

use super::quantity::count;

/// The sentences.
pub(crate) fn sentences(asking: &AskingReport) -> Vec<String> {
    let mut sentences = Vec::new();
    if asking.questions.0 > 0 {
        let form = match asking.carrier {
            Some(CarrierName::Udp) => " in UDP",
            Some(CarrierName::Plain) => " as plain frames",
            None => "",
        };
        let (near, others) = (&asking.near, &asking.others);
        sentences.push(format!(
            "asked: {}{form} to {}, at most {} a second, {} answered; of its frames near a question {} of {} were lost and {} \
             late, of its others {} of {} and {}",
            count(asking.questions.0, "question"),
            count(asking.devices.0, "SubDevice"),
            asking.per_s,
            asking.answered.0,
            near.lost.0,
            near.frames.0,
            near.late.0,
            others.lost.0,
            others.frames.0,
            others.late.0,
        ));
    }
    if let Some(reason) = &asking.reason {
        let when = match (asking.state, asking.last_ns) {
            (AskingState::Stopped | AskingState::Learning, Some(last)) => {
                format!("not asked after {}", Instant::from_nanos(last.0))
            }
            _ => "not asked".to_owned(),
        };
        sentences.push(format!("{when}: {reason}"));
    }
    sentences
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn questions_are_told_with_how_the_main_device_fared() {
        let fared = |frames: u64, lost: u64| json!({ "frames": frames, "lost": lost, "late": 0 });
        let asking: AskingReport = serde_json::from_value(json!({
            "state": "stopped", "carrier": "udp", "per_s": 20, "questions": 60, "answered": 59, "devices": 6,
            "last_ns": 5_000_000_000_u64, "reason": "the MainDevice may be disturbed", "next_step": null,
            "near": fared(60, 1), "others": fared(2440, 0),
        }))
        .unwrap();
        let expected = [
            "asked: 60 questions in UDP to 6 SubDevices, at most 20 a second, 59 answered; of its frames near a question 1 of \
             60 were lost and 0 late, of its others 0 of 2440 and 0",
            "not asked after 5.000000 s: the MainDevice may be disturbed",
        ];
        assert_eq!(sentences(&asking), expected);
    }
}
