//! SubDevices of all blocks, matched by position, station address or name.

use super::super::fact::{Block, FactKind, SubDeviceFact, SubDeviceRef};
use super::super::text::type_in;
use super::whom;

/// More are not made of numbers alone; a list may have as many as it likes up to this.
const MOST: usize = 2_048;
/// TwinCAT numbers stations from here on, in order.
const FIRST_STATION: u16 = 1_001;

/// All SubDevices, in order.
#[derive(Clone, Default, Debug)]
pub(super) struct Roster {
    devices: Vec<SubDeviceFact>,
}

impl Roster {
    pub(super) fn of(blocks: &[Block], assumed: &mut Vec<String>) -> Self {
        let mut roster = Self::default();
        let facts = || blocks.iter().flat_map(|block| &block.facts).map(|fact| &fact.what);
        // Positions first: names and addresses are matched with them.
        for what in facts() {
            if let FactKind::SubDeviceFact(SubDeviceRef::Position(position), about) = what {
                roster.at(usize::from(*position), about);
            }
        }
        let mut is_guessed = false;
        for what in facts() {
            let about = if let FactKind::SubDeviceFact(_, about) = what {
                (**about).clone()
            } else {
                SubDeviceFact::default()
            };
            for whom in whom(what) {
                match whom {
                    SubDeviceRef::Alias(..) => {}
                    SubDeviceRef::Position(position) => roster.at(usize::from(*position), &about),
                    SubDeviceRef::Named(name, station) => match roster.find(whom) {
                        Some(index) => roster.devices[index].merge(&about),
                        None => {
                            is_guessed = true;
                            roster.add(name, *station, &about);
                        }
                    },
                }
            }
        }
        if is_guessed {
            assumed.push(
                "places of SubDevices that are in no list are assumed: by their addresses, 1001 the first, else in \
                 the order of the text"
                    .to_owned(),
            );
        }
        let answering = facts()
            .filter_map(|what| if let FactKind::Main(main) = what { main.answering } else { None });
        if let Some(most) = answering.max().filter(|_| roster.devices.len() < MOST) {
            // Nothing is known of them but that there are so many.
            let most = usize::from(most).min(256);
            roster.devices.resize(roster.devices.len().max(most), SubDeviceFact::default());
        }
        roster
    }

    pub(super) fn len(&self) -> usize {
        self.devices.len()
    }

    pub(super) fn devices(&self) -> &[SubDeviceFact] {
        &self.devices
    }

    fn at(&mut self, index: usize, about: &SubDeviceFact) {
        if index >= MOST {
            return;
        }
        if index >= self.devices.len() {
            self.devices.resize(index + 1, SubDeviceFact::default());
        }
        self.devices[index].merge(about);
    }

    fn add(&mut self, name: &str, station: Option<u16>, about: &SubDeviceFact) {
        let mut about = about.clone();
        about.station = about.station.or(station);
        about.name = about.name.or_else(|| Some(name.to_owned()).filter(|name| !name.is_empty()));
        about.type_name = about.type_name.or_else(|| type_in(name).map(str::to_owned));
        let by_station =
            station.and_then(|station| station.checked_sub(FIRST_STATION)).map(usize::from);
        match by_station.filter(|index| *index < MOST) {
            Some(index)
                if self
                    .devices
                    .get(index)
                    .is_none_or(|known| *known == SubDeviceFact::default()) =>
            {
                self.at(index, &about);
            }
            Some(_) | None => self.at(self.devices.len(), &about),
        }
    }

    /// Whom a text means.
    pub(super) fn find(&self, whom: &SubDeviceRef) -> Option<usize> {
        let position = |is: &dyn Fn(&SubDeviceFact) -> bool| self.devices.iter().position(is);
        match whom {
            SubDeviceRef::Position(position) => {
                Some(usize::from(*position)).filter(|index| *index < self.len())
            }
            SubDeviceRef::Alias(alias, behind) => {
                let head = position(&|about| about.alias == Some(*alias))?;
                Some(head + usize::from(*behind)).filter(|index| *index < self.len())
            }
            SubDeviceRef::Named(name, station) => {
                let by_station =
                    station.and_then(|station| position(&|about| about.station == Some(station)));
                let by_name =
                    || position(&|about| !name.is_empty() && about.name.as_deref() == Some(name));
                by_station.or_else(by_name)
            }
        }
    }

    /// Its name, where that is its own alone.
    pub(super) fn name(&self, index: usize) -> Option<String> {
        let name = self.devices.get(index)?.name.as_deref()?;
        let is_number = name.chars().all(|one| one.is_ascii_digit());
        let times = self.devices.iter().filter(|about| about.name.as_deref() == Some(name)).count();
        (times == 1 && !is_number && !name.is_empty() && name != "maindevice")
            .then(|| name.to_owned())
    }

    /// What the file calls it.
    pub(super) fn label(&self, index: usize) -> String {
        self.name(index).unwrap_or_else(|| (index + 1).to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::fact::Format;
    use super::*;

    fn named(name: &str, station: u16) -> FactKind {
        let about = SubDeviceFact {
            name: Some(name.to_owned()),
            station: Some(station),
            ..SubDeviceFact::default()
        };
        FactKind::SubDeviceFact(
            SubDeviceRef::Named(name.to_owned(), Some(station)),
            Box::new(about),
        )
    }

    #[test]
    fn lists_and_messages_mean_the_same_subdevice() {
        let mut list = Block::new(Format::Online);
        let about = SubDeviceFact {
            name: Some("T1".to_owned()),
            station: Some(1001),
            ..SubDeviceFact::default()
        };
        list.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(0), Box::new(about)));
        let mut messages = Block::new(Format::Messages);
        messages.tell(named("Term 1", 1001));
        messages.tell(named("Far away", 1004));
        messages.tell(FactKind::Read(SubDeviceRef::Position(60_000), Box::default()));
        let mut assumed = Vec::new();
        let roster = Roster::of(&[list, messages], &mut assumed);
        assert_eq!((roster.len(), assumed.len()), (4, 1));
        assert_eq!(roster.find(&SubDeviceRef::Named("anything".to_owned(), Some(1001))), Some(0));
        assert_eq!(roster.find(&SubDeviceRef::Named("Far away".to_owned(), None)), Some(3));
        assert_eq!((roster.label(0), roster.label(1)), ("T1".to_owned(), "2".to_owned()));
        assert_eq!(roster.find(&SubDeviceRef::Position(60_000)), None);
    }

    #[test]
    fn a_name_that_two_bear_names_neither() {
        let mut list = Block::new(Format::Online);
        for position in 0..2 {
            let about =
                SubDeviceFact { name: Some("EL2004".to_owned()), ..SubDeviceFact::default() };
            list.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(position), Box::new(about)));
        }
        let roster = Roster::of(&[list], &mut Vec::new());
        assert_eq!((roster.label(0), roster.label(1)), ("1".to_owned(), "2".to_owned()));
    }
}
