//! Process data of a device with a processor, SyncManager by SyncManager.
//!
//! Read first: ETG.1000.6, PDO assignment: object 0x1C10 + n lists the PDOs of SyncManager n.

use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::sii::Direction;
use linesman_proto::state::AlStatusCode;

use super::process_image::{self, ProcessImage};
use crate::controller::Pdi;
use crate::device::dictionary::Dictionary;

/// A buffer for process data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProcessBuffer {
    /// The SyncManager that guards it, 0..=15.
    pub sync_manager: u8,
    /// Which way the data flow.
    pub direction: Direction,
}

impl ProcessBuffer {
    /// What nearly all devices with a mailbox have: SyncManager 2 for outputs, 3 for inputs.
    pub const BEHIND_MAILBOX: [Self; 2] = [
        Self { sync_manager: 2, direction: Direction::Outputs },
        Self { sync_manager: 3, direction: Direction::Inputs },
    ];

    /// The object that lists its PDOs.
    #[must_use]
    pub const fn assignment(self) -> ObjectIndex {
        ObjectIndex(0x1C10 + self.sync_manager as u16)
    }
}

/// All process data as they are set up.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct Areas(Vec<BufferArea>);

#[derive(Clone, PartialEq, Eq, Debug)]
struct BufferArea {
    buffer: ProcessBuffer,
    image: ProcessImage,
}

impl Areas {
    /// What the assignment objects come to; the code to show when they map what is not there, or
    /// assign PDOs that exclude each other. Inputs are looked at first.
    pub(super) fn of(
        dictionary: &Dictionary,
        buffers: &[ProcessBuffer],
        excludes: &[(u16, u16)],
    ) -> Result<Self, AlStatusCode> {
        let mut areas = Vec::with_capacity(buffers.len());
        for (direction, code) in [
            (Direction::Inputs, AlStatusCode::INVALID_INPUT_MAPPING),
            (Direction::Outputs, AlStatusCode::INVALID_OUTPUT_MAPPING),
        ] {
            for buffer in buffers.iter().filter(|buffer| buffer.direction == direction) {
                if process_image::excluded(dictionary, buffer.assignment(), excludes) {
                    return Err(code);
                }
                let image = ProcessImage::of(dictionary, buffer.assignment()).map_err(|_| code)?;
                areas.push(BufferArea { buffer: *buffer, image });
            }
        }
        Ok(Self(areas))
    }

    /// Each SyncManager of a direction with the bytes that it is to have.
    pub(super) fn lengths(&self, direction: Direction) -> impl Iterator<Item = (u8, usize)> {
        let mine = self.0.iter().filter(move |area| area.buffer.direction == direction);
        mine.map(|area| (area.buffer.sync_manager, area.image.len()))
    }

    /// Bytes in one direction.
    pub(super) fn len(&self, direction: Direction) -> usize {
        self.lengths(direction).map(|(_, len)| len).sum()
    }

    /// Fetches outputs into their objects; false when some never came yet.
    pub(super) fn take_outputs(
        &self,
        pdi: &mut Pdi<'_>,
        dictionary: &mut Dictionary,
        bytes: &mut Vec<u8>,
    ) -> bool {
        let mut all = true;
        for area in self.0.iter().filter(|area| area.buffer.direction == Direction::Outputs) {
            if area.image.len() == 0 {
                continue;
            }
            bytes.clear();
            bytes.resize(area.image.len(), 0);
            if pdi.read_sync_manager(area.buffer.sync_manager, bytes).is_some() {
                area.image.unpack(bytes, dictionary);
            } else {
                all = false;
            }
        }
        all
    }

    /// Gives inputs from their objects.
    pub(super) fn put_inputs(
        &self,
        pdi: &mut Pdi<'_>,
        dictionary: &Dictionary,
        bytes: &mut Vec<u8>,
    ) {
        for area in self.0.iter().filter(|area| area.buffer.direction == Direction::Inputs) {
            if area.image.len() > 0 {
                area.image.pack(dictionary, bytes);
                pdi.write_sync_manager(area.buffer.sync_manager, bytes);
            }
        }
    }
}
