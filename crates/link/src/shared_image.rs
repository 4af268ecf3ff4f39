//! The process image in a file that other programs map: inputs for them to read, outputs for one of
//! them to write.
//!
//! The file belongs into memory, `/dev/shm/machine` say. Behind a header of 64 bytes, all of it little
//! endian words of eight bytes, lie the inputs and then the outputs, each filled up to whole words:
//!
//! | word | what |
//! |---|---|
//! | 0 | `LINESMAN` |
//! | 1 | version of this layout (1) in the low half, length of the header in the high half |
//! | 2 | bytes of inputs in the low half, bytes of outputs in the high half |
//! | 3 | count of the inputs: odd while they are being written |
//! | 4 | count of the outputs: odd while they are being written |
//! | 5 | cycles so far |
//! | 6 | time of the run, in ns |
//! | 7 | bit 0: every SubDevice is in its target state; bit 1: outputs are withheld; bit 2: the run has ended |
//!
//! Each side reads a count, copies, and reads the count again: when it was even and is the same, the
//! copy is whole. Reference: mmap(2); the counts are a seqlock.

use std::fs::OpenOptions;
use std::io;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering, fence};

use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

const MAGIC: u64 = u64::from_le_bytes(*b"LINESMAN");
const VERSION: u32 = 1;
/// Words of the header.
const HEADER: usize = 8;
const WORD: usize = 8;
/// How often a copy is tried while the other side writes.
const ATTEMPTS: usize = 64;
/// Longest image, in bytes: each side fits into the 32 bits of the header many times over.
const LONGEST: usize = 64 * 1024 * 1024;

const INPUTS_COUNT: usize = 3;
const OUTPUTS_COUNT: usize = 4;
const CYCLES: usize = 5;
const TIME: usize = 6;
const STATE: usize = 7;

/// What goes with the inputs of a cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ImageState {
    /// Cycles so far.
    pub cycles: u64,
    /// Time of the run, in ns.
    pub time_ns: u64,
    /// Every SubDevice is in its target state.
    pub settled: bool,
    /// Outputs are withheld because the program that writes them is late.
    pub withheld: bool,
    /// The run has ended: nothing changes any more.
    pub ended: bool,
}

/// A mapped image.
#[derive(Debug)]
pub struct SharedImage {
    words: NonNull<AtomicU64>,
    count: usize,
    inputs: usize,
    outputs: usize,
    /// The file, on the side that has made it.
    path: Option<PathBuf>,
}

// SAFETY: the memory is mapped until this is dropped, belongs to no thread, and is touched by atomic
// operations only.
#[allow(unsafe_code)]
unsafe impl Send for SharedImage {}
// SAFETY: as above.
#[allow(unsafe_code)]
unsafe impl Sync for SharedImage {}

