//! Bundles: as archives that are damaged, and as archives that are whole and hold members from anywhere.

use std::io::Cursor;

use linesman_diagnosis::Engine;
use linesman_link::input::Input;
use linesman_runtime::bundle::{Bundle, MEMBERS};

/// Line between two members of an input that is not an archive yet.
pub const BETWEEN_MEMBERS: &[u8] = b"\n----\n";
/// Longest bundle that is judged, in bytes of frames.
const FRAMES_MAX: usize = 64 * 1024;

/// Bytes that begin as an archive are read as they are; others are the members in the order of [`MEMBERS`], put into a
/// whole archive. What can be read as a bundle is judged, and its frames can be replaced.
pub fn bundle(data: &[u8]) {
    let archive = match data.starts_with(b"PK") {
        true => data.to_vec(),
        false => packed(&members(data)),
    };
    let Ok(mut bundle) = Bundle::of(Input::of("fuzz", Cursor::new(archive))) else { return };
    if bundle.frames.len() > FRAMES_MAX {
        return;
    }
    let judge = |bundle: &Bundle| {
        let mut engine = Engine::new(bundle.setup());
        let judged = bundle.replay(&mut engine, |engine| while engine.poll_event().is_some() {});
        judged.is_ok().then(|| engine.diagnosis())
    };
    let first = judge(&bundle);
    assert_eq!(first, judge(&bundle), "the same bundle is judged the same");
    if bundle.replace_frames(|_| {}).is_ok() {
        assert!(judge(&bundle).is_some(), "frames that were written can be read");
    }
}

/// Members of an input, in the order of their names.
fn members(data: &[u8]) -> Vec<(&'static str, &[u8])> {
    let mut rest = Some(data);
    let names = MEMBERS.into_iter();
    let one = |name| {
        let (member, behind) = split(rest?);
        rest = behind;
        Some((name, member))
    };
    names.map_while(one).collect()
}

fn split(data: &[u8]) -> (&[u8], Option<&[u8]>) {
    let at = data.windows(BETWEEN_MEMBERS.len()).position(|window| window == BETWEEN_MEMBERS);
    match at {
        Some(at) => (&data[..at], Some(&data[at + BETWEEN_MEMBERS.len()..])),
        None => (data, None),
    }
}

/// A zip archive whose members are stored as they are (APPNOTE 4.3.6).
#[must_use]
pub fn packed(members: &[(&str, &[u8])]) -> Vec<u8> {
    const VERSION: u16 = 20;
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let at = archive.len() as u32;
        let mut about = Vec::new();
        // Version, flags, method and date.
        about.extend([VERSION, 0, 0, 0, 0x21].map(u16::to_le_bytes).concat());
        let len = bytes.len() as u32;
        about.extend([crc32(bytes), len, len].map(u32::to_le_bytes).concat());
        about.extend([name.len() as u16, 0].map(u16::to_le_bytes).concat());
        archive.extend([b"PK\x03\x04", &about[..], name.as_bytes(), bytes].concat());
        directory.extend([b"PK\x01\x02", &VERSION.to_le_bytes()[..], &about].concat());
        directory.extend([[0; 10].as_slice(), &at.to_le_bytes(), name.as_bytes()].concat());
    }
    let (count, at) = (members.len() as u16, archive.len() as u32);
    let len = directory.len() as u32;
    archive.extend(directory);
    archive.extend([b"PK\x05\x06".as_slice(), &[0; 4]].concat());
    archive.extend([count, count].map(u16::to_le_bytes).concat());
    archive.extend([len, at].map(u32::to_le_bytes).concat());
    archive.extend([0; 2]);
    archive
}

/// The check sum of zip, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            let polynomial = if sum & 1 == 0 { 0 } else { 0xEDB8_8320 };
            sum >> 1 ^ polynomial
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_sum_is_the_one_of_zip() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn committed_members_make_a_bundle_that_can_be_judged() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/bundle/cut-link.bin");
        let data = std::fs::read(folder).unwrap();
        let archive = packed(&members(&data));
        let bundle = Bundle::of(Input::of("fuzz", Cursor::new(archive))).unwrap();
        let mut engine = Engine::new(bundle.setup());
        bundle.replay(&mut engine, |_| {}).unwrap();
        assert!(engine.diagnosis().network.frames.0 > 0);
    }
}
