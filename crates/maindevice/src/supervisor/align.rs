//! Alignment of found and planned SubDevices, when some are missing or too many: the longest common
//! subsequence, since a line keeps its order.

/// Pairs (found, planned), in order, as many as possible, for which `fits` holds. When several
/// answers are equally long, earlier ones are paired first.
pub(crate) fn align(
    found: usize,
    planned: usize,
    fits: impl Fn(usize, usize) -> bool,
) -> Vec<(usize, usize)> {
    let width = planned + 1;
    let Some(cells) = (found + 1).checked_mul(width).filter(|cells| *cells <= MOST_CELLS) else {
        return greedy(found, planned, fits);
    };
    // longest[f][p]: pairs that can be made of found[f..] and planned[p..].
    let mut longest = vec![0u16; cells];
    for f in (0..found).rev() {
        for p in (0..planned).rev() {
            longest[f * width + p] = if fits(f, p) {
                longest[(f + 1) * width + p + 1].saturating_add(1)
            } else {
                longest[(f + 1) * width + p].max(longest[f * width + p + 1])
            };
        }
    }
    let (mut f, mut p) = (0, 0);
    let mut pairs = Vec::new();
    while f < found && p < planned {
        if fits(f, p) {
            pairs.push((f, p));
            (f, p) = (f + 1, p + 1);
        } else if longest[(f + 1) * width + p] >= longest[f * width + p + 1] {
            f += 1;
        } else {
            p += 1;
        }
    }
    pairs
}

/// 32 MB; about 4,000 SubDevices.
const MOST_CELLS: usize = 16 << 20;

/// The next that fits, one after another.
fn greedy(
    found: usize,
    planned: usize,
    fits: impl Fn(usize, usize) -> bool,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let mut next = 0;
    for f in 0..found {
        if let Some(p) = (next..planned).find(|p| fits(f, *p)) {
            pairs.push((f, p));
            next = p + 1;
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aligned(found: &str, planned: &str) -> Vec<(usize, usize)> {
        let (found, planned) = (found.as_bytes(), planned.as_bytes());
        align(found.len(), planned.len(), |f, p| found[f] == planned[p])
    }

    #[test]
    fn missing_and_extra_ones_are_left_out() {
        assert_eq!(aligned("abd", "abcd"), [(0, 0), (1, 1), (2, 3)]);
        assert_eq!(aligned("axbc", "abc"), [(0, 0), (2, 1), (3, 2)]);
        assert_eq!(aligned("", "abc"), []);
        // Of equal ones the first are taken.
        assert_eq!(aligned("aa", "aaa"), [(0, 0), (1, 1)]);
        assert_eq!(aligned("ba", "aba"), [(0, 1), (1, 2)]);
    }
}
