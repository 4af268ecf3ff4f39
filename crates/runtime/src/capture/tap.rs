//! Tap inside a line: the interfaces of a capture by the links at which they recorded.

use std::collections::BTreeSet;

use linesman_diagnosis::observe::FrameSeen;
use linesman_diagnosis::observe::capture_probe::tap::TapWays;
use linesman_link::capture::{CaptureInterface, CaptureInterfaceId};
use linesman_proto::esl::EslRecord;

/// A tap whose cards add no record to a frame: each copy gets the record that a probe would have added.
#[derive(Clone, Default, Debug)]
pub struct CaptureTap {
    places: Vec<TapPlace>,
    ways: TapWays,
    fault: Option<TapFault>,
    /// Places whose interface had a frame, by their index.
    used: BTreeSet<usize>,
}

/// An interface at a channel.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct TapPlace {
    /// Name of the interface, or its number as Wireshark counts from 0; `None` for all.
    pub interface: Option<String>,
    /// The channel, from 0: one on each link.
    pub channel: u8,
}

/// A recording that does not fit what was said of its tap.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum TapFault {
    /// It is one of a probe that adds records.
    #[error(
        "the frames carry the records of a capture probe (ESL), which name its ports, and broadcasts tell their \
         places"
    )]
    HasRecords,
    /// Frames of an interface of which no place was said.
    #[error("it has frames of interface {0}, and nothing says where that recorded")]
    NoPlace(String),
    /// An interface that was named has no frames.
    #[error("it has no frames of an interface `{0}`; it has {1}")]
    NoInterface(String, String),
}

impl CaptureTap {
    /// A tap with these interfaces.
    #[must_use]
    pub fn new(places: Vec<TapPlace>) -> Self {
        Self { places, ..Self::default() }
    }

    /// Record of a frame that an interface saw; `None` where it is none of the tap.
    pub(super) fn record(
        &mut self,
        number: CaptureInterfaceId,
        interface: &CaptureInterface,
        seen: &FrameSeen<'_>,
    ) -> Option<EslRecord> {
        if seen.probe.is_some() {
            self.fault.get_or_insert(TapFault::HasRecords);
            return seen.probe;
        }
        let is_meant = |place: &TapPlace| {
            let Some(name) = &place.interface else { return true };
            interface.name.as_ref() == Some(name) || *name == number.0.to_string()
        };
        let Some(at) = self.places.iter().position(is_meant) else {
            self.fault.get_or_insert_with(|| TapFault::NoPlace(title(number, interface)));
            return None;
        };
        self.used.insert(at);
        Some(self.ways.record(self.places[at].channel, number.0, seen))
    }

    /// Contradiction between the whole recording, which has these interfaces, and what was said of its tap.
    #[must_use]
    pub fn fault(&self, interfaces: &[CaptureInterface]) -> Option<TapFault> {
        let unused = self.places.iter().enumerate().find(|(at, _)| !self.used.contains(at));
        let unused = unused.and_then(|(_, place)| place.interface.clone()).map(|name| {
            let all = (0..).zip(interfaces);
            let all: Vec<String> =
                all.map(|(no, interface)| title(CaptureInterfaceId(no), interface)).collect();
            TapFault::NoInterface(name, all.join(", "))
        });
        unused.or_else(|| self.fault.clone())
    }
}

/// `1 (eth0)`, or `1` without a name.
fn title(number: CaptureInterfaceId, interface: &CaptureInterface) -> String {
    match &interface.name {
        Some(name) => format!("{} ({name})", number.0),
        None => number.0.to_string(),
    }
}
