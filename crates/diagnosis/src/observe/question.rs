//! Questions: frames by which Linesman reads registers beside another MainDevice (`diagnose listen:… --ask`).
//!
//! They are known by their source address, live and in a recording, whoever looks at them. What they read is evidence as
//! any other; but they are no frames of the MainDevice: they are not counted among its own, do not make a second
//! MainDevice, and tell nothing of its cycle.

use linesman_proto::address::RegisterAddress;
use linesman_proto::ethernet::ASKING_SOURCE;
use linesman_proto::frame::FrameView;

/// Registers of which it is kept that they were read.
const KEPT: usize = 16;

/// Whether a frame is a question, or the answer to one.
#[must_use]
pub fn is_question(view: &FrameView<'_>) -> bool {
    view.source().marked() == ASKING_SOURCE.marked()
}

/// Questions that were seen.
#[derive(Clone, Default, Debug)]
pub struct Questions {
    /// Those that came back.
    pub answered: u64,
    /// Those that went out and did not come back.
    pub lost: u64,
    /// Registers that were read by them, with their lengths.
    read: Vec<(RegisterAddress, u16)>,
}

impl Questions {
    /// A register was read.
    pub fn note_read(&mut self, register: RegisterAddress, len: u16) {
        if self.read.len() < KEPT && !self.read.contains(&(register, len)) {
            self.read.push((register, len));
        }
    }

    /// Whether any of so many bytes from a register on were read.
    #[must_use]
    pub fn have_read(&self, register: RegisterAddress, len: u16) -> bool {
        let end = register.0.saturating_add(len);
        let touches = |read: &(RegisterAddress, u16)| {
            read.0.0 < end && register.0 < read.0.0.saturating_add(read.1)
        };
        self.read.iter().any(touches)
    }
}
