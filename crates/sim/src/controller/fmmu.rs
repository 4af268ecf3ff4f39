//! FMMUs: which bytes and bits of a logical datagram lie in this controller, and where.
//!
//! Read first: S1 chapter 7; S2 2.13. The usual case, whole bytes that one FMMU maps, is a copy.
//! Bits, and bytes that several FMMUs of one direction map (the lowest then wins), go bit by bit.

use linesman_proto::address::LogicalAddress;
use linesman_proto::register::{Features, FmmuConfig, FmmuOverlap};

/// Most FMMUs a controller can have.
pub(super) const MAX: usize = 16;

/// The active FMMUs of a controller, lowest first.
#[derive(Clone, Debug)]
pub(super) struct Fmmus {
    active: [Mapping; MAX],
    count: usize,
    /// The logical space that they span together, first byte and first byte behind.
    hull: (u64, u64),
    /// Some reads and some writes share logical bytes.
    crossed: bool,
    /// Counts what was configured, so that whoever keeps an index of it can tell.
    edition: u32,
}

/// An active FMMU.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Mapping {
    pub(super) config: FmmuConfig,
    /// It maps whole bytes, and no lower FMMU maps any of them in the same direction.
    pub(super) simple: bool,
}

impl Fmmus {
    pub(super) fn new() -> Self {
        Self {
            active: [Mapping::default(); MAX],
            count: 0,
            hull: (0, 0),
            crossed: false,
            edition: 0,
        }
    }

    /// Takes over what the registers of all FMMUs say.
    pub(super) fn configure(
        &mut self,
        configs: impl Iterator<Item = FmmuConfig>,
        features: Features,
    ) {
        self.edition = self.edition.wrapping_add(1);
        self.count = 0;
        self.hull = (u64::MAX, 0);
        self.crossed = false;
        for mut config in configs.filter(|config| config.active && config.length > 0).take(MAX) {
            if features.bytewise_fmmus() {
                (config.logical_start_bit, config.logical_stop_bit) = (0, 7);
                config.physical_start_bit = 0;
            }
            let lower = &self.active[..self.count];
            let shares = |reads: bool| {
                lower.iter().any(|other| {
                    let same = if reads { other.config.reads } else { other.config.writes };
                    same && overlaps(&config, &other.config)
                })
            };
            let below = (config.reads && shares(true)) || (config.writes && shares(false));
            let crosses = (config.reads && shares(false)) || (config.writes && shares(true));
            self.crossed |= crosses || (config.reads && config.writes);
            let start = u64::from(config.logical_start.0);
            self.hull.0 = self.hull.0.min(start);
            self.hull.1 = self.hull.1.max(start + u64::from(config.length));
            self.active[self.count] = Mapping { config, simple: config.is_bytewise() && !below };
            self.count += 1;
        }
    }

    /// Whether a datagram of `len` bytes from `start` may concern this controller.
    #[inline]
    pub(super) fn concerns(&self, start: LogicalAddress, len: usize) -> bool {
        let start = u64::from(start.0);
        start < self.hull.1 && self.hull.0 < start + len as u64
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Changes with every new configuration.
    pub(super) fn edition(&self) -> u32 {
        self.edition
    }

    /// Those that are active.
    pub(super) fn active(&self) -> impl Iterator<Item = &FmmuConfig> {
        self.active[..self.count].iter().map(|mapping| &mapping.config)
    }

    pub(super) fn mapping(&self, index: usize) -> &Mapping {
        &self.active[index]
    }

    /// Whether what is read may replace bytes that are still to be written.
    pub(super) fn crossed(&self) -> bool {
        self.crossed
    }

    /// Whether a lower FMMU than `index` maps this logical byte in the same direction.
    fn is_taken(&self, index: usize, at: u64, reads: bool) -> bool {
        self.active[..index].iter().any(|other| {
            let config = &other.config;
            let start = u64::from(config.logical_start.0);
            let same = if reads { config.reads } else { config.writes };
            same && start <= at && at < start + u64::from(config.length)
        })
    }

    /// The physical bytes behind the part of a datagram that FMMU `index` maps bit by bit, in order.
    pub(super) fn bytes(&self, index: usize, overlap: FmmuOverlap) -> BitRange {
        let config = &self.active[index].config;
        let first_bit =
            |byte: u16| (i64::from(byte) * 8 - i64::from(config.logical_start_bit)).max(0) as u64;
        let mapped = u64::from(config.bit_len());
        let from = first_bit(overlap.fmmu_offset);
        let until = first_bit(overlap.fmmu_offset + overlap.length).min(mapped);
        let base = u64::from(config.physical_start.0) * 8 + u64::from(config.physical_start_bit);
        BitRange { next: base + from, end: base + until.max(from) }
    }

    /// For each bit of the physical byte `at` that FMMU `index` maps into a datagram from `start`:
    /// bit of that byte, byte of the datagram, bit of it. Bits of bytes that a lower FMMU has taken
    /// are left out.
    pub(super) fn bits(
        &self,
        index: usize,
        part: PhysicalBits,
        start: LogicalAddress,
        reads: bool,
    ) -> impl Iterator<Item = (u8, usize, u8)> {
        let config = self.active[index].config;
        let base = u64::from(config.physical_start.0) * 8 + u64::from(config.physical_start_bit);
        let logical_base =
            u64::from(config.logical_start.0) * 8 + u64::from(config.logical_start_bit);
        (part.from..part.until).filter_map(move |bit| {
            let logical = logical_base + (u64::from(part.byte) * 8 + u64::from(bit)) - base;
            let offset = (logical / 8).checked_sub(u64::from(start.0))?;
            let taken = self.is_taken(index, logical / 8, reads);
            (!taken).then_some((bit, offset as usize, (logical % 8) as u8))
        })
    }
}

fn overlaps(one: &FmmuConfig, other: &FmmuConfig) -> bool {
    one.overlap(other.logical_start, other.length).is_some()
}

/// A run of physical bits, walked byte by byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct BitRange {
    next: u64,
    end: u64,
}

