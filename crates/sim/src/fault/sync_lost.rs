//! `sync-lost`: the SYNC signals of a device do not reach its processor. Its controller makes them as
//! before: registers show nothing, the processor leaves OP with 0x002C after some cycles, or does not
//! get there and gives 0x002D.
//!
//! Reference: S1 9.2; ETG.1020, synchronisation.

use linesman_config::fault::FaultName;

use super::source::Listed;
use super::{Kind, PlaceRule};
use crate::wire::{Change, TimingChange};

pub(super) const KIND: Kind = Kind {
    name: FaultName::SyncLost,
    place: PlaceRule::Processor,
    parameters: &[],
    start: |start| {
        let from = start.from;
        let nodes = start.target.nodes.into_iter();
        let cut = nodes.map(|node| (from, Change::Timing { node, change: TimingChange::CutSync }));
        Ok(Listed::boxed(cut))
    },
};
