//! The process image in a file that other programs map: inputs for them to read, outputs for one of
//! them to write.
//!
//! The file belongs into memory, `/dev/shm/machine` say. Behind a header of 72 bytes, all of it little
//! endian words of eight bytes, lie the inputs, then the outputs, then the states of the SubDevices, each
//! filled up to whole words:
//!
//! | word | what |
//! |---|---|
//! | 0 | `LINESMAN` |
//! | 1 | version of this layout (2) in the low half, length of the header in the high half |
//! | 2 | bytes of inputs in the low half, bytes of outputs in the high half |
//! | 3 | count of the inputs: odd while they are being written |
//! | 4 | count of the outputs: odd while they are being written |
//! | 5 | cycles so far |
//! | 6 | time of the run, in ns |
//! | 7 | bit 0: every SubDevice is in its target state; bit 1: outputs are withheld; bit 2: the run has ended; of a ring bits 32 to 47: SubDevices counted in what card A receives, bits 48 to 63: card B (0 without a ring) |
//! | 8 | how many SubDevices there are in the low half, state word of the network in the high half (PLC-07; 0: all is well) |
//!
//! The states are words of two bytes, one for each SubDevice in the order of their numbers: software in the
//! low byte, wiring in the high byte (PLC-04 to PLC-06; 8: OP, and nothing wrong). They are written together
//! with the inputs, under the same count.
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
const VERSION: u32 = 2;
/// Words of the header.
const HEADER: usize = 9;
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
const STATES: usize = 8;
/// States in a word.
const A_WORD: usize = 4;

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
    /// State word of the network.
    pub network: u16,
    /// How many SubDevices are counted in what each card of a ring receives, card A first; 0 without a ring.
    pub responding_by_card: [u16; 2],
}

