//! Size of a frame: bytes, time on the wire, share of a cycle.
//!
//! Size = 14 (Ethernet) + 2 (EtherCAT) + the sum over datagrams of 12 + data. On the wire at 100
//! Mbit/s a byte takes 80 ns, and preamble, check sequence and gap add 24 bytes; a frame shorter
//! than 60 bytes is padded.

use super::{DATAGRAM_OVERHEAD, ETHERCAT_HEADER_LEN};
use crate::ethernet::{HEADER_LEN, MIN_LEN};
use crate::time::Span;

/// Time of one byte at 100 Mbit/s, in ns.
pub const BYTE_NS: u64 = 80;
/// Preamble and start delimiter (8), check sequence (4) and inter-frame gap (12), in bytes.
pub const WIRE_OVERHEAD: usize = 24;

/// Size of an untagged frame in bytes, without padding and check sequence.
#[must_use]
pub fn frame_size(data_lens: impl IntoIterator<Item = usize>) -> usize {
    let datagrams: usize = data_lens.into_iter().map(|len| len + DATAGRAM_OVERHEAD).sum();
    HEADER_LEN + ETHERCAT_HEADER_LEN + datagrams
}

/// Time that a frame of `size` bytes (without check sequence) holds the wire, gap included.
#[must_use]
pub const fn wire_time(size: usize) -> Span {
    let padded = if size < MIN_LEN { MIN_LEN } else { size };
    Span::ns((padded + WIRE_OVERHEAD) as u64 * BYTE_NS)
}

/// Share of a cycle that a frame of `size` bytes takes, in percent.
///
/// A cycle of zero gives infinity: nothing fits into no time.
#[must_use]
pub fn load_percent(size: usize, cycle: Span) -> f64 {
    wire_time(size).as_nanos() as f64 * 100.0 / cycle.as_nanos() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the sources: data lengths of the datagrams, how often the frame is sent, size in
    /// bytes, wire time in ns, cycle in ms, load in percent as printed there (rounded either way).
    type Row = (&'static [usize], u64, usize, u64, u64, f64);
    const ROWS: [Row; 11] = [
        (&[4, 4, 3, 48, 34, 192, 2], 1, 387, 32_880, 2, 1.64),
        (&[1, 48, 18, 13, 282, 2], 1, 452, 38_080, 2, 1.90),
        (&[4, 4, 1, 80], 1, 153, 14_160, 2, 0.70),
        (&[2, 2, 2], 2, 58, 13_440, 2, 0.67),
        (&[4, 4, 1, 2, 2, 80, 2], 1, 195, 17_520, 2, 0.87),
        (&[1, 16, 4, 11, 2], 1, 110, 10_720, 4, 0.27),
        (&[2, 2], 1, 44, 6_720, 2, 0.33),
        (&[1, 8], 1, 49, 6_720, 2, 0.33),
        (&[16], 1, 44, 6_720, 5, 0.13),
        (&[8, 2], 1, 50, 6_720, 10, 0.07),
        (&[4, 4, 3, 150, 33, 220, 2], 1, 516, 43_200, 2, 2.16),
    ];
    /// Sums of the data lengths of [`ROWS`].
    const SUMS: [usize; 11] = [287, 364, 89, 6, 95, 34, 4, 9, 16, 10, 416];

    // proves: FRM-07 partial, FRM-08 partial, FRM-09 partial, FRM-12 partial
    #[test]
    fn size_time_and_load_as_in_the_sources() {
        for ((lens, repeats, size, wire_ns, cycle_ms, load), sum) in ROWS.into_iter().zip(SUMS) {
            assert_eq!(lens.iter().sum::<usize>(), sum);
            assert_eq!(frame_size(lens.iter().copied()), size, "{lens:?}");
            assert_eq!(wire_time(size) * repeats, Span::ns(wire_ns), "{size} bytes");
            let percent = load_percent(size, Span::ms(cycle_ms)) * repeats as f64;
            assert!((percent - load).abs() <= 0.01, "{size} bytes @ {cycle_ms} ms: {percent}");
        }
    }
}
