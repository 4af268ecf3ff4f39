//! How long the supply of a SubDevice that started anew was away, as its own clock tells.
//!
//! An outage on the line lasts until the links are up again, which takes them up to five seconds. The clock of the
//! controller begins when the supply is back, and does not wait for them.

use linesman_proto::register::SYSTEM_TIME;
use linesman_proto::time::Span;

use super::Fall;
use crate::finding::Evidence;
use crate::model::{NetworkModel, Seen};

/// That a supply is gone is noticed so much later at the most.
const NOTICED_LATE: Span = Span::ms(500);

/// How long it was away; `None` where the clock does not tell.
pub(super) fn away(fall: &Fall<'_>) -> Option<Span> {
    let (since, until) = (fall.began(), fall.gone?.1);
    let began = fall.device.up_time?.began_within(since.before(NOTICED_LATE), until)?;
    Some(began.since(since))
}

/// What shows that.
pub(super) fn evidence(model: &NetworkModel, fall: &Fall<'_>) -> Option<Evidence> {
    let (since, until, away) = (fall.began(), fall.gone?.1, away(fall)?);
    let text = format!(
        "the clock of {} began {:.0} ms after it was gone: its supply was back by then, and the rest of {:.0} ms its links \
         took to come up",
        model.label(fall.device.id),
        away.as_secs_f64() * 1e3,
        until.since(since).as_secs_f64() * 1e3,
    );
    let seen = Seen::new((), fall.device.up_time?.read_at(), None);
    Some(Evidence::register(fall.device.id, SYSTEM_TIME.address, &seen, text))
}
