//! Progress of the transfer of a file.
//!
//! Reference: ETG.1000.6, FoE: "busy" carries how much of what is done, in any unit, and a text.

use std::fmt;

use linesman_proto::time::Span;

/// Between two reports of one transfer, so that short packets flood nobody.
pub(super) const PROGRESS_INTERVAL: Span = Span::ms(100);

/// State of the transfer of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FileProgress {
    /// Bytes of the file that are through.
    pub done: usize,
    /// Bytes of the whole file; `None` while nobody knows, as in reading.
    pub total: Option<usize>,
    /// Work that keeps the SubDevice busy; `None`: it takes packets, or gives them.
    pub busy: Option<FileBusy>,
}

/// Answer "busy" of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FileBusy {
    /// Part of `total` that is done, in the SubDevice's unit.
    pub done: u16,
    /// All that is to be done; 0: it does not say.
    pub total: u16,
    /// Name of the work in its words; may be empty.
    pub text: String,
}

impl fmt::Display for FileBusy {
    /// "erasing, 25 %"; empty where it says neither.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        if self.total == 0 {
            return Ok(());
        }
        let percent = u32::from(self.done) * 100 / u32::from(self.total);
        let gap = if self.text.is_empty() { "" } else { ", " };
        write!(f, "{gap}{percent} %")
    }
}

impl fmt::Display for FileProgress {
    /// "812 of 5000 bytes"; "0 of 5000 bytes, the SubDevice is busy: erasing, 25 %".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.total {
            Some(total) => write!(f, "{} of {total} bytes", self.done)?,
            None => write!(f, "{} bytes", self.done)?,
        }
        let Some(busy) = &self.busy else { return Ok(()) };
        f.write_str(", the SubDevice is busy")?;
        let what = busy.to_string();
        if what.is_empty() { Ok(()) } else { write!(f, ": {what}") }
    }
}
