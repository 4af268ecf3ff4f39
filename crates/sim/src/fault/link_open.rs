//! `link-open`: a cable or contact is interrupted, from one instant to another.

use linesman_config::fault::FaultName;

use super::source::Listed;
use super::{Kind, PlaceRule};
use crate::wire::Change;

pub(super) const KIND: Kind = Kind {
    name: FaultName::LinkOpen,
    place: PlaceRule::Link,
    parameters: &[],
    start: |start| {
        let from = start.from;
        Ok(Listed::boxed(start.target.links.into_iter().map(|link| (from, Change::Open { link }))))
    },
};
