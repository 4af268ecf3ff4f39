//! Reading a capture, frame by frame, whatever its format.
//!
//! A frame's bytes are borrowed from the reader's buffer until the next one is asked for; nothing is
//! allocated but a short list for the options of a frame that has some. A damaged first block is an error; a later damage ends the capture, and
//! [`CaptureReader::end`] tells where and why.

use std::io::Read;
use std::mem;
use std::path::{Path, PathBuf};

use linesman_proto::esl::{EslPlace, EslRecord, RECORD_LEN};
use pcap_parser::pcapng::SHB_MAGIC;

use super::cooked;
use super::end::{CaptureEnd, Damage};
use super::error::{CaptureError, CaptureErrorKind};
use super::fcs;
use super::frame::{
    CaptureFormat, CaptureInterface, CaptureInterfaceId, CaptureSection, CapturedFrame,
    FrameDirection, FrameNumber, SkippedLinkType,
};
use super::link_type::LinkType;
use super::pcap::Pcap;
use super::pcapng::{Item, Pcapng};
use super::probe_clock::ProbeClock;
use super::window::Window;
use crate::input::{Input, Progress};
use crate::unix_time::UnixTime;

/// Longest frame that is read, in bytes; the limit of Wireshark too.
pub(super) const MAX_FRAME_LEN: u32 = 262_144;

/// A capture file that is being read.
pub struct CaptureReader {
    window: Window,
    format: Format,
    section: CaptureSection,
    interfaces: Vec<CaptureInterface>,
    frames: u64,
    skipped: Vec<SkippedLinkType>,
    end: Option<CaptureEnd>,
    progress: Progress,
    probe_clock: ProbeClock,
    /// The frame that was read last.
    current: Option<CurrentFrame>,
}

/// A frame that was read, but for its bytes.
struct CurrentFrame {
    time: Option<UnixTime>,
    interface: CaptureInterfaceId,
    link_type: LinkType,
    original_len: u32,
    truncated: bool,
    shape: Shape,
}

enum Format {
    Pcap(Pcap),
    Pcapng(Pcapng),
}

/// A frame as the formats find it: where in the window's buffer it is, and what is told of it.
pub(super) struct Record {
    pub(super) at: usize,
    pub(super) len: usize,
    pub(super) original_len: u32,
    pub(super) interface: CaptureInterfaceId,
    pub(super) time: Option<UnixTime>,
    pub(super) direction: FrameDirection,
    pub(super) fcs_len: u8,
    pub(super) crc_error: bool,
}

