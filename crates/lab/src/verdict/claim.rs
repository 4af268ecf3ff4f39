//! Claims of a report, in the words that are compared with the truth.

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{DirectionReport, EndReport, FindingReport, PlaceReport};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::port::Port;
use linesman_proto::topology::End;

use super::site::{Site, Way};

/// How a diagnosis calls the SubDevices: by the identity of the project, unless it had none.
pub type Naming<'a> = &'a dyn Fn(DeviceId) -> DeviceId;

/// What a diagnosis says: one cause at one place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Claim {
    /// The cause.
    pub cause: FaultName,
    /// Where.
    pub site: Site,
}

impl Claim {
    /// What a finding says first.
    #[must_use]
    pub fn of(finding: &FindingReport) -> Self {
        Self { cause: finding.cause, site: Site::from(&finding.place) }
    }

    /// The same with SubDevices by the identity of the project.
    #[must_use]
    pub fn renamed(self, naming: Naming<'_>) -> Self {
        let end = |end: End<DeviceId>| match end {
            End::Controller(id, port) => End::Controller(naming(id), port),
            End::MainDevice(_) => end,
        };
        let site = match self.site {
            Site::Device(id) => Site::Device(naming(id)),
            Site::Link { a, b, way } => Site::Link { a: end(a), b: b.map(end), way },
            Site::Host | Site::Network => self.site,
        };
        Self { site, ..self }
    }

    /// What a finding says besides, best first.
    pub fn alternatives(finding: &FindingReport) -> impl Iterator<Item = Self> {
        finding.alternatives.iter().map(|other| Self {
            cause: other.cause,
            site: Site::from(other.place.as_ref().unwrap_or(&finding.place)),
        })
    }
}

impl From<&PlaceReport> for Site {
    fn from(place: &PlaceReport) -> Self {
        match place {
            PlaceReport::Link { a, b, direction, .. } => Self::Link {
                a: end(*a),
                b: b.map(end),
                way: direction.and_then(|direction| match direction {
                    DirectionReport::AToB => Some(Way::AToB),
                    DirectionReport::BToA => Some(Way::BToA),
                    DirectionReport::Both => None,
                }),
            },
            PlaceReport::Device { no, .. } => {
                DeviceId::from_no(*no).map_or(Self::Host, Self::Device)
            }
            PlaceReport::Network { .. } => Self::Network,
            PlaceReport::Host => Self::Host,
        }
    }
}

fn end(end: EndReport) -> End<DeviceId> {
    match DeviceId::from_no(end.no) {
        Some(id) => End::Controller(id, Port::from_letter(end.port).unwrap_or(Port::A)),
        None if end.port == 'B' => End::MainDevice(Path::B),
        None => End::MainDevice(Path::A),
    }
}
