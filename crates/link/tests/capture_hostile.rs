//! Files that are damaged, cut off, or made to do harm: clear words, the frames before the damage,
//! never a panic and never more memory than the file is worth.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod support;

use std::fs;
use std::path::Path;

use linesman_link::capture::{CaptureErrorKind, CaptureReader, Damage};
use proptest::prelude::*;
use support::{Kept, Maker, ethercat, read, real_captures};

const LITTLE: Maker = Maker { big: false };

/// Two interfaces, ten frames with options, a block of statistics.
fn sample() -> Vec<u8> {
    let m = LITTLE;
    let mut file = m.section();
    file.extend(m.interface(1, 0, &[m.option(2, b"eth0"), m.option(9, &[9])]));
    file.extend(m.interface(1, 0, &[m.option(2, b"eth1")]));
    for seed in 0..10_u8 {
        let flags = m.option(2, &m.u32(1 + u32::from(seed) % 2));
        let bytes = ethercat(seed, 60 + usize::from(seed));
        let interface = u32::from(seed) % 2;
        file.extend(m.packet(interface, seed.into(), bytes.len() as u32, &bytes, &[flags]));
    }
    file.extend(m.block(5, &[[0; 12].as_slice(), &m.option(5, &m.u64(3))].concat()));
    file
}

/// Reads all cuts of a file: each gives an error or a beginning of what the whole gives.
fn check_cuts(file: &[u8], cuts: impl Iterator<Item = usize>) {
    let (whole, _) = read(file).unwrap();
    let mut longest = 0;
    for cut in cuts {
        match read(&file[..cut]) {
            Ok((frames, end)) => {
                assert_eq!(frames[..], whole[..frames.len()], "cut at {cut}");
                assert!(frames.len() >= longest, "cut at {cut}");
                longest = frames.len();
                assert!(end.offset <= cut as u64);
                if !end.complete() {
                    assert!(matches!(end.damage, Some(Damage::CutOff { .. })), "{cut}: {end}");
                }
            }
            Err(error) => assert!(cut < 200 && longest == 0, "cut at {cut}: {error}"),
        }
    }
}

#[test]
fn every_cut_of_a_capture_gives_its_beginning() {
    let file = sample();
    check_cuts(&file, 0..file.len());
    let m = LITTLE;
    let mut pcap = m.pcap_header(0xA1B2_C3D4, 0, 1);
    for seed in 0..5 {
        pcap.extend(m.pcap_frame(seed.into(), 0, 60, &ethercat(seed, 60)));
    }
    check_cuts(&pcap, 0..pcap.len());
}

#[test]
fn cuts_of_real_captures_give_their_beginning() {
    let Some(folder) = real_captures() else { return };
    for (name, step) in
        [("ec-rs-detect-slaves-ek1100-el1004", 1), ("ec-soem-sdinfo-ek1100-only", 97)]
    {
        let file = fs::read(folder.join(format!("{name}.pcapng"))).unwrap();
        check_cuts(&file, (0..file.len()).step_by(step));
    }
}

#[test]
fn a_later_damage_is_told_with_its_place() {
    let m = LITTLE;
    let frame = m.packet(0, 1, 60, &ethercat(1, 60), &[]);
    let start = [m.section(), m.interface(1, 0, &[]), frame.clone()].concat();
    let at = start.len() as u64;
    let changed = |index: usize, value: u8| {
        let mut damaged = frame.clone();
        damaged[index] = value;
        damaged
    };
    let last = frame.len() - 4;
    let rows = [
        (
            frame[..30].to_vec(),
            Damage::CutOff { what: "an enhanced packet", expected: 92, present: 30 },
        ),
        (frame[..5].to_vec(), Damage::CutOff { what: "a block", expected: 12, present: 5 }),
        (changed(8, 3), Damage::UnknownInterface { interface: 3, described: 1 }),
        (changed(20, 61), Damage::FrameLength { captured: 61, most: 60 }),
        (changed(last, 93), Damage::LengthsDiffer { first: 92, last: 93 }),
        (
            changed(4, 16),
            Damage::BlockLength {
                what: "an enhanced packet",
                length: 16,
                least: 32,
                most: 16 * 1024 * 1024,
            },
        ),
        (m.block(3, &m.u32(60)), Damage::FrameLength { captured: 60, most: 0 }),
        (
            [m.u32(0x7777), m.u32(u32::MAX)].concat(),
            Damage::CutOff { what: "a block", expected: u32::MAX.into(), present: 8 },
        ),
        (
            [m.u32(0x7777), m.u32(0)].concat(),
            Damage::BlockLength { what: "a block", length: 0, least: 12, most: u32::MAX },
        ),
        (
            [m.u32(0x7777).as_slice(), &m.u32(16), &[0; 4], &m.u32(20)].concat(),
            Damage::LengthsDiffer { first: 16, last: 20 },
        ),
        // The library would not look at the last length of these two.
        ([&m.section()[..24], &m.u32(32)].concat(), Damage::LengthsDiffer { first: 28, last: 32 }),
        (
            [&m.block(3, &m.u32(0))[..12], &m.u32(20)].concat(),
            Damage::LengthsDiffer { first: 16, last: 20 },
        ),
        (m.block(0x0A0D_0D0A, &[7; 16]), Damage::ByteOrder { mark: 0x0707_0707 }),
    ];
    for (tail, damage) in rows {
        let (frames, end) = read(&[start.clone(), tail].concat()).unwrap();
        assert_eq!(frames.len(), 1, "{damage}");
        assert_eq!(end.damage, Some(damage));
        assert!(!end.complete());
        assert_eq!(end.offset, at, "{end}");
    }
}

