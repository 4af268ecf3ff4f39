//! The simplest segments: devices in a row.

use linesman_config::attachment::Attachment;
use linesman_proto::address::Path;
use linesman_proto::port::Port;

use super::{SegmentDevice, SegmentFile};
use crate::device::library;
use crate::hardware::PortKind;

impl SegmentFile {
    /// Devices of the library in a row, each with its name and its type. The first hangs on the
    /// MainDevice, each further one on the one before, by the first of its ports that fits. Whether
    /// they fit together is seen when the segment is built.
    #[must_use]
    pub fn in_a_row(name: &str, seed: u64, devices: &[(&str, &str)]) -> Self {
        let kinds = |type_name: &str| library::find(type_name).and_then(|kind| kind.ports().last());
        let mut on = Attachment::MainDevice(Path::A);
        let mut row = Vec::with_capacity(devices.len());
        for (at, (name, type_name)) in devices.iter().enumerate() {
            row.push(SegmentDevice::new(*name, *type_name, on.clone()));
            let next =
                devices.get(at + 1).and_then(|(_, next)| library::find(next)?.ports().next());
            let enters = next.map_or(PortKind::Mii, |ports| ports[Port::A]);
            let fits = |port: &Port| kinds(type_name).is_some_and(|ports| ports[*port] == enters);
            let port = [Port::D, Port::B, Port::C].into_iter().find(fits).unwrap_or(Port::B);
            on = Attachment::Device { name: (*name).to_owned(), port };
        }
        Self { name: name.to_owned(), seed: Some(seed), devices: row, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminals_hang_on_the_e_bus_and_couplers_on_cables() {
        let devices = [("K1", "EK1100"), ("I1", "EL1008"), ("O1", "EL2008")];
        let file = SegmentFile::in_a_row("row", 3, &devices);
        let places: Vec<_> = file.devices.iter().map(|one| one.on.to_string()).collect();
        assert_eq!(places, ["maindevice", "K1.B", "I1.B"]);
        assert_eq!(SegmentFile::parse(&file.to_toml()), Ok(file));
        let couplers = SegmentFile::in_a_row("row", 3, &[("K1", "EK1100"), ("K2", "EK1100")]);
        assert_eq!(couplers.devices[1].on.to_string(), "K1.C");
        assert!(crate::segment::Segment::build(&couplers).is_ok());
    }
}
