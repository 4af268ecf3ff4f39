//! Terminals without a controller: they stand in the file where they stand in the cabinet, and no
//! frame knows of them. What hangs on one hangs, for frames, on what it hangs on itself.

use linesman_config::attachment::Attachment;
use linesman_proto::port::Port;

use super::{SegmentDevice, SegmentFile, SegmentFileError};
use crate::device::library::{Passive, passive};

/// The passive terminals of a file.
#[derive(Debug)]
pub(super) struct Passives<'a>(Vec<(&'a SegmentDevice, &'static Passive)>);

impl<'a> Passives<'a> {
    pub(super) fn of(file: &'a SegmentFile) -> Self {
        let devices = file.devices.iter();
        Self(devices.filter_map(|one| Some((one, passive(&one.type_name)?))).collect())
    }

    /// All of them.
    pub(super) fn devices(&self) -> impl Iterator<Item = &'a SegmentDevice> + '_ {
        self.0.iter().map(|(device, _)| *device)
    }

    fn named(&self, name: &str) -> Option<(&'a SegmentDevice, &'static Passive)> {
        self.0.iter().copied().find(|(device, _)| device.name == name)
    }

    /// What is really meant by a place to hang on, and whether the E-bus is fed anew on the way there.
    pub(super) fn resolve(
        &self,
        device: &SegmentDevice,
    ) -> Result<(Attachment, bool), SegmentFileError> {
        let misplaced =
            |why: String| Err(SegmentFileError::Misplaced { device: device.name.clone(), why });
        let (mut on, mut fed) = (device.on.clone(), false);
        // Each passive terminal is passed once at most.
        for _ in 0..=self.0.len() {
            let Attachment::Device { name, port } = &on else { return Ok((on, fed)) };
            let Some((between, known)) = self.named(name) else { return Ok((on, fed)) };
            if known.ends_bus {
                return misplaced(format!(
                    "it hangs on `{name}`, but nothing can be put behind an {}",
                    known.name
                ));
            }
            if *port != Port::B {
                return misplaced(format!(
                    "it hangs on `{on}`, but an {} goes on at its port B only",
                    known.name
                ));
            }
            fed |= known.supplies_ma > 0;
            on = between.on.clone();
        }
        misplaced("its wiring runs in a circle of terminals without a controller".to_owned())
    }
}
