//! Station addresses: who keeps the one it has, who gets which.

use std::collections::BTreeMap;

use linesman_proto::address::StationAddress;
use linesman_proto::register::STATION_ADDRESS;

use crate::exchange::{ExchangeError, Target};
use crate::executor::Wire;

/// The station address of the first SubDevice, when none is planned.
pub const FIRST_STATION: StationAddress = StationAddress(0x1001);

/// The addresses that SubDevices shall have, in order of positions: whoever has one that no other
/// has keeps it; the others get the one of their position (0x1001 and up), or the next free one.
#[must_use]
pub fn choose(present: &[StationAddress]) -> Vec<StationAddress> {
    let mut uses: BTreeMap<StationAddress, u32> = BTreeMap::new();
    for station in present {
        *uses.entry(*station).or_default() += 1;
    }
    let keeps = |station: &StationAddress| station.0 != 0 && uses.get(station) == Some(&1);
    let mut taken: std::collections::BTreeSet<StationAddress> =
        present.iter().copied().filter(|station| keeps(station)).collect();
    let mut chosen = Vec::with_capacity(present.len());
    for (position, station) in present.iter().enumerate() {
        if keeps(station) {
            chosen.push(*station);
            continue;
        }
        let mut free = FIRST_STATION.0.wrapping_add(position as u16);
        // There are fewer SubDevices than addresses, so that one is free.
        while free == 0 || taken.contains(&StationAddress(free)) {
            free = free.wrapping_add(1);
        }
        taken.insert(StationAddress(free));
        chosen.push(StationAddress(free));
    }
    chosen
}

/// Gives the SubDevice at a place its station address.
///
/// # Errors
/// [`ExchangeError`] when it does not take it.
pub async fn assign(
    wire: &Wire,
    place: Target,
    station: StationAddress,
) -> Result<(), ExchangeError> {
    let bytes = station.0.to_le_bytes();
    wire.write_one(place, STATION_ADDRESS.address, &bytes).await?;
    // Read back by that address: it answers, and no other does.
    wire.read_one(Target::Station(station), STATION_ADDRESS.address, STATION_ADDRESS.len).await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(present: &[u16]) -> Vec<u16> {
        let present: Vec<_> = present.iter().copied().map(StationAddress).collect();
        choose(&present).into_iter().map(|station| station.0).collect()
    }

    #[test]
    fn a_fresh_line_is_numbered_from_0x1001() {
        assert_eq!(chosen(&[0, 0, 0]), [0x1001, 0x1002, 0x1003]);
    }

    #[test]
    fn subdevice_with_unique_address_keeps_it() {
        assert_eq!(chosen(&[1001, 0, 1003]), [1001, 0x1002, 1003]);
        // The one of its position is taken: the next free one.
        assert_eq!(chosen(&[0x1002, 0, 0x1003]), [0x1002, 0x1004, 0x1003]);
    }

    #[test]
    fn doubled_addresses_are_given_anew() {
        assert_eq!(chosen(&[0x1003, 0x1003, 7]), [0x1001, 0x1002, 7]);
    }
}
