//! `init-refused`: a device refuses a step up and gives a status code, again and again or a few times.

use linesman_config::fault::FaultName;
use linesman_proto::state::{AlState, AlStatusCode};

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::Refusal;
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::InitRefused,
    place: PlaceRule::Device,
    parameters: &[
        Parameter {
            key: "to",
            meaning: "The state that it does not go up to; down it goes to any.",
            shape: Shape::Word { words: &["SAFEOP", "PREOP", "OP", "BOOT"] },
        },
        Parameter {
            key: "code",
            meaning: "The AL status code that it gives.",
            shape: Shape::Whole { low: 1, high: 0xFFFF, default: Some(0x001E) },
        },
        Parameter {
            key: "refusals",
            meaning: "How many requests it refuses before it takes one; 0 for all.",
            shape: Shape::Whole { low: 0, high: 1_000_000, default: Some(0) },
        },
    ],
    start: |start| {
        let to = start.values.text("to").and_then(AlState::from_name);
        let transition_to = to.unwrap_or(AlState::SafeOp);
        let code = AlStatusCode(start.values.whole("code").unwrap_or(0x001E) as u16);
        let times = start.values.whole("refusals").filter(|times| *times > 0);
        let refusal = Some(Refusal { transition_to, code, times });
        let from = start.from;
        // Of a device with several controllers it is the first.
        let node = start.target.nodes.into_iter().take(1);
        Ok(ListedChanges::boxed(node.map(|node| (from, Change::Refuse { node, refusal }))))
    },
};