/// A mapped image.
#[derive(Debug)]
pub struct SharedImage {
    words: NonNull<AtomicU64>,
    count: usize,
    inputs: usize,
    outputs: usize,
    devices: usize,
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
    pub fn create(path: &Path, inputs: usize, outputs: usize, devices: usize) -> io::Result<Self> {
        if inputs.max(outputs).max(devices) > LONGEST {
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
        let lens = [inputs, outputs, devices];
        let count = words_of(lens);
        file.set_len((count * WORD) as u64)?;
        let mut image = Self::map(&file, count, lens)?;
        image.path = Some(path.to_owned());
        image.word(1).store(pair(VERSION, (HEADER * WORD) as u32), Ordering::Relaxed);
        image.word(2).store(pair(inputs as u32, outputs as u32), Ordering::Relaxed);
        image.word(STATES).store(pair(devices as u32, 0), Ordering::Relaxed);
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
        if !about.is_file() || !(HEADER * WORD..=4 * LONGEST + 1024).contains(&len) {
            return Err(invalid("no process image"));
        }
        let mut image = Self::map(&file, len / WORD, [0; 3])?;
        if u64::from_le(image.word(0).load(Ordering::Acquire)) != MAGIC {
            return Err(invalid("no process image"));
        }
        let (version, header) = halves(image.word(1).load(Ordering::Relaxed));
        if (version, header as usize) != (VERSION, HEADER * WORD) {
            return Err(invalid("a process image of another version"));
        }
        let (inputs, outputs) = halves(image.word(2).load(Ordering::Relaxed));
        (image.inputs, image.outputs) = (inputs as usize, outputs as usize);
        image.devices = halves(image.word(STATES).load(Ordering::Relaxed)).0 as usize;
        if words_of([image.inputs, image.outputs, image.devices]) > image.count {
            return Err(invalid("a process image that is cut off"));
        }
        Ok(image)
    }

    #[allow(unsafe_code)]
    fn map(file: &std::fs::File, count: usize, lens: [usize; 3]) -> io::Result<Self> {
        let [inputs, outputs, devices] = lens;
        let (protection, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED);
        // SAFETY: a new mapping anywhere, of a file that is as long as it.
        let at = unsafe { mmap(std::ptr::null_mut(), count * WORD, protection, flags, file, 0)? };
        let words = NonNull::new(at.cast::<AtomicU64>())
            .ok_or_else(|| io::Error::other("the mapping lies at address 0"))?;
        Ok(Self { words, count, inputs, outputs, devices, path: None })
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

    /// How many SubDevices have a state in it.
    #[must_use]
    pub const fn devices(&self) -> usize {
        self.devices
    }

    fn inputs_words(&self) -> &[AtomicU64] {
        &self.words()[HEADER..HEADER + self.inputs.div_ceil(WORD)]
    }

    fn outputs_words(&self) -> &[AtomicU64] {
        let begin = HEADER + self.inputs.div_ceil(WORD);
        &self.words()[begin..begin + self.outputs.div_ceil(WORD)]
    }

    fn states_words(&self) -> &[AtomicU64] {
        let begin = HEADER + self.inputs.div_ceil(WORD) + self.outputs.div_ceil(WORD);
        &self.words()[begin..begin + self.devices.div_ceil(A_WORD)]
    }

    /// Shows the inputs of a cycle, and the states of those SubDevices that are given, by their index; all
    /// others keep theirs.
    pub fn publish(
        &self,
        inputs: &[u8],
        state: &ImageState,
        states: impl IntoIterator<Item = (usize, u16)>,
    ) {
        self.write(INPUTS_COUNT, || {
            copy_in(self.inputs_words(), inputs);
            for (index, state) in states {
                let Some(word) = self.states_words().get(index / A_WORD) else { continue };
                let mut all = word.load(Ordering::Relaxed).to_ne_bytes();
                let at = index % A_WORD * 2;
                all[at..at + 2].copy_from_slice(&state.to_le_bytes());
                word.store(u64::from_ne_bytes(all), Ordering::Relaxed);
            }
            let network = pair(self.devices as u32, u32::from(state.network));
            self.word(STATES).store(network, Ordering::Relaxed);
            self.word(CYCLES).store(state.cycles, Ordering::Relaxed);
            self.word(TIME).store(state.time_ns, Ordering::Relaxed);
            let bits = [state.settled, state.withheld, state.ended];
            let bits = bits.iter().rev().fold(0, |sum, bit| sum << 1 | u32::from(*bit));
            let [a, b] = state.responding_by_card.map(u32::from);
            self.word(STATE).store(pair(bits, b << 16 | a), Ordering::Relaxed);
        });
    }

    /// Copies the inputs of the last cycle. `None` when the other side was writing all the time.
    pub fn read_inputs(&self, inputs: &mut [u8]) -> Option<ImageState> {
        self.read(INPUTS_COUNT, || {
            copy_out(self.inputs_words(), inputs);
            let load = |at: usize| self.word(at).load(Ordering::Relaxed);
            let (bits, cards) = halves(load(STATE));
            ImageState {
                cycles: load(CYCLES),
                time_ns: load(TIME),
                settled: bits & 1 != 0,
                withheld: bits & 2 != 0,
                ended: bits & 4 != 0,
                network: halves(load(STATES)).1 as u16,
                responding_by_card: [cards as u16, (cards >> 16) as u16],
            }
        })
        .map(|(state, _)| state)
    }

    /// Copies the states of the SubDevices. False when the other side was writing all the time.
    pub fn read_states(&self, states: &mut [u16]) -> bool {
        let copy = || {
            for (states, word) in states.chunks_mut(A_WORD).zip(self.states_words()) {
                let all = word.load(Ordering::Relaxed).to_ne_bytes();
                for (state, bytes) in states.iter_mut().zip(all.chunks_exact(2)) {
                    *state = u16::from_le_bytes([bytes[0], bytes[1]]);
                }
            }
        };
        self.read(INPUTS_COUNT, copy).is_some()
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

/// Words of a file: header, inputs, outputs, states.
fn words_of([inputs, outputs, devices]: [usize; 3]) -> usize {
    HEADER + inputs.div_ceil(WORD) + outputs.div_ceil(WORD) + devices.div_ceil(A_WORD)
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
        let ours = SharedImage::create(&path, 1_003, 5, 6).unwrap();
        let theirs = SharedImage::open(&path).unwrap();
        assert_eq!((theirs.inputs_len(), theirs.outputs_len(), theirs.devices()), (1_003, 5, 6));
        let reader = std::thread::spawn(move || {
            let mut inputs = vec![0; 1_003];
            let mut seen = 0;
            loop {
                let Some(state) = theirs.read_inputs(&mut inputs) else { continue };
                assert!(inputs.iter().all(|byte| *byte == state.cycles as u8), "a torn image");
                assert_eq!(state.network, state.cycles as u16);
                seen += 1;
                if state.ended {
                    assert_eq!(state.responding_by_card, [2, 0x8001]);
                    theirs.write_outputs(&[1, 2, 3, 4, 5]);
                    return seen;
                }
            }
        });
        for cycles in 0..20_000_u64 {
            let network = cycles as u16;
            let state = ImageState { cycles, time_ns: cycles, network, ..ImageState::default() };
            let states = (0..6).map(|at| (at, cycles as u16 + at as u16));
            ours.publish(&vec![cycles as u8; 1_003], &state, states);
        }
        let ended = ImageState {
            cycles: 7,
            ended: true,
            settled: true,
            network: 7,
            responding_by_card: [2, 0x8001],
            ..ImageState::default()
        };
        ours.publish(&[7; 1_003], &ended, [(5, 0x2408)]);
        let mut states = [0; 6];
        assert!(ours.read_states(&mut states));
        assert_eq!(states, [19_999, 20_000, 20_001, 20_002, 20_003, 0x2408]);
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
        assert!(SharedImage::create(&path, 8, 8, 1).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), [7; 200]);
        assert!(SharedImage::open(&folder.path().join("none")).is_err());
    }
}