impl CaptureReader {
    /// Opens a pcapng or pcap file, packed or not; its bytes tell, not its name.
    ///
    /// # Errors
    /// When the file cannot be read, is no capture, or is damaged in its first block.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, CaptureError> {
        Self::of(Input::open(path)?)
    }

    /// Reads a capture from `source`, which errors call `name`.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn from_source(
        name: impl Into<PathBuf>,
        source: impl Read + Send + 'static,
    ) -> Result<Self, CaptureError> {
        Self::of(Input::of(name, source))
    }

    /// Reads a capture from an input.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn of(input: Input) -> Result<Self, CaptureError> {
        let (name, progress) = (input.name().to_owned(), input.progress());
        let window = Window::new(input.into_stream());
        let begun = Self::begin(window).map_err(|kind| CaptureError::at_start(&name, kind))?;
        Ok(Self { progress, ..begun })
    }

    fn begin(mut window: Window) -> Result<Self, CaptureErrorKind> {
        window.fill(4);
        let Some(&magic) = window.view().first_chunk::<4>() else {
            return Err(too_short(&mut window));
        };
        if let Some((name, advice)) = other_format(&mut window) {
            return Err(CaptureErrorKind::OtherFormat { name, advice });
        }
        let mut interfaces = Vec::new();
        let mut section = CaptureSection::default();
        let format = if u32::from_le_bytes(magic) == SHB_MAGIC {
            let mut file = Pcapng::open(&mut window)
                .map_err(|damage| first_block(&mut window, CaptureFormat::Pcapng, damage))?;
            section = mem::take(&mut file.section);
            Format::Pcapng(file)
        } else {
            let opened = Pcap::open(&mut window)
                .map_err(|damage| first_block(&mut window, CaptureFormat::Pcap, damage))?;
            let Some((file, interface)) = opened else {
                let start = window.view().iter().take(8).copied().collect();
                return Err(CaptureErrorKind::NotACapture { start });
            };
            interfaces.push(interface);
            Format::Pcap(file)
        };
        Ok(Self {
            window,
            format,
            section,
            interfaces,
            frames: 0,
            skipped: Vec::new(),
            end: None,
            progress: Progress::default(),
            probe_clock: ProbeClock::default(),
            current: None,
        })
    }

    /// The next frame that can carry EtherCAT; `None` at the end, which [`end`](Self::end) then
    /// describes.
    #[inline]
    pub fn next_frame(&mut self) -> Option<CapturedFrame<'_>> {
        if self.advance() { self.frame() } else { None }
    }

    /// Goes to the next frame that can carry EtherCAT; `false` at the end.
    #[inline]
    pub fn advance(&mut self) -> bool {
        self.current = if self.end.is_some() { None } else { self.read() };
        self.current.is_some()
    }

    /// The frame that [`advance`](Self::advance) went to.
    #[must_use]
    #[inline]
    pub fn frame(&self) -> Option<CapturedFrame<'_>> {
        let CurrentFrame { time, interface, link_type, original_len, truncated, shape } =
            self.current.as_ref()?;
        let stored = self.window.kept(shape.stored.at, shape.stored.len);
        let start = shape.at - shape.stored.at;
        Some(CapturedFrame {
            number: FrameNumber(self.frames),
            time: *time,
            interface: *interface,
            host_interface: shape.host_interface,
            link_type: *link_type,
            direction: shape.direction,
            original_len: *original_len,
            truncated: *truncated,
            fcs: shape.fcs,
            probe: shape.probe,
            stored,
            bytes: &stored[start..start + shape.len],
        })
    }

    #[inline]
    fn read(&mut self) -> Option<CurrentFrame> {
        loop {
            let start = self.window.offset();
            let item = match &mut self.format {
                Format::Pcap(file) => {
                    file.next(&mut self.window).map(|record| record.map(Item::Frame))
                }
                Format::Pcapng(file) => file.next(&mut self.window, &mut self.interfaces),
            };
            let record = match item {
                Ok(Some(Item::Frame(record))) => record,
                Ok(Some(Item::Numbered)) => {
                    self.frames += 1;
                    continue;
                }
                Ok(Some(Item::Other)) => continue,
                Ok(None) => {
                    self.finish(start, None);
                    return None;
                }
                Err(damage) => {
                    self.finish(start, Some(damage));
                    return None;
                }
            };
            self.frames += 1;
            let link_type = self.interfaces[record.interface.0 as usize].link_type;
            let Some(shape) = Shape::of(&record, link_type, &mut self.window) else {
                self.count_skipped(link_type);
                continue;
            };
            let time = match shape.probe {
                Some(probe) => self.probe_clock.place(record.time, probe.time_ns),
                None => record.time,
            };
            return Some(CurrentFrame {
                time,
                interface: record.interface,
                link_type,
                original_len: record.original_len,
                truncated: (record.len as u64) < u64::from(record.original_len),
                shape,
            });
        }
    }

    /// The kind of file.
    #[must_use]
    pub fn format(&self) -> CaptureFormat {
        match self.format {
            Format::Pcap(_) => CaptureFormat::Pcap,
            Format::Pcapng(_) => CaptureFormat::Pcapng,
        }
    }

    /// What the file says about its maker.
    #[must_use]
    pub fn section(&self) -> &CaptureSection {
        &self.section
    }

    /// The interfaces that were described so far.
    #[must_use]
    pub fn interfaces(&self) -> &[CaptureInterface] {
        &self.interfaces
    }

    /// Frames that were passed over so far because of their link type, one entry for each type.
    #[must_use]
    pub fn skipped(&self) -> &[SkippedLinkType] {
        &self.skipped
    }

    /// The share of the file that has been read, 0 to 1; `None` where nobody knows the whole.
    #[must_use]
    pub fn progress(&self) -> Option<f64> {
        self.progress.share()
    }

    /// The same for whoever asks while another one reads.
    pub(super) fn progress_handle(&self) -> Progress {
        self.progress.clone()
    }

    /// How the capture ended; `None` before [`next_frame`](Self::next_frame) gave `None`.
    #[must_use]
    pub fn end(&self) -> Option<&CaptureEnd> {
        self.end.as_ref()
    }

    fn count_skipped(&mut self, link_type: LinkType) {
        match self.skipped.iter_mut().find(|skipped| skipped.link_type == link_type) {
            Some(skipped) => skipped.frames += 1,
            None => self.skipped.push(SkippedLinkType { link_type, frames: 1 }),
        }
    }

    #[cold]
    fn finish(&mut self, offset: u64, damage: Option<Damage>) {
        // A stream that fails looks cut off; why it failed says more.
        let damage = match self.window.take_fault() {
            Some(fault) => Some(Damage::Unreadable { text: fault.to_string() }),
            None => damage,
        };
        self.end = Some(CaptureEnd { damage, offset, frames: self.frames });
    }
}

/// A place in the buffer of the window.
#[derive(Clone, Copy)]
struct Stretch {
    at: usize,
    len: usize,
}

/// The Ethernet frame in a record.
struct Shape {
    /// All that was stored of it, without check sequence.
    stored: Stretch,
    at: usize,
    len: usize,
    probe: Option<EslRecord>,
    direction: FrameDirection,
    host_interface: Option<u32>,
    fcs: Option<bool>,
}