impl SharedImage {
    /// Makes the file, or takes the place of one that an earlier run has left.
    ///
    /// # Errors
    /// When there is something else at `path`, or it cannot be written.
    pub fn create(path: &Path, inputs: usize, outputs: usize) -> io::Result<Self> {
        if inputs.max(outputs) > LONGEST {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "the image is too long"));
        }
        if path.exists() && Self::open(path).is_err() {
            let what = "there is a file that is no process image";
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, what));
        }
        // A new file, so that whoever still has the old one open keeps that.
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            Ok(()) | Err(_) => {}
        }
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        let count = HEADER + inputs.div_ceil(WORD) + outputs.div_ceil(WORD);
        file.set_len((count * WORD) as u64)?;
        let mut image = Self::map(&file, count, inputs, outputs)?;
        image.path = Some(path.to_owned());
        image.word(1).store(pair(VERSION, (HEADER * WORD) as u32), Ordering::Relaxed);
        image.word(2).store(pair(inputs as u32, outputs as u32), Ordering::Relaxed);
        // Last: what has this is whole.
        image.word(0).store(MAGIC.to_le(), Ordering::Release);
        Ok(image)
    }

    /// Maps the image of a running MainDevice.
    ///
    /// # Errors
    /// When there is none, or it is of another version.
    pub fn open(path: &Path) -> io::Result<Self> {
        let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let about = file.metadata()?;
        let len = usize::try_from(about.len()).unwrap_or(usize::MAX);
        if !about.is_file() || !(HEADER * WORD..=2 * LONGEST + 1024).contains(&len) {
            return Err(invalid("no process image"));
        }
        let mut image = Self::map(&file, len / WORD, 0, 0)?;
        if u64::from_le(image.word(0).load(Ordering::Acquire)) != MAGIC {
            return Err(invalid("no process image"));
        }
        let (version, header) = halves(image.word(1).load(Ordering::Relaxed));
        if (version, header as usize) != (VERSION, HEADER * WORD) {
            return Err(invalid("a process image of another version"));
        }
        let (inputs, outputs) = halves(image.word(2).load(Ordering::Relaxed));
        (image.inputs, image.outputs) = (inputs as usize, outputs as usize);
        let needed = HEADER + image.inputs.div_ceil(WORD) + image.outputs.div_ceil(WORD);
        if needed > image.count {
            return Err(invalid("a process image that is cut off"));
        }
        Ok(image)
    }

    #[allow(unsafe_code)]
    fn map(file: &std::fs::File, count: usize, inputs: usize, outputs: usize) -> io::Result<Self> {
        let (protection, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED);
        // SAFETY: a new mapping anywhere, of a file that is as long as it.
        let at = unsafe { mmap(std::ptr::null_mut(), count * WORD, protection, flags, file, 0)? };
        let words = NonNull::new(at.cast::<AtomicU64>())
            .ok_or_else(|| io::Error::other("the mapping lies at address 0"))?;
        Ok(Self { words, count, inputs, outputs, path: None })
    }

    #[allow(unsafe_code)]
    fn words(&self) -> &[AtomicU64] {
        // SAFETY: so many words are mapped for as long as `self` lives, aligned to a page, and
        // nothing but atomic operations touches them on either side.
        unsafe { std::slice::from_raw_parts(self.words.as_ptr(), self.count) }
    }

    fn word(&self, at: usize) -> &AtomicU64 {
        &self.words()[at]
    }

    /// Bytes of inputs.
    #[must_use]
    pub const fn inputs_len(&self) -> usize {
        self.inputs
    }

    /// Bytes of outputs.
    #[must_use]
    pub const fn outputs_len(&self) -> usize {
        self.outputs
    }

    fn inputs_words(&self) -> &[AtomicU64] {
        &self.words()[HEADER..HEADER + self.inputs.div_ceil(WORD)]
    }

    fn outputs_words(&self) -> &[AtomicU64] {
        let begin = HEADER + self.inputs.div_ceil(WORD);
        &self.words()[begin..begin + self.outputs.div_ceil(WORD)]
    }

    /// Shows the inputs of a cycle.
    pub fn publish(&self, inputs: &[u8], state: &ImageState) {
        self.write(INPUTS_COUNT, || {
            copy_in(self.inputs_words(), inputs);
            self.word(CYCLES).store(state.cycles, Ordering::Relaxed);
            self.word(TIME).store(state.time_ns, Ordering::Relaxed);
            let bits = [state.settled, state.withheld, state.ended];
            let bits = bits.iter().rev().fold(0, |sum, bit| sum << 1 | u64::from(*bit));
            self.word(STATE).store(bits, Ordering::Relaxed);
        });
    }

    /// Copies the inputs of the last cycle. `None` when the other side was writing all the time.
    pub fn read_inputs(&self, inputs: &mut [u8]) -> Option<ImageState> {
        self.read(INPUTS_COUNT, || {
            copy_out(self.inputs_words(), inputs);
            let load = |at: usize| self.word(at).load(Ordering::Relaxed);
            let bits = load(STATE);
            ImageState {
                cycles: load(CYCLES),
                time_ns: load(TIME),
                settled: bits & 1 != 0,
                withheld: bits & 2 != 0,
                ended: bits & 4 != 0,
            }
        })
        .map(|(state, _)| state)
    }

    /// Gives outputs. One program may do so.
    pub fn write_outputs(&self, outputs: &[u8]) {
        self.write(OUTPUTS_COUNT, || copy_in(self.outputs_words(), outputs));
    }

    /// Copies the outputs, if they were given anew since `last`, which is brought up to date. Says
    /// whether they were.
    pub fn take_outputs(&self, outputs: &mut [u8], last: &mut u64) -> bool {
        if self.word(OUTPUTS_COUNT).load(Ordering::Acquire) == *last {
            return false;
        }
        match self.read(OUTPUTS_COUNT, || copy_out(self.outputs_words(), outputs)) {
            Some(((), count)) => {
                *last = count;
                true
            }
            None => false,
        }
    }

    fn write(&self, count: usize, change: impl FnOnce()) {
        let count = self.word(count);
        let before = count.load(Ordering::Relaxed) & !1;
        count.store(before + 1, Ordering::Relaxed);
        fence(Ordering::Release);
        change();
        count.store(before + 2, Ordering::Release);
    }

    fn read<T>(&self, count: usize, mut copy: impl FnMut() -> T) -> Option<(T, u64)> {
        let count = self.word(count);
        for _ in 0..ATTEMPTS {
            let before = count.load(Ordering::Acquire);
            let copied = copy();
            fence(Ordering::Acquire);
            if before & 1 == 0 && count.load(Ordering::Relaxed) == before {
                return Some((copied, before));
            }
            std::hint::spin_loop();
        }
        None
    }
}

