//! Runs a target on the stable compiler: first its corpus, then mutations of it from a seed.
//!
//! There is no coverage feedback here, so this finds less than libFuzzer in the same time. The same
//! seed tries the same inputs. An input that breaks a promise is printed in hexadecimal.

use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use linesman_fuzz::TARGETS;

/// Longest input.
const LEN_MAX: usize = 4096;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1)?.parse::<u64>().ok()
    };
    let wanted = arguments.first().map(String::as_str).unwrap_or_default();
    let Some((name, target)) = TARGETS.iter().find(|(name, _)| *name == wanted) else {
        eprintln!("usage: replay TARGET [--seconds N] [--seed N]; targets: {:?}", names());
        return ExitCode::from(2);
    };
    let corpus = corpus(name);
    let mut chance = Chance(value("--seed").unwrap_or(1));
    let end = Instant::now() + Duration::from_secs(value("--seconds").unwrap_or(10));
    let mut runs = 0_u64;
    for (path, input) in &corpus {
        if !holds(*target, input) {
            eprintln!("{}", path.display());
            return ExitCode::FAILURE;
        }
        runs += 1;
    }
    while Instant::now() < end {
        let input = mutated(&corpus, &mut chance);
        if !holds(*target, &input) {
            return ExitCode::FAILURE;
        }
        runs += 1;
    }
    println!("{runs} inputs, {} of them committed", corpus.len());
    ExitCode::SUCCESS
}

fn names() -> Vec<&'static str> {
    TARGETS.iter().map(|(name, _)| *name).collect()
}

fn holds(target: fn(&[u8]), input: &[u8]) -> bool {
    let held = catch_unwind(|| target(input)).is_ok();
    if !held {
        let hex: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
        eprintln!("broken by {} bytes: {hex}", input.len());
    }
    held
}

fn corpus(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut found: Vec<_> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let input = std::fs::read(&path).ok()?;
            Some((path, input))
        })
        .collect();
    found.sort();
    found
}

/// A small generator of our own, so that a seed means the same inputs everywhere (SplitMix64).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.0;
        value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        value ^ (value >> 31)
    }

    /// Below `limit`, which is at least 1 (0 counts as 1).
    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }
}

/// One of the corpus with a few changes, or a mix of two.
fn mutated(corpus: &[(PathBuf, Vec<u8>)], chance: &mut Chance) -> Vec<u8> {
    let pick = |chance: &mut Chance| match corpus.get(chance.below(corpus.len())) {
        Some((_, input)) => input.clone(),
        None => Vec::new(),
    };
    let mut input = pick(chance);
    if chance.below(8) == 0 {
        let other = pick(chance);
        let (at, from) = (chance.below(input.len() + 1), chance.below(other.len() + 1));
        input.truncate(at);
        input.extend_from_slice(&other[from..]);
    }
    for _ in 0..=chance.below(6) {
        change(&mut input, chance);
    }
    input.truncate(LEN_MAX);
    input
}

fn change(input: &mut Vec<u8>, chance: &mut Chance) {
    const ODD: [u16; 10] = [0, 1, 0x7F, 0x80, 0xFF, 0x100, 0x7FF, 0x7FFF, 0x8000, 0xFFFF];
    let at = chance.below(input.len());
    match chance.below(7) {
        0 => input.truncate(at),
        1 => input.insert(at, chance.next() as u8),
        2 if !input.is_empty() => drop(input.remove(at)),
        3 if !input.is_empty() => input[at] ^= 1 << chance.below(8),
        4 if input.len() > at + 1 => {
            let odd = ODD[chance.below(ODD.len())];
            input[at..at + 2].copy_from_slice(&odd.to_le_bytes());
        }
        5 => {
            let end = (at + chance.below(32)).min(input.len());
            let piece = input[at..end].to_vec();
            let to = chance.below(input.len() + 1);
            input.splice(to..to, piece);
        }
        _ if !input.is_empty() => input[at] = chance.next() as u8,
        _ => input.push(chance.next() as u8),
    }
}
