//! Errors of captures that cannot be opened or written.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use super::{CaptureFormat, Damage};
use crate::input::{InputError, InputErrorKind, STANDARD_INPUT};
use crate::unix_time::UnixTime;

/// A capture that cannot be read at all: not even its first block.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", .file.display())]
pub struct CaptureError {
    /// The file.
    pub file: PathBuf,
    /// How many of its bytes were understood.
    pub offset: u64,
    /// What is wrong, and what to do.
    pub kind: CaptureErrorKind,
}

impl CaptureError {
    pub(super) fn at_start(file: &Path, kind: CaptureErrorKind) -> Self {
        let is_pipe = file.as_os_str() == STANDARD_INPUT;
        let is_empty = matches!(kind, CaptureErrorKind::Empty);
        let kind = if is_empty && is_pipe { CaptureErrorKind::NothingPiped } else { kind };
        Self { file: file.to_path_buf(), offset: 0, kind }
    }
}

impl From<InputError> for CaptureError {
    fn from(InputError { name, kind }: InputError) -> Self {
        Self::at_start(&name, CaptureErrorKind::Input(kind))
    }
}

/// What is wrong with a capture that cannot be read at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureErrorKind {
    /// It cannot be opened.
    #[error(transparent)]
    Input(InputErrorKind),
    /// There is nothing in it.
    #[error(
        "the file is empty, expected a pcapng or pcap capture. Do: record it again; a recorder \
         that was killed may not have written what it held"
    )]
    Empty,
    /// A pipe ended before anything came.
    #[error(
        "standard input ended before anything came, expected a pcapng or pcap capture. Do: look whether the command \
         before the pipe failed, such as `tcpdump -i eth0 -U -w -` without its rights"
    )]
    NothingPiped,
    /// It begins like no capture.
    #[error(
        "at byte 0: expected the first bytes of a capture (pcapng: 0a 0d 0d 0a; pcap: d4 c3 b2 a1, \
         4d 3c b2 a1 or either backwards; packed by gzip, xz or zstd), received {}. Do: check that this is a \
         capture; record one with `tcpdump -i eth0 -w trace.pcap` or Wireshark",
        hex(.start)
    )]
    NotACapture {
        /// Its first bytes.
        start: Vec<u8>,
    },
    /// It is a format that is not read here.
    #[error("at byte 0: this is {name}, expected pcapng or pcap. Do: {advice}")]
    OtherFormat {
        /// The format.
        name: &'static str,
        /// How to make it readable.
        advice: &'static str,
    },
    /// Its first block is damaged.
    #[error(
        "at byte 0, the first block of a {format} capture: {damage}. Do: copy the file again, or \
         record it again; nothing before the damage can be judged"
    )]
    FirstBlock {
        /// The format that the first bytes tell.
        format: CaptureFormat,
        /// What is wrong with it.
        damage: Damage,
    },
    /// It cannot be read or not be unpacked from its beginning on.
    #[error("at byte 0: reading failed: {0}. Do: copy the file again, or unpack it by hand")]
    Unreadable(io::Error),
}

fn hex(bytes: &[u8]) -> String {
    let mut text = format!("{} bytes:", bytes.len());
    for byte in bytes {
        // Writing to a String cannot fail.
        let _ = write!(text, " {byte:02x}");
    }
    text
}

/// A frame that cannot be put into a capture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureWriteError {
    /// The interface was never described.
    #[error("writing a frame: interface {interface} is not described, there are {described}")]
    UnknownInterface {
        /// Its number.
        interface: u32,
        /// How many are described.
        described: u32,
    },
    /// The format cannot hold so long a frame.
    #[error("writing a frame: {len} bytes, expected at most {most}")]
    FrameLength {
        /// Length of the frame in bytes.
        len: usize,
        /// The most that is written.
        most: usize,
    },
    /// The format cannot hold this time.
    #[error("writing a frame: the time {time} is not one that the format can hold")]
    Time {
        /// The time.
        time: UnixTime,
    },
    /// The file cannot be written on.
    #[error("writing a capture: {0}. Do: check the free space and the rights of the directory")]
    Io(#[from] io::Error),
}
