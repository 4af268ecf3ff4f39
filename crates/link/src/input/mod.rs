//! Input of a command: a file, a pipe or standard input, unpacked, with its first bytes known before
//! it is read.
//!
//! What it is, its bytes say, not its name: [`Input::content`]. gzip, xz and zstd are unpacked on the
//! way, in bounded memory; a packed stream that is cut off gives what comes before the cut.

mod unpack;
mod wait;

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileTypeExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use self::wait::{PipeReader, open_pipe};

/// The name by which standard input is asked for.
pub const STANDARD_INPUT: &str = "-";
/// So many bytes tell what an input is.
const HEAD: usize = 512;

/// First bytes of captures that are read here, and of such that are told how to convert.
const CAPTURES: [&[u8]; 9] = [
    b"\x0A\x0D\x0D\x0A",
    b"\xD4\xC3\xB2\xA1",
    b"\xA1\xB2\xC3\xD4",
    b"\x4D\x3C\xB2\xA1",
    b"\xA1\xB2\x3C\x4D",
    b"GMBU",
    b"RTSS",
    b"snoop\0\0\0",
    b"<?xml",
];
/// First bytes of an archive: zip.
const ARCHIVE: &[u8] = b"PK\x03\x04";
/// Byte-order marks of texts: UTF-8, UTF-16 both ways round.
const BYTE_ORDER_MARKS: [&[u8]; 3] = [b"\xEF\xBB\xBF", b"\xFF\xFE", b"\xFE\xFF"];
/// Ends of names that say "this is a capture"; each may be followed by one of a packed file.
const CAPTURE_ENDS: [&str; 3] = [".pcapng", ".pcap", ".cap"];
/// Ends of file names that say "this is a text".
const TEXT_ENDS: [&str; 6] = [".toml", ".txt", ".log", ".csv", ".tsv", ".out"];
const PACKED_ENDS: [&str; 3] = [".gz", ".xz", ".zst"];

/// What an input holds.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Content {
    /// A capture, or something that is no text: whoever reads captures says what is wrong with it.
    Capture,
    /// A text: what somebody has written, or what another tool has printed.
    Text,
    /// An archive (zip): a bundle, unless it holds something else.
    Archive,
}

impl Content {
    /// What the first bytes of an unpacked input say.
    #[must_use]
    pub fn of(head: &[u8]) -> Self {
        let begins = |marks: &[&[u8]]| marks.iter().any(|mark| head.starts_with(mark));
        if begins(&CAPTURES) || head.is_empty() {
            return Self::Capture;
        }
        if head.starts_with(ARCHIVE) {
            return Self::Archive;
        }
        let is_text = |byte: &u8| !byte.is_ascii_control() || b"\t\n\r\x0C\x1B".contains(byte);
        match begins(&BYTE_ORDER_MARKS) || is_utf_16(head) || head.iter().all(is_text) {
            true => Self::Text,
            false => Self::Capture,
        }
    }
}

/// Whether it looks like UTF-16 without a mark in front: each second byte is zero.
fn is_utf_16(head: &[u8]) -> bool {
    let (pairs, _) = head.as_chunks::<2>();
    let all =
        |zero: usize, byte: usize| pairs.iter().all(|pair| pair[zero] == 0 && pair[byte] != 0);
    pairs.len() > 1 && (all(0, 1) || all(1, 0))
}

/// Whether a file of this name calls itself a capture.
#[must_use]
pub fn is_capture_name(path: &str) -> bool {
    let lower = path.to_ascii_lowercase();
    let name = PACKED_ENDS.iter().find_map(|end| lower.strip_suffix(end)).unwrap_or(&lower);
    CAPTURE_ENDS.iter().any(|end| name.ends_with(end))
}

/// Whether a file of this name calls itself a text.
#[must_use]
pub fn is_text_name(path: &str) -> bool {
    let lower = path.to_ascii_lowercase();
    let name = PACKED_ENDS.iter().find_map(|end| lower.strip_suffix(end)).unwrap_or(&lower);
    TEXT_ENDS.iter().any(|end| name.ends_with(end))
}

/// Why there is no input.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", .name.display())]
pub struct InputError {
    /// The file.
    pub name: PathBuf,
    /// What is wrong, and what to do.
    pub kind: InputErrorKind,
}

/// What is wrong with an input.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputErrorKind {
    /// There is no such file.
    #[error("there is no such file. Do: check the path")]
    Missing,
    /// It is a directory.
    #[error("it is a directory, expected a file. Do: name a file in it")]
    Directory,
    /// It is a socket.
    #[error(
        "it is a socket, expected a file. Do: if a run has opened it, ask that run: `linesman online {}`",
        .0.display()
    )]
    Socket(
        /// Which.
        PathBuf,
    ),
    /// The operating system refuses.
    #[error("cannot be opened: {0}. Do: check the rights of the file (`ls -l`)")]
    Refused(io::Error),
}

/// How far a file has been read.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    taken: Arc<AtomicU64>,
    whole: Option<u64>,
}

impl Progress {
    /// The share that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        let whole = self.whole.filter(|whole| *whole > 0)?;
        Some((self.taken.load(Ordering::Relaxed) as f64 / whole as f64).min(1.0))
    }
}

/// An input that has been opened.
pub struct Input {
    name: PathBuf,
    head: Vec<u8>,
    stream: Box<dyn Read + Send>,
    progress: Progress,
    is_file: bool,
}