#[test]
fn what_cannot_be_opened_says_what_was_expected_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let rows: [(std::path::PathBuf, &str); 11] = [
        (named("empty.pcapng", b""), "the file is empty, expected a pcapng or pcap capture"),
        (named("ten", b"0123456789"), "received 8 bytes: 30 31 32 33 34 35 36 37"),
        (named("three", b"\x0A\x0D\x0D"), "received 3 bytes: 0a 0d 0d"),
        (named("cut.pcapng", &sample()[..20]), "a section header of 28 bytes is cut off after 20"),
        (named("five", &sample()[..5]), "a section header of 28 bytes is cut off after 5"),
        (named("cut.pcap", b"\xD4\xC3\xB2\xA1\x02\0"), "the file header of 24 bytes is cut off"),
        (named("old", b"GMBU\0\0\0\0"), "editcap -F pcapng"),
        (named("packed", b"\x28\xB5\x2F\xFDabcdefgh"), "reading failed"),
        (named("cut.gz", b"\x1F\x8B\x08"), "reading failed"),
        (folder.path().to_path_buf(), "it is a directory"),
        (folder.path().join("nowhere.pcapng"), "there is no such file"),
    ];
    for (path, expected) in rows {
        let error = CaptureReader::open(&path).err().expect("cannot be opened");
        let text = error.to_string();
        assert!(text.starts_with(&path.display().to_string()), "names the file: {text}");
        assert!(text.contains(expected), "{text}");
        assert!(text.contains("Do: "), "says what to do: {text}");
    }
    let version = [LITTLE.u32(0xA1B2_C3D4).as_slice(), &[9; 20]].concat();
    let error = read(&version).unwrap_err();
    assert!(matches!(
        error.kind,
        CaptureErrorKind::FirstBlock { damage: Damage::Version { major: 0x0909, .. }, .. }
    ));
}

#[test]
fn a_card_full_of_interfaces_is_not_kept_in_memory() {
    let m = LITTLE;
    let mut file = m.section();
    for _ in 0..5000 {
        file.extend(m.interface(1, 0, &[]));
    }
    let (_, end) = read(&file).unwrap();
    assert_eq!(end.damage, Some(Damage::TooManyInterfaces { most: 4096 }));
}

#[test]
fn a_source_that_never_ends_is_refused_at_once() {
    if !Path::new("/dev/zero").exists() {
        eprintln!("SKIPPED: no /dev/zero here");
        return;
    }
    let error = CaptureReader::open("/dev/zero").err().expect("no capture");
    assert!(error.to_string().contains("received 8 bytes: 00 00"), "{error}");
}

/// Whatever the bytes: numbers rise, lengths fit, and the end is told.
fn check_sane(bytes: &[u8]) -> Result<(), TestCaseError> {
    let Ok((frames, end)) = read(bytes) else { return Ok(()) };
    prop_assert!(frames.windows(2).all(|pair: &[Kept]| pair[0].number < pair[1].number));
    prop_assert!(frames.last().is_none_or(|last| last.number <= end.frames));
    prop_assert!(frames.iter().all(|frame| frame.bytes.len() <= bytes.len()));
    // A compressed file's offset counts unpacked bytes.
    let packed = [&[0x1F, 0x8B][..], b"\x28\xB5\x2F\xFD", b"\xFD7zXZ\0"];
    let is_packed = packed.iter().any(|start| bytes.starts_with(start));
    prop_assert!(end.offset <= bytes.len() as u64 || is_packed);
    prop_assert!(!end.to_string().is_empty());
    Ok(())
}

proptest! {
    #[test]
    fn any_bytes_behind_any_start_do_no_harm(
        start in 0..8_usize,
        bytes in proptest::collection::vec(any::<u8>(), 0..400),
    ) {
        let (little, big) = (LITTLE, Maker { big: true });
        let start = match start {
            0 => Vec::new(),
            1 => [little.section(), little.interface(1, 0, &[])].concat(),
            2 => [big.section(), big.interface(113, 50, &[])].concat(),
            3 => little.pcap_header(0xA1B2_C3D4, 0, 276 | 1 << 26 | 15 << 28),
            4 => big.pcap_header(0xA1B2_3C4D, 0, 1),
            5 => b"\x28\xB5\x2F\xFD\x24".to_vec(),
            6 => b"\xFD7zXZ\0\0\x04\xE6\xD6\xB4\x46\x02\0\x21\x01\x16\0\0\0".to_vec(),
            _ => vec![0x1F, 0x8B, 8, 0, 0, 0, 0, 0, 0, 3],
        };
        check_sane(&[start, bytes].concat())?;
    }

    #[test]
    fn any_few_wrong_bytes_do_no_harm(
        wrong in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut file = sample();
        for (index, value) in wrong {
            let at = index.index(file.len());
            file[at] = value;
        }
        check_sane(&file)?;
    }
}
