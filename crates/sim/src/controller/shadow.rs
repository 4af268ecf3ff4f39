//! Register writes on their way: collected while a frame passes, done when its check sequence was
//! good, forgotten when not.
//!
//! Reference: S1 3.4, shadow buffer for register write operations (0x0000 to 0x0F7F).

/// The writes of one frame, in their order. Keeps its memory from frame to frame.
#[derive(Clone, Default, Debug)]
pub(super) struct Shadow {
    writes: Vec<Write>,
    data: Vec<u8>,
}

/// Bytes that were written to neighbouring registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Write {
    /// Address of the first.
    pub(super) address: usize,
    /// How many.
    pub(super) len: usize,
    /// Where they lie in the buffer.
    from: usize,
    /// Whether the command is one that latches receive times.
    pub(super) latches: bool,
}

impl Shadow {
    pub(super) fn is_empty(&self) -> bool {
        self.writes.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.writes.clear();
        self.data.clear();
    }

    pub(super) fn push(&mut self, address: usize, data: &[u8], latches: bool) {
        self.writes.push(Write { address, len: data.len(), from: self.data.len(), latches });
        self.data.extend_from_slice(data);
    }

    /// Each write with its bytes.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Write, &[u8])> {
        self.writes.iter().map(|write| (*write, &self.data[write.from..write.from + write.len]))
    }
}
