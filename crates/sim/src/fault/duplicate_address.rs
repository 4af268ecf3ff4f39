//! `duplicate-address`: two devices answer to the same address.
//!
//! An alias is read from the EEPROM at power-on: two devices with the same one are so from the start,
//! and cannot be healed. A station address is written by a MainDevice: the second device is given that
//! of the first, as by another tool on the line. What is written to it reaches both; what is read is
//! the OR of both, and the working counter counts both.

use linesman_config::fault::FaultName;

use super::error::FaultError;
use super::source::ListedChanges;
use super::{Kind, Parameter, PlaceRule, Shape, parameter};
use crate::segment_file::FaultEntry;
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::DuplicateAddress,
    place: PlaceRule::Pair,
    parameters: &[
        Parameter {
            key: "which",
            meaning: "Which address: `station`, given to the second device while the line runs, or \
                      `alias`, in both EEPROMs from the start.",
            shape: Shape::Word { words: &["station", "alias"] },
        },
        Parameter {
            key: "alias",
            meaning: "With `alias`: the alias that both have.",
            shape: Shape::Whole { low: 1, high: 0xFFFF, default: Some(1_001) },
        },
    ],
    start: |start| {
        if start.values.text("which") == Some("alias") {
            return Ok(ListedChanges::boxed([]));
        }
        let [like, node] = start.target.nodes[..] else {
            return Err(start.error("both devices must be there".to_owned()));
        };
        let from = start.from;
        Ok(ListedChanges::boxed([(from, Change::Readdress { node, like })]))
    },
};

/// The alias that an entry gives to two devices; `None` for entries of another kind.
pub(crate) fn duplicate_alias(
    label: &str,
    entry: &FaultEntry,
) -> Result<Option<(u16, Vec<String>)>, FaultError> {
    if entry.kind != KIND.name.name() {
        return Ok(None);
    }
    let values = parameter::read(label, &KIND, &entry.parameters)?;
    let alias = values.whole("alias").unwrap_or(1_001) as u16;
    let of_alias = values.text("which") == Some("alias");
    Ok(of_alias.then(|| (alias, entry.devices.clone().unwrap_or_default())))
}
