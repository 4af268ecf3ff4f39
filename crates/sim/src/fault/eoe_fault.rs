//! `eoe-fault`: the software that carries Ethernet frames through the mailbox of a device is faulty, or short of memory. Its
//! mailbox works: messages are counted on, other protocols are served.
//!
//! `lost`, `doubled`, `out-of-order`: of the fragments that it sends, some are left out, sent twice, or sent after the next
//! one of their frame. `lost` may hit those that the MainDevice sends to it as well, or alone (`way`): they are taken out of the
//! mailbox, and no frame comes of them. `full`: it has no buffer for frames of the MainDevice, and refuses each fragment with an error reply of
//! the mailbox (0x0007, no memory left). A device that speaks no EoE shows nothing of it.
//!
//! Reference: ETG.1000.6, EoE fragment; ETG.1000.4, error replies of the mailbox.

use linesman_config::fault::FaultName;

use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape};
use crate::device::SoftwareFault;
use crate::device::software_fault::{FragmentTrouble, FragmentWay, SpoiledFragments};
use crate::seed::Seed;
use crate::wire::{Change, SoftwareChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::EoeFault,
    place: PlaceRule::Mailbox,
    parameters: &[
        Parameter {
            key: "how",
            meaning: "What becomes of fragments: left out, sent twice, sent after the next one; or `full`: those of the \
                      MainDevice are refused.",
            shape: Shape::Word { words: &["lost", "doubled", "out-of-order", "full"] },
        },
        Parameter {
            key: "share",
            meaning: "Which part of the fragments, by chance. All are refused when it is full.",
            shape: Shape::Number { low: 0.0, high: 1.0, default: Some(0.1) },
        },
        Parameter {
            key: "way",
            meaning: "Which fragments are `lost`: those that it sends, those of the MainDevice, or both. Other troubles hit \
                      those that it sends.",
            shape: Shape::Word { words: &["from-device", "to-device", "both"] },
        },
    ],
    start: |mut start| {
        let trouble = match start.values.text("how") {
            Some("doubled") => Some(FragmentTrouble::Doubled),
            Some("out-of-order") => Some(FragmentTrouble::OutOfOrder),
            Some("full") => None,
            Some(_) | None => Some(FragmentTrouble::Lost),
        };
        let way = match (trouble, start.values.text("way")) {
            (Some(FragmentTrouble::Lost), Some("both")) => None,
            (Some(FragmentTrouble::Lost), Some("to-device")) => Some(FragmentWay::ToDevice),
            _ => Some(FragmentWay::FromDevice),
        };
        let share_ppm = (start.number("share") * 1e6).round() as u32;
        let seed = Seed(start.stream.number());
        let software_fault = trouble.map_or(SoftwareFault::EoeBufferFull, |trouble| {
            SoftwareFault::SpoilsFragments(SpoiledFragments { way, trouble, share_ppm, seed })
        });
        let change = SoftwareChange::Begin(software_fault);
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        Ok(ListedChanges::boxed(nodes.map(|node| (from, Change::Software { node, change }))))
    },
};
