//! A recording as turns: a request and what came back for it.

mod repair;

use linesman_diagnosis::FrameSeen;
use linesman_diagnosis::observe::{Exchange, Fingerprint, FrameCopy, Pairing};
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::{FrameError, FrameView};
use linesman_proto::time::Instant;

/// A frame of the recording.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Frame {
    /// Its number, as a capture tool counts.
    pub number: u64,
    /// When it was seen.
    pub at: Instant,
    /// From the destination address on, without check sequence.
    pub bytes: Vec<u8>,
}

/// One datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Datagram<'a> {
    /// Its command; `None` for one that is none.
    pub command: Option<Command>,
    /// Position or station.
    pub adp: u16,
    /// Register or memory.
    pub ado: RegisterAddress,
    /// The logical address, where the command has one.
    pub logical: LogicalAddress,
    /// Its data.
    pub data: &'a [u8],
    /// Its working counter.
    pub wkc: u16,
    /// Its event field.
    pub irq: u16,
}

impl Frame {
    fn of(copy: &FrameCopy<'_>) -> Self {
        Self { number: copy.number, at: copy.time, bytes: copy.bytes.to_vec() }
    }

    /// Its datagrams, as far as they can be read.
    #[must_use]
    pub fn datagrams(&self) -> Vec<Datagram<'_>> {
        datagrams(&self.bytes)
    }
}

/// The datagrams of a frame, as far as they can be read.
#[must_use]
pub fn datagrams(frame: &[u8]) -> Vec<Datagram<'_>> {
    let Ok(view) = FrameView::parse(frame) else { return Vec::new() };
    view.datagrams()
        .map_while(Result::ok)
        .map(|datagram| Datagram {
            command: datagram.command(),
            adp: datagram.adp(),
            ado: datagram.ado(),
            logical: datagram.logical(),
            data: datagram.data(),
            wkc: datagram.wkc().value(),
            irq: datagram.irq(),
        })
        .collect()
}

/// A request, and what came back.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Turn {
    /// What went out.
    pub request: Frame,
    /// What came back; `None` when nothing did.
    pub reply: Option<Frame>,
    /// The request is not in the recording: it was made of what came back. What is learned of it
    /// counts, and it is played, so that devices stay in step; it is not judged.
    pub is_rebuilt: bool,
}

impl Turn {
    /// Datagrams that went out beside the same ones as they came back; empty when nothing did.
    #[must_use]
    pub fn pairs(&self) -> Vec<(Datagram<'_>, Datagram<'_>)> {
        let Some(reply) = &self.reply else { return Vec::new() };
        self.request.datagrams().into_iter().zip(reply.datagrams()).collect()
    }
}

/// What a capture holds of a line's traffic.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Recording {
    /// By the time of their requests.
    pub turns: Vec<Turn>,
    /// Frames that came back while their request was not recorded.
    pub alone: u64,
    /// EtherCAT frames that cannot be used: damaged, cut off by the recorder, or without datagrams.
    pub unusable: u64,
    /// Frames of other protocols.
    pub other_traffic: u64,
    /// Number of the first frame that lacks its request or its return, or cannot be used.
    pub first_gap: Option<u64>,
}

impl Recording {
    fn gap(&mut self, number: u64) {
        self.first_gap = Some(self.first_gap.map_or(number, |first| first.min(number)));
    }
}

/// Takes the frames of a capture, one after the other.
#[derive(Default, Debug)]
pub struct Recorder {
    pairing: Pairing,
    recording: Recording,
    /// Returns whose request was not seen.
    alone: Vec<Frame>,
    /// Time of the latest frame.
    latest: Instant,
}

impl Recorder {
    /// The next frame.
    pub fn take(&mut self, frame: &FrameSeen<'_>) {
        self.latest = self.latest.max(frame.time);
        let view = match FrameView::parse(frame.bytes) {
            Ok(view) if frame.fcs != Some(false) && !frame.truncated => view,
            Err(FrameError::NotEtherCat { .. }) => {
                self.recording.other_traffic += 1;
                return;
            }
            Ok(_) | Err(_) => {
                self.recording.unusable += 1;
                self.recording.gap(frame.number);
                return;
            }
        };
        let print = Fingerprint::of(&view);
        let (recording, alone) = (&mut self.recording, &mut self.alone);
        self.pairing.take(frame, &view, print, &mut |exchange| note(recording, alone, exchange));
    }

    /// There are no more frames.
    #[must_use]
    pub fn finish(mut self) -> Recording {
        let (recording, alone) = (&mut self.recording, &mut self.alone);
        self.pairing.finish(self.latest, &mut |exchange| note(recording, alone, exchange));
        // By number: time stamps may run backwards.
        recording.turns.sort_by_key(|turn| turn.request.number);
        repair::repair(recording, std::mem::take(alone));
        self.recording.turns.sort_by_key(|turn| turn.request.number);
        self.recording
    }
}

fn note(recording: &mut Recording, alone: &mut Vec<Frame>, exchange: &Exchange<'_>) {
    match (&exchange.request, &exchange.reply) {
        (Some(request), reply) => {
            // In a ring the second copy comes back for a request that is noted already.
            let known = recording.turns.iter_mut().rev().take(64);
            let known = known.into_iter().find(|turn| turn.request.number == request.number);
            let reply = reply.as_ref().map(Frame::of);
            match known {
                Some(turn) => {
                    if turn.reply.is_none() {
                        turn.reply = reply;
                    }
                }
                None => recording.turns.push(Turn {
                    request: Frame::of(request),
                    reply,
                    is_rebuilt: false,
                }),
            }
        }
        (None, Some(reply)) => {
            alone.push(Frame::of(reply));
        }
        (None, None) => {}
    }
}
