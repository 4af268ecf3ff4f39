//! Names of the SubDevices for people.

use linesman_config::inventory::label;
use linesman_diagnosis::report::{DirectionReport, EndReport, PlaceReport};
use linesman_proto::address::DeviceId;

/// Labels by number ([`label`]); a SubDevice that is not among them is called by its number.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Names(Vec<Called>);

/// What one is called.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Called {
    name: String,
    label: String,
}

impl Names {
    /// From names and types, the first of number 1; either may be empty.
    pub(crate) fn new(all: impl IntoIterator<Item = (String, String)>) -> Self {
        let called = |((name, type_name), index): ((String, String), u32)| {
            let label = label(DeviceId(index), &name, &type_name);
            Called { name, label }
        };
        Self(all.into_iter().zip(0..).map(called).collect())
    }

    /// `Term 4 (EL3104)`, `SubDevice 4`, `MainDevice`.
    pub(crate) fn device(&self, no: u32) -> String {
        let Some(id) = DeviceId::from_no(no) else { return "MainDevice".to_owned() };
        self.0.get(id.index()).map_or_else(|| label(id, "", ""), |called| called.label.clone())
    }

    /// Whether any SubDevice has a name or a type.
    pub(crate) fn has_any(&self) -> bool {
        let is_told =
            |(called, index): (&Called, u32)| called.label != label(DeviceId(index), "", "");
        self.0.iter().zip(0..).any(is_told)
    }

    /// The bare name; empty when it has none.
    pub(crate) fn plain(&self, no: u32) -> &str {
        let called = DeviceId::from_no(no).and_then(|id| self.0.get(id.index()));
        called.map_or("", |called| called.name.as_str())
    }

    /// `Term 4 (EL3104) port A`, `MainDevice card A`.
    pub(crate) fn end(&self, end: EndReport) -> String {
        let kind = if end.no == 0 { "card" } else { "port" };
        format!("{} {kind} {}", self.device(end.no), end.port)
    }

    /// Place of an event in words; empty where that is not known. `no` is the number of a SubDevice.
    pub(crate) fn place_of(&self, place: Option<&PlaceReport>, no: Option<u32>) -> String {
        match (place, no) {
            (Some(place), _) => self.place(place),
            (None, Some(no)) => self.device(no),
            (None, None) => String::new(),
        }
    }

    /// A place in words.
    pub(crate) fn place(&self, place: &PlaceReport) -> String {
        match place {
            PlaceReport::Link { network: _, a, b, direction } => {
                let near = self.end(*a);
                let far =
                    b.map_or_else(|| "an end that was never seen".to_owned(), |b| self.end(b));
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
            PlaceReport::Device { network: _, no } => self.device(*no),
            PlaceReport::Network { network: 0 } => "the whole network".to_owned(),
            PlaceReport::Network { network } => format!("the whole network {network}"),
            PlaceReport::Host => "this computer".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_told_by_names_and_in_their_direction() {
        let rows = [("K1", "EK1100"), ("", ""), ("B3", "EL3104")];
        let names =
            Names::new(rows.map(|(name, type_name)| (name.to_owned(), type_name.to_owned())));
        let end = |no, port| EndReport { no, port };
        let link = |a, b, direction| PlaceReport::Link { network: 0, a, b, direction };
        let rows = [
            (
                link(end(1, 'C'), Some(end(3, 'A')), Some(DirectionReport::BToA)),
                "link B3 (EL3104) port A → K1 (EK1100) port C, in this direction",
            ),
            (
                link(end(0, 'A'), Some(end(1, 'A')), None),
                "link MainDevice card A – K1 (EK1100) port A",
            ),
            (
                link(end(2, 'B'), None, Some(DirectionReport::Both)),
                "link SubDevice 2 port B ↔ an end that was never seen, both directions",
            ),
            (PlaceReport::Device { network: 0, no: 9 }, "SubDevice 9"),
            (PlaceReport::Host, "this computer"),
        ];
        for (place, expected) in rows {
            assert_eq!(names.place(&place), expected);
        }
    }
}
