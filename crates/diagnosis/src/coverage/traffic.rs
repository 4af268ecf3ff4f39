//! Frames as evidence: lost frames, and the times at which frames leave and come back.

use linesman_proto::address::Path;
use linesman_proto::time::Span;

use super::{Assessment, Basis, Extent, Gap, InputKind, Reason, Subject};

/// With fewer frames that came back nothing can be said of a line.
const FEW_FRAMES: u64 = 50;
/// From this share of returned frames on, in percent, frames that were cut off leave the rest unjudged.
const CUT_PERCENT: u64 = 1;
/// A recorder may show a single frame twice.
const FEW_DOUBLED: u64 = 2;
/// Of so many frames that came back one may get lost on a good line.
const RARE: u64 = 100_000;
/// Two interfaces' clocks differ by less.
const CLOCK_NOISE: Span = Span::ms(1);
/// A line that works is never quiet for so long.
const LONG_GAP: Span = Span::s(1);

/// Lost frames.
pub(super) fn frames(basis: &Basis<'_>) -> Assessment {
    let mut all = Assessment::judged(Subject::Frames);
    if !basis.has_frames && basis.model.reported.lost.is_none() {
        let shows_elsewhere = !basis.model.cyclic.is_empty() || basis.counters_tell;
        let text = "the number of frames that the MainDevice lost was not given";
        let gap = Gap::new(Reason::NotGiven, text).essential_if(!shows_elsewhere).step(
            "give what the MainDevice counted, `[maindevice]` with `lost = …`, or its working counters",
        );
        all.lacks(Extent::NotJudged, gap);
        return all;
    }
    list_unrecorded(basis, &mut all);
    list_lost(basis, &mut all);
    list_in_flight(basis, &mut all);
    all
}

/// Frames that the input lacks.
fn list_unrecorded(basis: &Basis<'_>, all: &mut Assessment) {
    let traffic = &basis.model.traffic;
    if traffic.is_one_sided() {
        let text = "frames of one direction only: lost frames cannot be told from answers";
        let gap = Gap::new(Reason::OneDirection, text).essential().step(
            "record both directions: on the MainDevice's own card, or with a tap that passes both",
        );
        all.lacks(Extent::NotJudged, gap);
    }
    // What a person typed was counted over a time of its own.
    let is_few = basis.input != InputKind::Typed && traffic.returns.count() < FEW_FRAMES;
    if is_few {
        let text =
            format!("{} frames came back: too few to judge a line by", traffic.returns.count());
        let gap = Gap::new(Reason::TooFewFrames, text).essential().step(basis.look_longer());
        all.lacks(Extent::InPart, gap);
    }
    if traffic.recording.cut() > 0 {
        let text = format!(
            "{} of {} frames were recorded without their end: working counters and data behind it are missing",
            traffic.recording.cut(),
            traffic.recording.frames()
        );
        let is_much = traffic.recording.cut() * 100 >= traffic.recording.frames() * CUT_PERCENT;
        let gap = Gap::new(Reason::FramesCut, text)
            .essential_if(is_much)
            .step("record whole frames: `tcpdump -s 0`, no snap length");
        all.lacks(Extent::InPart, gap);
    }
    if traffic.recording.missed() > 0 {
        let is_recorded = basis.input == InputKind::Recorded;
        let who = if is_recorded { "the recorder" } else { "the diagnosis" };
        let text = format!(
            "{who} did not keep up and missed {} of {} frames",
            traffic.recording.missed(),
            traffic.recording.frames() + traffic.recording.missed()
        );
        let step = match is_recorded {
            true => "record anew, with fewer other programs on that computer or a larger buffer",
            false => {
                "end other programs on this computer, or record the line and judge the recording: `--record`"
            }
        };
        let gap = Gap::new(Reason::FramesMissed, text).essential().step(step);
        all.lacks(Extent::InPart, gap);
    }
}

