//! Common part of the capture tests: real captures, captures made byte by byte, and tshark.

#![allow(dead_code, reason = "each test program uses a part of it")]

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Command;

use linesman_link::capture::{CaptureEnd, CaptureError, CaptureReader};

/// A frame with everything that [`CaptureReader`] tells of it, kept.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Kept {
    pub number: u64,
    pub nanos: Option<i128>,
    pub interface: u32,
    pub original_len: u32,
    pub truncated: bool,
    pub fcs: Option<bool>,
    pub direction: linesman_link::direction::FrameDirection,
    pub bytes: Vec<u8>,
}

/// Reads what is in memory to its end.
pub fn read(bytes: &[u8]) -> Result<(Vec<Kept>, CaptureEnd), CaptureError> {
    let reader = CaptureReader::from_source("memory", Cursor::new(bytes.to_vec()))?;
    Ok(drain(reader))
}

/// Reads all that is left.
pub fn drain(mut reader: CaptureReader) -> (Vec<Kept>, CaptureEnd) {
    let mut kept = Vec::new();
    while let Some(frame) = reader.next_frame() {
        kept.push(Kept {
            number: frame.number.0,
            nanos: frame.time.map(|time| time.as_nanos()),
            interface: frame.interface.0,
            original_len: frame.original_len,
            truncated: frame.truncated,
            fcs: frame.fcs,
            direction: frame.direction,
            bytes: frame.bytes.to_vec(),
        });
    }
    assert!(reader.next_frame().is_none(), "the end stays the end");
    (kept, reader.end().expect("a drained reader knows its end").clone())
}

/// The folder of real captures, if it is there; says so when it is not.
pub fn real_captures() -> Option<PathBuf> {
    let root = std::env::var_os("LINESMAN_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join("pcap");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no real captures in {} (set LINESMAN_DATA)", folder.display());
    None
}

/// What `tshark -r file -T fields …` prints: a list of lines of tab-separated fields, and its
/// complaints. `None`, said aloud, where there is no tshark.
pub fn tshark(file: &Path, fields: &[&str]) -> Option<(Vec<Vec<String>>, String)> {
    let mut command = Command::new("tshark");
    command.arg("-r").arg(file).args(["-n", "-T", "fields"]);
    for field in fields {
        command.args(["-e", field]);
    }
    let Ok(output) = command.output() else {
        eprintln!("SKIPPED: tshark is not installed, nothing to compare with");
        return None;
    };
    let lines = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| line.split('\t').map(str::to_owned).collect())
        .collect();
    let complaints = String::from_utf8_lossy(&output.stderr)
        .lines()
        .filter(|line| !line.starts_with("Running as user"))
        .collect();
    Some((lines, complaints))
}

/// Makes captures byte by byte, in either byte order, right or wrong.
#[derive(Clone, Copy)]
pub struct Maker {
    pub big: bool,
}

impl Maker {
    pub fn u16(self, value: u16) -> [u8; 2] {
        if self.big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub fn u32(self, value: u32) -> [u8; 4] {
        if self.big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub fn u64(self, value: u64) -> [u8; 8] {
        if self.big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub fn block(self, kind: u32, body: &[u8]) -> Vec<u8> {
        let mut body = body.to_vec();
        body.resize(body.len().next_multiple_of(4), 0);
        let len = self.u32(body.len() as u32 + 12);
        [&self.u32(kind)[..], &len, &body, &len].concat()
    }

    pub fn option(self, code: u16, value: &[u8]) -> Vec<u8> {
        let mut option = [&self.u16(code)[..], &self.u16(value.len() as u16), value].concat();
        option.resize(option.len().next_multiple_of(4), 0);
        option
    }

    pub fn section(self) -> Vec<u8> {
        let mut body = self.u32(0x1A2B_3C4D).to_vec();
        body.extend(self.u16(1));
        body.extend(self.u16(0));
        body.extend([0xFF; 8]);
        self.block(0x0A0D_0D0A, &body)
    }

    pub fn interface(self, link_type: u16, snap_len: u32, options: &[Vec<u8>]) -> Vec<u8> {
        let mut body = self.u16(link_type).to_vec();
        body.extend(self.u16(0));
        body.extend(self.u32(snap_len));
        body.extend(options.concat());
        self.block(1, &body)
    }

    pub fn packet(
        self,
        interface: u32,
        ticks: u64,
        original_len: u32,
        bytes: &[u8],
        options: &[Vec<u8>],
    ) -> Vec<u8> {
        let words = [interface, (ticks >> 32) as u32, ticks as u32, bytes.len() as u32];
        let mut body = words.map(|word| self.u32(word)).concat();
        body.extend(self.u32(original_len));
        body.extend(bytes);
        body.resize(body.len().next_multiple_of(4), 0);
        body.extend(options.concat());
        self.block(6, &body)
    }

    pub fn pcap_header(self, magic: u32, snap_len: u32, network: u32) -> Vec<u8> {
        let mut header = self.u32(magic).to_vec();
        header.extend(self.u16(2));
        header.extend(self.u16(4));
        header.extend([0; 8]);
        header.extend(self.u32(snap_len));
        header.extend(self.u32(network));
        header
    }

    pub fn pcap_frame(self, seconds: u32, fraction: u32, original_len: u32, b: &[u8]) -> Vec<u8> {
        let words = [seconds, fraction, b.len() as u32, original_len];
        [&words.map(|word| self.u32(word)).concat()[..], b].concat()
    }
}

/// A broadcast EtherCAT frame that differs by `seed`.
pub fn ethercat(seed: u8, len: usize) -> Vec<u8> {
    let mut frame = vec![0xFF; 6];
    frame.extend([0, 1, 5, 0x10, 0x20, seed, 0x88, 0xA4]);
    frame.resize(len.max(16), seed);
    frame
}
