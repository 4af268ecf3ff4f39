//! `init-refused`: a device refuses a change of state and gives a status code.

use linesman_config::fault::FaultName;
use linesman_proto::state::{AlState, AlStatusCode};

use super::source::Listed;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::Refusal;
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::InitRefused,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "to",
            meaning: "The state that it does not go to.",
            shape: Shape::Word { words: &["SAFEOP", "PREOP", "OP"] },
        },
        Parameter {
            key: "code",
            meaning: "The AL status code that it gives.",
            shape: Shape::Whole { low: 1, high: 0xFFFF, default: Some(0x001E) },
        },
    ],
    start: |start| {
        let transition_to = match start.values.text("to") {
            Some("PREOP") => AlState::PreOp,
            Some("OP") => AlState::Op,
            Some(_) | None => AlState::SafeOp,
        };
        let code = AlStatusCode(start.values.whole("code").unwrap_or(0x001E) as u16);
        let refusal = Some(Refusal { transition_to, code });
        let from = start.from;
        // Of a device with several controllers it is the first.
        let node = start.target.nodes.into_iter().take(1);
        Ok(Listed::boxed(node.map(|node| (from, Change::Refuse { node, refusal }))))
    },
};
