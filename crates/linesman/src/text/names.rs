//! What people call the SubDevices.

use linesman_config::inventory::label;
use linesman_diagnosis::report::{DirectionReport, EndReport, PlaceReport};
use linesman_proto::address::DeviceId;

/// Names by number; a SubDevice without one is called by its number alone.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Names(Vec<String>);

impl Names {
    /// `names[0]` is number 1.
    pub(crate) fn new(names: impl IntoIterator<Item = String>) -> Self {
        Self(names.into_iter().collect())
    }

    /// `14 (B3)`, `14`, `MainDevice`.
    pub(crate) fn device(&self, no: u32) -> String {
        let index = (no as usize).checked_sub(1);
        match index.map(|index| self.0.get(index).map_or("", String::as_str)) {
            None => "MainDevice".to_owned(),
            Some("") => no.to_string(),
            // What files without names call them.
            Some(name) if name == format!("SubDevice {no}") => no.to_string(),
            Some(name) => label(DeviceId(no.saturating_sub(1)), name),
        }
    }

    /// Whether any SubDevice has a name.
    pub(crate) fn has_any(&self) -> bool {
        let is_name =
            |(name, no): (&String, u32)| !name.is_empty() && *name != format!("SubDevice {no}");
        self.0.iter().zip(1..).any(is_name)
    }

    /// The bare name; empty when it has none.
    pub(crate) fn plain(&self, no: u32) -> &str {
        let index = (no as usize).checked_sub(1);
        index.and_then(|index| self.0.get(index)).map_or("", String::as_str)
    }

    /// `14 (B3) port A`, `MainDevice card A`.
    pub(crate) fn end(&self, end: EndReport) -> String {
        let kind = if end.no == 0 { "card" } else { "port" };
        format!("{} {kind} {}", self.device(end.no), end.port)
    }

    /// A place in words.
    pub(crate) fn place(&self, place: &PlaceReport) -> String {
        match place {
            PlaceReport::Link { network: _, a, b, direction } => {
                let near = self.end(*a);
                let far =
                    b.map_or_else(|| "a far end that was never seen".to_owned(), |b| self.end(b));
                match direction {
                    Some(DirectionReport::AToB) => {
                        format!("link {near} → {far}, in this direction")
                    }
                    Some(DirectionReport::BToA) => {
                        format!("link {far} → {near}, in this direction")
                    }
                    Some(DirectionReport::Both) => format!("link {near} ↔ {far}, both directions"),
                    None => format!("link {near} – {far}"),
                }
            }
            PlaceReport::Device { network: _, no } => format!("SubDevice {}", self.device(*no)),
            PlaceReport::Network { network: 0 } => "the whole network".to_owned(),
            PlaceReport::Network { network } => format!("the whole network {network}"),
            PlaceReport::Host => "this computer".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // A saved scan calls SubDevices by number and type.
    #[test]
    fn a_name_with_its_number_is_said_once() {
        let names = ["1 (EK1100)", "1 (EL1008)", "3 (left"].map(str::to_owned);
        let names = Names::new(names);
        let said = [1, 2, 3].map(|no| names.device(no));
        assert_eq!(said, ["1 (EK1100)", "2 (1 (EL1008))", "3 (3 (left)"]);
    }

    #[test]
    fn places_are_told_by_names_and_in_their_direction() {
        let names = Names::new(["K1".to_owned(), String::new(), "B3".to_owned()]);
        let end = |no, port| EndReport { no, port };
        let link = |a, b, direction| PlaceReport::Link { network: 0, a, b, direction };
        let rows = [
            (
                link(end(1, 'C'), Some(end(3, 'A')), Some(DirectionReport::BToA)),
                "link 3 (B3) port A → 1 (K1) port C, in this direction",
            ),
            (link(end(0, 'A'), Some(end(1, 'A')), None), "link MainDevice card A – 1 (K1) port A"),
            (
                link(end(2, 'B'), None, Some(DirectionReport::Both)),
                "link 2 port B ↔ a far end that was never seen, both directions",
            ),
            (PlaceReport::Device { network: 0, no: 9 }, "SubDevice 9"),
            (PlaceReport::Host, "this computer"),
        ];
        for (place, expected) in rows {
            assert_eq!(names.place(&place), expected);
        }
    }
}
