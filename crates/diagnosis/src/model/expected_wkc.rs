//! Expected working counter of a datagram, by what is known of the network when it comes back.

use linesman_proto::command::Addressing;
use linesman_proto::frame::Datagram;

use super::NetworkModel;
use super::learn::is_register_everywhere;

impl NetworkModel {
    /// The working counter that a datagram should come back with, all copies of a ring together.
    ///
    /// Process data: the highest one since they were laid out, or the planned one. Registers that every controller has:
    /// by the command, for broadcasts by the number of controllers. `None` where several values are right: mailboxes,
    /// optional registers, and process data that were not seen before.
    #[must_use]
    pub fn expected_wkc(&self, datagram: &Datagram<'_>) -> Option<u16> {
        let command = datagram.command()?;
        let effect = command.effect();
        let is_everywhere = || is_register_everywhere(datagram.ado());
        match effect.addressing {
            Addressing::None => Some(0),
            Addressing::Logical => {
                let (start, len) = (datagram.logical(), datagram.data_len() as u16);
                let mut all = self.cyclic.iter();
                let known = all.find(|cyclic| {
                    cyclic.start == start && cyclic.len == len && cyclic.command == command
                });
                known.map(|cyclic| cyclic.wkc.highest().value)
            }
            Addressing::Broadcast if is_everywhere() => {
                let each = command.increment(true, true);
                let count = self.traffic.broadcasts.counted();
                (count > 0).then(|| count.saturating_mul(each))
            }
            Addressing::Position | Addressing::Station
                if is_everywhere() && !effect.multiple_write =>
            {
                Some(command.increment(true, true))
            }
            Addressing::Broadcast | Addressing::Position | Addressing::Station => None,
        }
    }
}