impl Drop for SharedImage {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        // SAFETY: it was mapped with this length, and no borrow of it is left.
        let _ = unsafe { munmap(self.words.as_ptr().cast(), self.count * WORD) };
        if let Some(path) = &self.path {
            // It may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }
}

fn pair(low: u32, high: u32) -> u64 {
    (u64::from(high) << 32 | u64::from(low)).to_le()
}

fn halves(word: u64) -> (u32, u32) {
    let word = u64::from_le(word);
    (word as u32, (word >> 32) as u32)
}

fn copy_in(words: &[AtomicU64], bytes: &[u8]) {
    for (word, bytes) in words.iter().zip(bytes.chunks(WORD)) {
        let mut all = [0; WORD];
        all[..bytes.len()].copy_from_slice(bytes);
        word.store(u64::from_ne_bytes(all), Ordering::Relaxed);
    }
}

fn copy_out(words: &[AtomicU64], bytes: &mut [u8]) {
    for (word, bytes) in words.iter().zip(bytes.chunks_mut(WORD)) {
        let all = word.load(Ordering::Relaxed).to_ne_bytes();
        bytes.copy_from_slice(&all[..bytes.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_program_sees_whole_images_and_gives_outputs() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image");
        let ours = SharedImage::create(&path, 1_003, 5).unwrap();
        let theirs = SharedImage::open(&path).unwrap();
        assert_eq!((theirs.inputs_len(), theirs.outputs_len()), (1_003, 5));
        let reader = std::thread::spawn(move || {
            let mut inputs = vec![0; 1_003];
            let mut seen = 0;
            loop {
                let Some(state) = theirs.read_inputs(&mut inputs) else { continue };
                assert!(inputs.iter().all(|byte| *byte == state.cycles as u8), "a torn image");
                seen += 1;
                if state.ended {
                    theirs.write_outputs(&[1, 2, 3, 4, 5]);
                    return seen;
                }
            }
        });
        for cycles in 0..20_000_u64 {
            let state = ImageState { cycles, time_ns: cycles, ..ImageState::default() };
            ours.publish(&vec![cycles as u8; 1_003], &state);
        }
        let ended = ImageState { cycles: 7, ended: true, settled: true, ..ImageState::default() };
        ours.publish(&[7; 1_003], &ended);
        assert!(reader.join().unwrap() > 0);
        let (mut outputs, mut last) = ([0; 5], 0);
        assert!(ours.take_outputs(&mut outputs, &mut last));
        assert_eq!(outputs, [1, 2, 3, 4, 5]);
        assert!(!ours.take_outputs(&mut outputs, &mut last), "nothing new");
        drop(ours);
        assert!(!path.exists());
    }

    #[test]
    fn what_is_no_image_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 200]).unwrap();
        assert!(SharedImage::open(&path).is_err());
        assert!(SharedImage::create(&path, 8, 8).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), [7; 200]);
        assert!(SharedImage::open(&folder.path().join("none")).is_err());
    }
}
