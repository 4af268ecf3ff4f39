//! `mailbox-error`: the software of a device refuses SDO requests that it could serve.
//!
//! Reference: ETG.1000.6, SDO abort codes; ETG.1000.4, error replies of the mailbox.

use linesman_config::fault::FaultName;
use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::ObjectIndex;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::SoftwareFault;
use crate::device::software_fault::{RefusedWith, SdoRefusals};
use crate::seed::Seed;
use crate::wire::{Change, SoftwareChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::MailboxError,
    place: PlaceRule::Mailbox,
    parameters: &[
        Parameter {
            key: "answer",
            meaning: "What it answers: an abort of the SDO transfer, or an error reply of the mailbox.",
            shape: Shape::Word { words: &["abort", "error-reply"] },
        },
        Parameter {
            key: "code",
            meaning: "The abort code, 0x08000000 unless said; or the code of the error reply, 1 to \
                      0xFFFF, 7 unless said.",
            shape: Shape::Whole { low: 1, high: u32::MAX, default: None },
        },
        Parameter {
            key: "first_index",
            meaning: "The first object that it refuses.",
            shape: Shape::Whole { low: 0, high: 0xFFFF, default: Some(0) },
        },
        Parameter {
            key: "last_index",
            meaning: "The last object that it refuses.",
            shape: Shape::Whole { low: 0, high: 0xFFFF, default: Some(0xFFFF) },
        },
        Parameter {
            key: "share",
            meaning: "Which part of the requests for these objects it refuses, by chance.",
            shape: Shape::Number { low: 0.0, high: 1.0, default: Some(1.0) },
        },
    ],
    start: |mut start| {
        let code = start.values.whole("code");
        let answer = if start.values.text("answer") == Some("error-reply") {
            let code = code.unwrap_or(ErrorReplyCode::NoMemory.code().into());
            let code = u16::try_from(code).map_err(|_| {
                start.error("`code` of an error reply is a number from 1 to 0xFFFF".to_owned())
            })?;
            RefusedWith::ErrorReply(ErrorReplyCode::from_code(code))
        } else {
            RefusedWith::Abort(code.map_or(SdoAbortCode::GENERAL_ERROR, SdoAbortCode))
        };
        let index = |key| ObjectIndex(start.values.whole(key).unwrap_or(0) as u16);
        let (first, last) = (index("first_index"), index("last_index"));
        if first > last {
            return Err(start.error("`first_index` must not be above `last_index`".to_owned()));
        }
        let share_ppm = (start.number("share") * 1e6).round() as u32;
        let seed = Seed(start.stream.number());
        let refusals = SdoRefusals { answer, first, last, share_ppm, seed };
        let change = SoftwareChange::Begin(SoftwareFault::RefusesSdo(refusals));
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Software { node, change }))))
    },
};
