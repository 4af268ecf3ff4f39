//! Table of station addresses, with the controllers that have them.

use linesman_proto::address::{DeviceId, StationAddress};

/// Controllers in the order of their station addresses. MainDevices give these one after the other, so that an address
/// tells its place in most cases.
#[derive(Clone, Default, Debug)]
pub(super) struct StationTable(Vec<(StationAddress, DeviceId)>);

impl StationTable {
    /// The controller with a station address.
    #[inline]
    pub(super) fn get(&self, station: StationAddress) -> Option<DeviceId> {
        let (first, _) = self.0.first()?;
        let guess = self.0.get(usize::from(station.0.wrapping_sub(first.0)));
        if let Some((_, id)) = guess.filter(|(one, _)| *one == station) {
            return Some(*id);
        }
        let place = self.place(station).ok()?;
        self.0.get(place).map(|(_, id)| *id)
    }

    /// Gives a station address to a controller, and tells who had it.
    pub(super) fn insert(&mut self, station: StationAddress, id: DeviceId) -> Option<DeviceId> {
        match self.place(station) {
            Ok(place) => Some(std::mem::replace(&mut self.0[place].1, id)),
            Err(place) => {
                self.0.insert(place, (station, id));
                None
            }
        }
    }

    /// Takes all station addresses from a controller.
    pub(super) fn remove_of(&mut self, id: DeviceId) {
        self.0.retain(|(_, owner)| *owner != id);
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All station addresses, lowest first.
    pub(super) fn keys(&self) -> impl DoubleEndedIterator<Item = StationAddress> {
        self.0.iter().map(|(station, _)| *station)
    }

    fn place(&self, station: StationAddress) -> Result<usize, usize> {
        self.0.binary_search_by_key(&station, |(one, _)| *one)
    }
}

impl FromIterator<(StationAddress, DeviceId)> for StationTable {
    fn from_iter<I: IntoIterator<Item = (StationAddress, DeviceId)>>(all: I) -> Self {
        let mut table = Self::default();
        for (station, id) in all {
            table.insert(station, id);
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controller_is_found_by_its_address_in_a_row_and_out_of_it() {
        let stations = [0x1001, 0x1003, 0x1002, 0x2000, 0x0005].map(StationAddress);
        let mut table: StationTable = stations.into_iter().zip((0..).map(DeviceId)).collect();
        for (station, id) in stations.into_iter().zip((0..).map(DeviceId)) {
            assert_eq!(table.get(station), Some(id), "{station:?}");
        }
        assert_eq!(table.get(StationAddress(0x1004)), None);
        assert_eq!(table.insert(StationAddress(0x1003), DeviceId(7)), Some(DeviceId(1)));
        table.remove_of(DeviceId(4));
        let all: Vec<u16> = table.keys().map(|station| station.0).collect();
        assert_eq!(all, [0x1001, 0x1002, 0x1003, 0x2000]);
        assert_eq!(table.get(StationAddress(0x1003)), Some(DeviceId(7)));
    }
}