impl Input {
    /// Opens a file or a pipe; `-` is standard input.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, InputError> {
        Self::open_until(path, || false)
    }

    /// The same for somebody who may not want to wait any longer: soon after `enough` says so, what
    /// comes through a pipe ends. Files are read on: whoever reads them looks himself.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn open_until(
        path: impl AsRef<Path>,
        enough: impl Fn() -> bool + Send + 'static,
    ) -> Result<Self, InputError> {
        let path = path.as_ref();
        let refuse = |kind| InputError { name: path.to_owned(), kind };
        let refused = |error: io::Error| {
            refuse(match error.kind() == io::ErrorKind::NotFound {
                true => InputErrorKind::Missing,
                false => InputErrorKind::Refused(error),
            })
        };
        let standard = path.as_os_str() == STANDARD_INPUT;
        let file = match standard {
            true => wait::standard_input(),
            false => {
                let kind = std::fs::metadata(path).map_err(refused)?.file_type();
                if kind.is_dir() {
                    return Err(refuse(InputErrorKind::Directory));
                }
                if kind.is_socket() {
                    return Err(refuse(InputErrorKind::Socket(path.to_owned())));
                }
                if kind.is_fifo() { open_pipe(path) } else { File::open(path) }
            }
        };
        let file = file.map_err(refused)?;
        let metadata = file.metadata().map_err(refused)?;
        if metadata.is_dir() {
            return Err(refuse(InputErrorKind::Directory));
        }
        let is_file = metadata.is_file();
        let progress = Progress { whole: is_file.then_some(metadata.len()), ..Progress::default() };
        let source: Box<dyn Read + Send> = match is_file {
            true => Box::new(file),
            false => Box::new(PipeReader::new(file, enough)),
        };
        let counted = Counted { source, taken: Arc::clone(&progress.taken) };
        // What another process reads from standard input beside us cannot be read a second time.
        Ok(Self { progress, is_file: is_file && !standard, ..Self::of(path, counted) })
    }

    /// Takes the bytes from `source`, which errors call `name`.
    pub fn of(name: impl Into<PathBuf>, source: impl Read + Send + 'static) -> Self {
        let (head, stream) = unpack::begin(Box::new(source), HEAD);
        Self { name: name.into(), head, stream, progress: Progress::default(), is_file: false }
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// What it holds. A text whose name says that it is a capture counts as one, a wrong one; and the other way
    /// round, unless it begins as a capture does.
    #[must_use]
    pub fn content(&self) -> Content {
        let name = self.name.to_string_lossy();
        let begins_as_capture = CAPTURES.iter().any(|mark| self.head.starts_with(mark));
        if self.head.starts_with(ARCHIVE) {
            Content::Archive
        } else if is_capture_name(&name) {
            Content::Capture
        } else if is_text_name(&name) && !begins_as_capture {
            Content::Text
        } else {
            Content::of(&self.head)
        }
    }

    /// Whether opening it again gives the same bytes.
    #[must_use]
    pub const fn is_file(&self) -> bool {
        self.is_file
    }

    /// How far it has been read.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.progress.clone()
    }

    /// The unpacked bytes, from the first on.
    #[must_use]
    pub fn into_stream(self) -> Box<dyn Read + Send> {
        self.stream
    }
}

/// Counts what is read.
struct Counted {
    source: Box<dyn Read + Send>,
    taken: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let len = self.source.read(buffer)?;
        self.taken.fetch_add(len as u64, Ordering::Relaxed);
        Ok(len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_bytes_tell_captures_from_texts() {
        let rows: [(&[u8], Content); 12] = [
            (b"", Content::Capture),
            (b"\x0A\x0D\x0D\x0A\x1C\0\0\0", Content::Capture),
            (b"\xD4\xC3\xB2\xA1\x02\0", Content::Capture),
            (b"\xA1\xB2\x3C\x4D\0\x02", Content::Capture),
            (b"snoop\0\0\0\0\0", Content::Capture),
            (b"<?xml version=\"1.0\"?>", Content::Capture),
            (b"\x7FELF\x02\x01\x01\0", Content::Capture),
            (b"PK\x03\x04", Content::Archive),
            (b"[[device]]\nname = \"K1\"\n", Content::Text),
            (b"0  0:0  PREOP  +  EK1100\r\n", Content::Text),
            ("\u{FEFF}Name;Größe\n".as_bytes(), Content::Text),
            (b"\xFF\xFEN\0a\0m\0e\0", Content::Text),
        ];
        for (head, expected) in rows {
            assert_eq!(Content::of(head), expected, "{head:?}");
        }
    }

    #[test]
    fn names_that_call_themselves_captures_are_known() {
        for name in ["a.pcap", "A.PCAPNG", "x.cap.gz", "x.pcap.xz", "x.pcapng.zst"] {
            assert!(is_capture_name(name), "{name}");
        }
        for name in ["a.pcap1", "capture", "a.txt.gz", "read.toml", ".gz"] {
            assert!(!is_capture_name(name), "{name}");
        }
    }

    #[test]
    fn progress_is_told_of_files_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes");
        std::fs::write(&path, vec![b'x'; 4 * HEAD]).unwrap();
        let input = Input::open(&path).unwrap();
        let progress = input.progress();
        assert_eq!(progress.share(), Some(0.25));
        io::copy(&mut input.into_stream(), &mut io::sink()).unwrap();
        assert_eq!(progress.share(), Some(1.0));
        assert_eq!(Input::of("memory", io::empty()).progress().share(), None);
    }
}
