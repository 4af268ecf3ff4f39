//! Electrical signals of a described device: those that it drives, and those that it takes.
//!
//! A device with a processor has one signal for each object that a PDO maps, in the order of the
//! PDOs; a value of more than 32 bits has one for each 32 bits, lowest first. A controller that
//! works without a processor has one for each bit, and one for each word that fills a SyncManager by
//! itself, such as a coding switch; where such a controller takes or plays several samples in each
//! cycle, one for each value of a sample. A drive of CiA 402 has five more, behind all others: it drives
//! the position of its axis, and takes home switch, negative and positive limit switch, and whether
//! something holds the axis.

use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::sii::Direction;

use super::DescribedType;
use super::firmware::{self, Kind};
use super::pdo::DescribedPdo;

/// A value of the process data with its signals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) direction: Direction,
    /// The SyncManager it is in after power-on.
    pub(super) sync_manager: Option<u8>,
    /// Its place in that SyncManager's data, in bits.
    pub(super) at: usize,
    pub(super) bits: usize,
    pub(super) address: ObjectAddress,
    /// Its first signal, among those of its direction.
    pub(super) first: usize,
    /// How many signals it has.
    pub(super) count: usize,
    /// From one sample to the next in bits, for a value of which there are several in each cycle.
    pub(super) stride: Option<usize>,
}

/// All values and signals.
#[derive(Clone, Default, Debug)]
pub(super) struct Layout {
    /// Signals that are driven.
    pub(super) outputs: usize,
    /// Signals that are taken.
    pub(super) inputs: usize,
    pub(super) points: Vec<Point>,
    /// Where the signals of an axis begin, if it is a drive.
    pub(super) axis: Option<(usize, usize)>,
}

/// Signals that an axis drives and takes.
const AXIS: (usize, usize) = (1, 4);

impl Layout {
    pub(super) fn of(described: &DescribedType) -> Self {
        let (pdos, kind) = (&described.pdos, firmware::kind(described));
        let mut layout = Self::default();
        let mut lengths = [0usize; 256];
        for pdo in pdos {
            let here = pdo.sync_manager.map(usize::from);
            for entry in &pdo.entries {
                let bits = usize::from(entry.bits);
                let at = here.map_or(0, |manager| lengths[manager]);
                if let Some(manager) = here {
                    lengths[manager] += bits;
                }
                let address = ObjectAddress::new(entry.index, entry.subindex);
                if entry.is_padding() || bits == 0 {
                    continue;
                }
                let here = pdos.iter().filter(|other| other.sync_manager == pdo.sync_manager);
                if kind == Kind::Emulated && here.clone().any(|other| other.oversampled) {
                    layout.add_sampled(pdo, address, at, bits);
                } else {
                    layout.add(pdo, address, at, bits, kind);
                }
            }
        }
        if kind == Kind::Processor && described.is_drive() {
            layout.axis = Some((layout.outputs, layout.inputs));
            layout.outputs += AXIS.0;
            layout.inputs += AXIS.1;
        }
        layout
    }

    fn add(
        &mut self,
        pdo: &DescribedPdo,
        address: ObjectAddress,
        at: usize,
        bits: usize,
        kind: Kind,
    ) {
        let (direction, sync_manager) = (pdo.direction, pdo.sync_manager);
        let count = match kind {
            Kind::Nothing => return,
            // What is not assigned has no place among the pins.
            Kind::Emulated if sync_manager.is_none() => return,
            Kind::Emulated if is_word(pdo, bits) => 1,
            Kind::Emulated => bits,
            Kind::Processor => {
                let known =
                    |point: &Point| point.address == address && point.direction == direction;
                if self.points.iter().any(known) {
                    return;
                }
                bits.div_ceil(32)
            }
        };
        let first = self.signals(direction, count);
        let stride = None;
        self.points.push(Point {
            direction,
            sync_manager,
            at,
            bits,
            address,
            first,
            count,
            stride,
        });
    }

    /// A value in a buffer of samples. What is not sampled there, the count of cycles and what fills
    /// up, is no signal; nor is what is not assigned.
    fn add_sampled(&mut self, pdo: &DescribedPdo, address: ObjectAddress, at: usize, bits: usize) {
        if !pdo.oversampled || pdo.sync_manager.is_none() {
            return;
        }
        let (direction, sync_manager, count) = (pdo.direction, pdo.sync_manager, 1);
        let stride = Some(pdo.entries.iter().map(|entry| usize::from(entry.bits)).sum());
        let first = self.signals(direction, count);
        self.points.push(Point {
            direction,
            sync_manager,
            at,
            bits,
            address,
            first,
            count,
            stride,
        });
    }

    /// So many more signals: the first of them.
    fn signals(&mut self, direction: Direction, count: usize) -> usize {
        let signals = match direction {
            Direction::Outputs => &mut self.outputs,
            Direction::Inputs => &mut self.inputs,
        };
        let first = *signals;
        *signals += count;
        first
    }
}

/// Whether an entry is all that its PDO takes in, a word.
fn is_word(pdo: &DescribedPdo, bits: usize) -> bool {
    pdo.direction == Direction::Inputs && pdo.entries.len() == 1 && bits == 16
}