impl Shape {
    #[inline]
    fn of(record: &Record, link_type: LinkType, window: &mut Window) -> Option<Self> {
        match link_type {
            LinkType::Ethernet => Some(Self::ethernet(record, window)),
            LinkType::LinuxCooked => {
                Self::cooked(record, cooked::rebuild(window.passed(record.at, record.len)))
            }
            LinkType::LinuxCooked2 => {
                Self::cooked(record, cooked::rebuild2(window.passed(record.at, record.len)))
            }
            LinkType::Other(_) => None,
        }
    }

    #[inline]
    fn ethernet(record: &Record, window: &mut Window) -> Self {
        let mut shape = Self {
            stored: Stretch { at: record.at, len: record.len },
            at: record.at,
            len: record.len,
            probe: None,
            direction: record.direction,
            host_interface: None,
            fcs: record.crc_error.then_some(false),
        };
        if record.fcs_len != 0 {
            shape.take_fcs_off(record, window);
        }
        shape.stored.len = shape.len;
        shape.take_probe_off(window);
        shape
    }

    /// Takes off the record of a capture probe, in front or behind.
    #[inline]
    fn take_probe_off(&mut self, window: &mut Window) {
        let Some((probe, place, frame)) = EslRecord::find(window.passed(self.at, self.len)) else {
            return;
        };
        self.len = frame.len();
        if place == EslPlace::Front {
            self.at += RECORD_LEN;
        }
        if probe.is_damaged() {
            self.fcs = Some(false);
        }
        self.probe = Some(probe);
    }

    /// Takes off what there is of the check sequence: a truncated frame has only a part of it, or
    /// nothing.
    fn take_fcs_off(&mut self, record: &Record, window: &mut Window) {
        let fcs_len = usize::from(record.fcs_len);
        let without = (record.original_len as usize).saturating_sub(fcs_len);
        if record.len >= record.original_len as usize {
            if fcs_len == fcs::FCS_LEN && self.fcs.is_none() {
                self.fcs = fcs::intact(window.passed(record.at, record.len));
            }
            self.len = record.len.saturating_sub(fcs_len);
        } else {
            self.len = record.len.min(without);
        }
    }

    fn cooked(record: &Record, cooked: Option<cooked::Cooked>) -> Option<Self> {
        let cooked = cooked?;
        let (at, len) = (record.at + cooked.start, record.len - cooked.start);
        Some(Self {
            stored: Stretch { at, len },
            at,
            len,
            probe: None,
            direction: match record.direction {
                FrameDirection::Unknown => cooked.direction,
                FrameDirection::Incoming | FrameDirection::Outgoing => record.direction,
            },
            host_interface: cooked.host_interface,
            fcs: record.crc_error.then_some(false),
        })
    }
}

fn too_short(window: &mut Window) -> CaptureErrorKind {
    match (window.take_fault(), window.view()) {
        (Some(fault), _) => CaptureErrorKind::Unreadable(fault),
        (None, []) => CaptureErrorKind::Empty,
        (None, start) => CaptureErrorKind::NotACapture { start: start.to_vec() },
    }
}

fn first_block(window: &mut Window, format: CaptureFormat, damage: Damage) -> CaptureErrorKind {
    match window.take_fault() {
        Some(fault) => CaptureErrorKind::Unreadable(fault),
        None => CaptureErrorKind::FirstBlock { format, damage },
    }
}

/// Names the formats that people mistake for a capture, with the way out.
fn other_format(window: &mut Window) -> Option<(&'static str, &'static str)> {
    const EDITCAP: &str = "convert it with `editcap -F pcapng OLD NEW.pcapng`";
    const UNPACK: &str = "unpack it first; gzip, xz and zstd are unpacked here";
    const TWICE: &str = "unpack it once by hand";
    const KNOWN: [(&[u8], &str, &str); 12] = [
        (b"GMBU", "a Microsoft Network Monitor capture", EDITCAP),
        (b"RTSS", "a Microsoft Network Monitor capture", EDITCAP),
        (b"snoop\0\0\0", "a snoop capture", EDITCAP),
        (b"\x34\xCD\xB2\xA1", "a patched variant of pcap", EDITCAP),
        (b"\xA1\xB2\xCD\x34", "a patched variant of pcap", EDITCAP),
        (b"\x28\xB5\x2F\xFD", "compressed twice", TWICE),
        (b"\x04\x22\x4D\x18", "compressed by lz4", UNPACK),
        (b"\xFD7zXZ\0", "compressed twice", TWICE),
        (b"BZh", "compressed by bzip2", UNPACK),
        (b"PK\x03\x04", "a zip archive", UNPACK),
        (b"\x1F\x8B", "compressed twice", TWICE),
        (b"<?xml", "an XML file", "name the capture, not its description"),
    ];
    window.fill(8);
    let known = KNOWN.iter().find(|(magic, _, _)| window.view().starts_with(magic));
    known.map(|&(_, name, advice)| (name, advice))
}
