//! Places of a segment in words, as files and commands write them.

use linesman_proto::address::DeviceId;
use linesman_proto::topology::End;
use linesman_sim::segment::Segment;
use linesman_sim::truth::Place;

/// What the devices of a segment are called.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Names(Vec<String>);

impl Names {
    /// Those of a segment, devices that are missing included.
    #[must_use]
    pub fn of(segment: &Segment) -> Self {
        let names = (0..).map(|index| segment.name(DeviceId(index)).to_owned());
        Self(names.take_while(|name| !name.is_empty()).collect())
    }

    /// A device's name; empty for one that was never planned.
    #[must_use]
    pub fn device(&self, device: DeviceId) -> &str {
        self.0.get(device.index()).map_or("", String::as_str)
    }

    /// Links as `K1.C-B3.A`, directions as `K1.C>B3.A`, devices by name, cards as `maindevice.A`.
    #[must_use]
    pub fn place(&self, place: &Place) -> String {
        let end = |end: &End<DeviceId>| match end {
            End::MainDevice(path) => format!("maindevice.{path}"),
            End::Controller(id, port) => format!("{}.{port}", self.device(*id)),
        };
        match place {
            Place::Direction(from, to) => format!("{}>{}", end(from), end(to)),
            Place::Link(one, other) => format!("{}-{}", end(one), end(other)),
            Place::Device(id) => self.device(*id).to_owned(),
            Place::Host(path) => format!("maindevice.{path}"),
        }
    }
}