/// Frames that did not come back as they should.
fn list_lost(basis: &Basis<'_>, all: &mut Assessment) {
    let traffic = &basis.model.traffic;
    let lost = traffic.losses.frames().sum;
    if lost > 0 {
        let frames = if lost == 1 { "frame" } else { "frames" };
        let text = format!("{lost} {frames} did not come back, and nothing tells where");
        let is_much = lost.saturating_mul(RARE) > traffic.returns.count();
        let gap = Gap::new(Reason::FramesLost, text).essential_if(is_much).step(
            "read the counters of the MainDevice's card (`ethtool -S`) and the error counters of the SubDevices",
        );
        all.lacks(Extent::InPart, gap);
    }
    if traffic.returns.doubled() >= FEW_DOUBLED {
        let text = format!("{} frames came back a second time", traffic.returns.doubled());
        let gap = Gap::new(Reason::FramesDoubled, text).essential().step(
            "look for what sends frames on a second time: a bridge or a mirror port on this computer, a switch, a loop",
        );
        all.lacks(Extent::InPart, gap);
    }
    let copies = traffic.losses.copies(Path::A).sum + traffic.losses.copies(Path::B).sum;
    if copies > 0 {
        let text = format!("of {copies} frames the copy of one card alone came back");
        let is_much = copies.saturating_mul(RARE) > traffic.returns.count();
        let gap = Gap::new(Reason::FramesLost, text).essential_if(is_much).step(
            "record both cards of the ring, each as an interface of its own, and read the error counters of the SubDevices",
        );
        all.lacks(Extent::InPart, gap);
    }
    let swallowed: u64 = traffic.losses.swallowed().iter().map(|one| one.frames).sum();
    if basis.input != InputKind::Driven && swallowed > copies {
        let text = format!(
            "of {swallowed} frames in the ring what came back had been processed by nobody, and the other copy did not come"
        );
        let gap = Gap::new(Reason::FramesLost, text).essential().step(
            "read the error counters of all SubDevices and of both cards: something loses what card A sends",
        );
        all.lacks(Extent::InPart, gap);
    }
    if traffic.losses.copies_gone() > 0 {
        let text = "both copies of a frame came back through the ring, and later one alone";
        let gap = Gap::new(Reason::FramesLost, text).essential().step(
            "read DL status (0x0110) and the error counters of all SubDevices: something swallows what one card sends",
        );
        all.lacks(Extent::InPart, gap);
    }
}

/// Frames that were on their way when a recording ended, or were lost just before.
fn list_in_flight(basis: &Basis<'_>, all: &mut Assessment) {
    let recording = &basis.model.traffic.recording;
    let unsettled = basis.model.traffic.in_flight.unsettled();
    // Who listens or drives looks on until the frames are due, and so does who notes when the recording ended.
    if unsettled == 0 || basis.input != InputKind::Recorded || recording.is_end_known() {
        return;
    }
    let frames = if unsettled == 1 { "1 frame" } else { &format!("{unsettled} frames") };
    let text = format!(
        "{frames} had not come back when the recording ended: whether it ended just then, or the line did, is not told"
    );
    // Parts that are cut out of a recording end so as often as not.
    let gap = Gap::new(Reason::EndOpen, text).step(
        "record on for some seconds, with a recorder that notes its end: `linesman capture record`, or dumpcap",
    );
    all.lacks(Extent::InPart, gap);
}

/// Times.
pub(super) fn timing(basis: &Basis<'_>) -> Assessment {
    let traffic = &basis.model.traffic;
    let mut all = Assessment::judged(Subject::Timing);
    if !basis.has_frames {
        let text = "no frame was seen, so nothing is known of their times";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoFrames, text));
        return all;
    }
    let has_cycle = basis.model.cyclic.iter().any(|cyclic| cyclic.sent.cycle().is_some());
    if !has_cycle {
        let text = "no process data were seen in a cycle";
        all.lacks(Extent::NotJudged, Gap::new(Reason::NoProcessData, text));
    }
    if traffic.recording.clock_back() > CLOCK_NOISE {
        let text = format!(
            "the clock of the recording runs backwards, by {} at most",
            traffic.recording.clock_back()
        );
        let gap = Gap::new(Reason::ClockJumpsBack, text)
            .step("record with one clock, and do not join recordings");
        all.lacks(Extent::InPart, gap);
    }
    if traffic.recording.longest_gap() >= LONG_GAP {
        let text = format!("no frame was seen for {} in between", traffic.recording.longest_gap());
        all.lacks(Extent::InPart, Gap::new(Reason::LongGap, text));
    }
    all
}
