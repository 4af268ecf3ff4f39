//! Places of a report in words.

use std::fmt;

use super::{DirectionReport, EndReport, PlaceReport};

impl fmt::Display for PlaceReport {
    /// `link 6.C - 14.A, towards the MainDevice`, `SubDevice 7`, `network 0`, `this computer`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link { network: _, a, b, direction } => {
                write!(f, "link {a} - ")?;
                match b {
                    Some(b) => b.fmt(f)?,
                    None => f.write_str("unknown")?,
                }
                match direction {
                    Some(DirectionReport::AToB) => f.write_str(", away from the MainDevice"),
                    Some(DirectionReport::BToA) => f.write_str(", towards the MainDevice"),
                    Some(DirectionReport::Both) | None => Ok(()),
                }
            }
            Self::Device { network: _, no } => write!(f, "SubDevice {no}"),
            Self::Network { network } => write!(f, "network {network}"),
            Self::Host => f.write_str("this computer"),
        }
    }
}

impl fmt::Display for EndReport {
    /// `6.C`, `MainDevice.A`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.no {
            0 => write!(f, "MainDevice.{}", self.port),
            no => write!(f, "{no}.{}", self.port),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_written_with_numbers_ports_and_direction() {
        let (a, b) = (EndReport { no: 0, port: 'A' }, EndReport { no: 1, port: 'A' });
        let link = |b, direction| PlaceReport::Link { network: 0, a, b, direction };
        let rows = [
            (
                link(Some(b), Some(DirectionReport::BToA)),
                "link MainDevice.A - 1.A, towards the MainDevice",
            ),
            (link(None, None), "link MainDevice.A - unknown"),
            (PlaceReport::Device { network: 0, no: 7 }, "SubDevice 7"),
            (PlaceReport::Network { network: 1 }, "network 1"),
            (PlaceReport::Host, "this computer"),
        ];
        for (place, text) in rows {
            assert_eq!(place.to_string(), text);
        }
    }
}
