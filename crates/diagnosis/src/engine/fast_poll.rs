//! Fast polling of error counters for a while: where several links count errors at the same time, only
//! readings that follow each other quickly show whether they come at the same moments, from one source, or
//! each in its own time. It reads a few registers of a few SubDevices, and writes nothing.

use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::{ErrorCounter, ErrorCounters};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::background_poll::PolledRegister;
use crate::model::NetworkModel;

/// From one reading to the next. Bursts of interference follow one another in some ten milliseconds.
const EVERY: Span = Span::ms(5);
/// While nothing asks for it.
const LOOK_EVERY: Span = Span::ms(20);
/// A link counts errors while its latest rise is not older.
const RECENT: Span = Span::s(1);
/// SubDevices that are read in one turn.
const MOST: usize = 16;
/// All error counters.
pub(super) const COUNTERS: PolledRegister = (ErrorCounters::START.0, ErrorCounters::LEN as u16);

/// When the next reading is due.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct FastPoll {
    next: Instant,
    is_needed: bool,
}

impl FastPoll {
    /// When the next reading is; `None` while nothing asks for it.
    pub(super) fn next(&self) -> Option<Instant> {
        self.is_needed.then_some(self.next)
    }

    /// What is to be read now.
    pub(super) fn turn(
        &mut self,
        model: &NetworkModel,
        now: Instant,
    ) -> Vec<(DeviceId, PolledRegister)> {
        if now < self.next {
            return Vec::new();
        }
        let counting = counting(model, now);
        self.is_needed = !counting.is_empty();
        self.next = now + if self.is_needed { EVERY } else { LOOK_EVERY };
        counting.into_iter().map(|id| (id, COUNTERS)).collect()
    }
}

/// Who counts symbol errors at present, where they are on more than one link.
fn counting(model: &NetworkModel, now: Instant) -> Vec<DeviceId> {
    let Some(tree) = &model.tree else { return Vec::new() };
    let is_recent = |at: Option<Instant>| at.is_some_and(|at| now < at + RECENT);
    let mut links = Vec::new();
    let mut found = Vec::new();
    for (node, device) in model.devices.iter().enumerate() {
        if !is_recent(device.counters.last_rise()) || device.silent.is_some() {
            continue;
        }
        let counts = |port: &Port| {
            let track = device.counters.track(ErrorCounter::PhysicalLayer(*port));
            is_recent(track.and_then(|track| track.last_rise()).map(|rise| rise.at))
        };
        let before = links.len();
        links.extend(
            Port::ALL
                .into_iter()
                .filter(counts)
                .filter_map(|port| tree.link_at(End::Controller(node, port))),
        );
        if links.len() > before && found.len() < MOST {
            found.push(device.id);
        }
    }
    let is_several = links.iter().any(|link| Some(link) != links.first());
    if is_several { found } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use linesman_config::project::Project;
    use linesman_proto::address::{Network, RegisterAddress};

    use super::*;

    /// Readings of all error counters of a SubDevice, the latter with physical-layer errors on ports A and B.
    fn count_errors(model: &mut NetworkModel, id: DeviceId) {
        let mut values = [0_u8; ErrorCounters::LEN];
        for at in [Instant::ZERO, Instant::ZERO + Span::ms(1)] {
            let start = RegisterAddress(COUNTERS.0);
            model.device_mut(id).unwrap().counters.record(start, &values, at, None);
            [values[1], values[3]] = [7, 7];
        }
    }

    #[test]
    fn a_subdevice_that_nobody_planned_may_count_errors_too() {
        let text = "name = \"two of three\"\n\
                    [[device]]\nname = \"first\"\non = \"maindevice\"\n\
                    [[device]]\nname = \"second\"\non = \"first.B\"\n";
        let mut model = NetworkModel::planned(Network::default(), &Project::parse(text).unwrap());
        assert_eq!(model.tree.as_ref().unwrap().len(), 2);
        let extra = model.add_device();
        count_errors(&mut model, extra);
        let now = Instant::ZERO + Span::ms(2);
        // It hangs on no known link, so nothing says that there are several.
        assert_eq!(counting(&model, now), []);
        // What was planned is watched all the same.
        let middle = model.devices[0].id;
        count_errors(&mut model, middle);
        assert_eq!(counting(&model, now), [middle]);
        let mut watch = FastPoll::default();
        assert_eq!(watch.turn(&model, now), [(middle, COUNTERS)]);
    }
}
