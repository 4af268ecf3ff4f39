//! Capture probe in a segment: at which plugs it is looped in, and what it has seen.

use linesman_config::attachment::Attachment;
use linesman_proto::address::DeviceId;
use linesman_proto::topology::End;

use super::Segment;
pub use crate::wire::capture_probe::ProbeFrame;
use crate::wire::capture_probe::{CHANNELS, LoopedProbe};

/// A capture probe that cannot be looped in.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ProbePlaceError {
    /// No such plug.
    #[error(
        "no link is plugged in at `{0}`: expected a port such as `K1.A` or `maindevice`, or a link such as \
         `maindevice-K1.A`, at the first end of which the probe sits"
    )]
    NoLink(String),
    /// Two channels on one link, or more channels than a probe has.
    #[error("`{0}`: one channel on a link, and {CHANNELS} channels at most")]
    Taken(String),
}

impl Segment {
    /// Loops a capture probe in: channel after channel, each at a plug, named by its port (`K1.A`, `maindevice`) or
    /// by a link (`maindevice-K1.A`), at the first end of which it sits. From now on every frame walks, and those
    /// that pass the probe are kept for [`Segment::poll_probe_frame`].
    ///
    /// # Errors
    /// [`ProbePlaceError`] names the place that is none.
    pub fn loop_in_probe(&mut self, places: &[String]) -> Result<(), ProbePlaceError> {
        let stamps = self.seed.stream("capture probe");
        self.world.capture_probe.get_or_insert_with(|| LoopedProbe::new(stamps));
        for place in places {
            let end = self.plug_written(place);
            let found = end.and_then(|end| Some((end, self.tree.link_at(end)?)));
            let (end, link) = found.ok_or_else(|| ProbePlaceError::NoLink(place.clone()))?;
            if !self.world.plug_probe(link, end) {
                return Err(ProbePlaceError::Taken(place.clone()));
            }
        }
        Ok(())
    }

    /// The earliest frame that a capture probe has seen by the time last told; its bytes replace those in `buffer`.
    pub fn poll_probe_frame(&mut self, buffer: &mut Vec<u8>) -> Option<ProbeFrame> {
        let (frame, mut bytes) = self.world.poll_probe_frame(self.now)?;
        std::mem::swap(buffer, &mut bytes);
        self.recycle(bytes);
        Some(frame)
    }

    /// The end of a link that is written in `place`.
    fn plug_written(&self, place: &str) -> Option<End> {
        let of_link = place.match_indices('-').find_map(|(at, _)| {
            let (from, to) = (self.end_written(&place[..at])?, self.end_written(&place[at + 1..])?);
            (self.tree.opposite(from) == Some(to)).then_some(from)
        });
        of_link.or_else(|| self.end_written(place))
    }

    fn end_written(&self, text: &str) -> Option<End> {
        match text.parse().ok()? {
            Attachment::MainDevice(path) => Some(End::MainDevice(path)),
            Attachment::Device { name, port } => {
                let id = self.names.iter().position(|known| *known == name)?;
                Some(End::Controller(*self.nodes.get(&DeviceId(id as u32))?, port))
            }
        }
    }
}