/// Bits of one physical byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct PhysicalBits {
    /// The byte's address.
    pub(super) byte: u16,
    /// The first bit, 0..=7.
    pub(super) from: u8,
    /// The first bit behind, 1..=8.
    pub(super) until: u8,
}

impl Iterator for BitRange {
    type Item = PhysicalBits;

    /// Ends, too, at the end of the address space.
    fn next(&mut self) -> Option<PhysicalBits> {
        let byte = u16::try_from(self.next / 8).ok()?;
        let from = self.next % 8;
        let until = (self.end - (self.next - from)).min(8);
        if self.next >= self.end {
            return None;
        }
        self.next = u64::from(byte) * 8 + until;
        Some(PhysicalBits { byte, from: from as u8, until: until as u8 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use linesman_proto::address::RegisterAddress;

    /// The example of S1: logical 0x10011.3 to 0x10013.0, three bytes, physical 0x0F01.1.
    fn example() -> FmmuConfig {
        FmmuConfig {
            logical_start: LogicalAddress(0x1_0011),
            length: 3,
            logical_start_bit: 3,
            logical_stop_bit: 0,
            physical_start: RegisterAddress(0x0F01),
            physical_start_bit: 1,
            reads: false,
            writes: true,
            active: true,
        }
    }

    #[test]
    fn bits_lie_where_the_definition_says() {
        let mut fmmus = Fmmus::new();
        fmmus.configure([example()].into_iter(), Features(0));
        assert!(!fmmus.mapping(0).simple);
        let start = LogicalAddress(0x1_0010);
        let overlap = example().overlap(start, 8).unwrap();
        let mut seen = 0;
        for part in fmmus.bytes(0, overlap) {
            for (bit, offset, logical_bit) in fmmus.bits(0, part, start, false) {
                let at = LogicalAddress(start.0 + offset as u32);
                let expected = example().locate_bit(at, logical_bit);
                assert_eq!(expected, Some((RegisterAddress(part.byte), bit)));
                seen += 1;
            }
        }
        assert_eq!(seen, 14);
    }

    #[test]
    fn the_hull_and_the_crossing_are_found() {
        let inputs = FmmuConfig::inputs(LogicalAddress(0x100), 4, RegisterAddress(0x1100));
        let outputs = FmmuConfig::outputs(LogicalAddress(0x104), 4, RegisterAddress(0x1200));
        let mut fmmus = Fmmus::new();
        fmmus.configure([inputs, outputs].into_iter(), Features(0));
        assert!(!fmmus.crossed() && fmmus.mapping(0).simple && fmmus.mapping(1).simple);
        assert!(!fmmus.concerns(LogicalAddress(0xF0), 16));
        assert!(fmmus.concerns(LogicalAddress(0xF0), 17));
        assert!(fmmus.concerns(LogicalAddress(0x107), 1));
        assert!(!fmmus.concerns(LogicalAddress(0x108), 1));

        let same = FmmuConfig::inputs(LogicalAddress(0x103), 2, RegisterAddress(0x1300));
        fmmus.configure([inputs, outputs, same].into_iter(), Features(0));
        assert!(fmmus.crossed() && fmmus.mapping(0).simple && !fmmus.mapping(2).simple);

        fmmus.configure(std::iter::empty(), Features(0));
        assert!(!fmmus.concerns(LogicalAddress(0), 2_047));
    }
}
