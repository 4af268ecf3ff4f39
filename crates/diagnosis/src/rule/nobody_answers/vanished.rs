//! Silences in which nothing came back, and what is said of them.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::Span;
use linesman_proto::topology::End;

use super::{CERTAIN, FEW, advise, causes, first_device, first_end, restarted};
use crate::finding::{Condition, Evidence, Symptom};
use crate::locate::LocateInput;
use crate::main_device::MainDeviceKind;
use crate::model::{NetworkModel, Seen, Silence, Stillness, Tally, search};
use crate::rule::View;

/// More in a row than noise takes from a line that still answers.
const LONG: u64 = 32;
/// Cards are looked at now and then only: a silence must last so long before their link proves anything.
const CARRIER_LATE: Span = Span::ms(300);
/// Time from the loss of its link until a card takes no frames any more: drivers look for it every second or two.
const CARRIER_KNOWN: Span = Span::ms(2_200);
/// Ports that were closed in a silence keep it from being one; what follows so soon belongs to it.
const SAME_SILENCE: Span = Span::ms(100);
/// A receiver of 100BASE-TX wants a signal for so long at least before its link is up again (IEEE 802.3,
/// 24.3.4.4, stabilize_timer): what was over before was no open link. It is damage, or the computer.
const LINK_UP: Span = Span::us(330);

/// The latest silence, or the one that lasts; and whether frames of one card of a ring alone came round in it.
pub(super) fn latest(view: &View<'_>) -> Option<(Silence, bool)> {
    let losses = &view.model.traffic.losses;
    let swallowed = losses.swallowed().iter().rev().find(|silence| silence.frames >= CERTAIN);
    let silence = losses.silences().iter().rev().find(|silence| is_long(view, silence));
    let silence = silence.into_iter().chain(swallowed).max_by_key(|one| one.since.at)?;
    Some((*silence, swallowed.is_some_and(|one| one.since == silence.since)))
}

fn is_long(view: &View<'_>, silence: &Silence) -> bool {
    match silence.ended {
        Some(ended) => {
            silence.frames >= CERTAIN
                && ended.since(silence.since.at) >= LINK_UP
                && !view.model.traffic.recording.was_bad(silence.since.at, ended)
        }
        // A few at the end, where a few were lost all along, are more of the same.
        None => {
            let is_few =
                silence.frames >= FEW && view.has_ended && !is_among_others(view.model, silence);
            silence.frames >= CERTAIN || is_few || stillness(view, silence).is_some()
        }
    }
}

/// The stillness behind a request that did not come back, and was the last frame of all. The system hands no frames to a card
/// that has lost its link; of a program that was ended, the last request would have come back, and only of those is it known
/// that they go on when one did not. Both cards of a ring lose theirs at once where one SubDevice hangs on both.
fn stillness(view: &View<'_>, silence: &Silence) -> Option<Stillness> {
    let model = view.model;
    let goes_on = matches!(
        model.main_device_kind(),
        MainDeviceKind::Linesman | MainDeviceKind::Igh | MainDeviceKind::Twincat
    );
    if !goes_on
        || silence.ended.is_some()
        || is_among_others(model, silence)
        || model.host.card(Path::A).carrier.is_some()
    {
        return None;
    }
    let closes_at = model.tree.as_ref().and_then(|tree| tree.closes_at());
    let hangs_on_all =
        closes_at.is_none_or(|(node, _)| first_device(model).map(DeviceId::index) == Some(node));
    model.stillness().filter(|_| hangs_on_all)
}

/// Condition of a silence; none if it is damage that other rules place.
pub(super) fn condition(
    view: &View<'_>,
    silence: &Silence,
    is_swallowed: bool,
) -> Option<Condition> {
    let model = view.model;
    let silence = searched(model, silence);
    let is_hole = is_swallowed || nothing_was_cut(view, &silence);
    let was_searched = model.hole.is_some_and(|hole| hole.since == silence.since);
    if is_hole && !was_searched && is_among_others(model, &silence) {
        // Frames are lost here and there.
        return None;
    }
    let outage = Outage::of(view, silence);
    let mut condition = outage.shown(outage.cause(is_hole));
    if silence.frames >= CERTAIN || view.has_ended {
        condition = condition.confirmed(silence.last.at);
    }
    if let Some(ended) = silence.ended {
        condition = condition.ended(ended);
    }
    Some(outage.advised(outage.linked(condition)))
}

/// Nothing comes back: what is known of it.
struct Outage<'v> {
    view: &'v View<'v>,
    silence: Silence,
    /// True if anybody has answered before.
    was_answered: bool,
    /// Link of the card, if that is known.
    carrier: Option<bool>,
    /// The time behind it in which nothing was sent any more.
    still: Option<Stillness>,
    /// Damaged frames that the card received meanwhile, if it did.
    spoiled: Option<Tally>,
    /// The link behind which frames vanish, if it was looked for and found.
    found: Option<Seen<usize>>,
}

impl<'v> Outage<'v> {
    fn of(view: &'v View<'v>, silence: Silence) -> Self {
        let model = view.model;
        let crc = model.host.card(Path::A).crc;
        let is_meanwhile = |tally: &Tally| {
            tally.of_spell() > 0 && tally.last.is_some_and(|last| last >= silence.since.at)
        };
        Self {
            view,
            silence,
            was_answered: model.traffic.datagrams.answered() > 0,
            carrier: carrier_during(model, &silence),
            still: stillness(view, &silence),
            spoiled: Some(crc).filter(is_meanwhile),
            found: found_hole(model, &silence),
        }
    }

    fn cause(&self, is_hole: bool) -> Condition {
        let (model, silence) = (self.view.model, &self.silence);
        let since = silence.since.at;
        if let Some((count, seen)) = restarted::others_with(model, silence) {
            return restarted::without_supply(model, silence, count, seen);
        }
        match (self.found, self.spoiled, is_hole) {
            (Some(found), ..) => causes::placed(model, since, found),
            (None, Some(_), _) => causes::spoiling(model, since),
            (None, None, true) => causes::hole(self.view, silence),
            (None, None, false) => {
                let lasted = silence.last.at.since(since);
                let carrier = self.carrier.filter(|_| lasted >= CARRIER_LATE);
                let carrier = carrier.or(self.still.map(|_| false));
                let closes = model.tree.as_ref().is_some_and(|tree| tree.closes_at().is_some());
                if let Some(id) = first_device(model).filter(|_| closes && self.still.is_some()) {
                    return causes::dark(model, since, id);
                }
                // A search that closed ports in vain leaves the first link.
                causes::cut(model, since, carrier, search::began(model, silence).is_some())
            }
        }
    }

    fn shown(&self, condition: Condition) -> Condition {
        let (model, since) = (self.view.model, self.silence.since);
        let frame = since.frame.unwrap_or(0);
        let mut condition = condition.shown_by(Evidence::frame(since.at, frame, self.requests()));
        if let Some(spoiled) = self.spoiled {
            let text = format!(
                "the card received {} damaged frames meanwhile: the way round is whole, but something on \
                 it spoils every frame",
                spoiled.of_spell()
            );
            condition = condition.shown_by(Evidence::host(spoiled.last, text));
        }
        if self.was_answered
            && let Some(returned) = model.traffic.returns.latest()
        {
            let frame = returned.frame.unwrap_or(0);
            let text = "the last frame that came back".to_owned();
            if returned.at <= since.at {
                condition = condition.shown_by(Evidence::frame(returned.at, frame, text));
            }
        }
        if let Some(still) = self.still {
            let text = format!(
                "nothing was sent from then on, for {}, until the input ended: the system hands no frames to a card \
                 that has lost its link (or the program of the MainDevice has ended just then)",
                still.lasted
            );
            condition = condition.shown_by(Evidence::host(Some(self.silence.last.at), text));
        }
        match self.carrier {
            Some(carrier) => condition.shown_by(self.link_of_card(carrier)),
            None => condition,
        }
    }

    /// Fate of the requests, in words.
    fn requests(&self) -> String {
        let (frames, since) = (self.silence.frames, self.silence.since);
        let mut swallowed = self.view.model.traffic.losses.swallowed().iter();
        if swallowed.any(|one| one.since == since) {
            format!(
                "from here on {frames} requests in a row came round as card B had sent them, and not as card A had"
            )
        } else if self.was_answered && frames == 1 {
            "this request did not come back, and is the last one".to_owned()
        } else if self.was_answered {
            format!("from here on {frames} requests in a row did not come back")
        } else {
            format!("first of {frames} requests; none came back")
        }
    }

    /// Evidence that the card had a link, or none.
    fn link_of_card(&self, carrier: bool) -> Evidence {
        let (model, silence) = (self.view.model, &self.silence);
        let told = model.host.card(Path::A).carrier.map(|carrier| carrier.at);
        let began = search::began(model, silence).map(|began| began.at);
        let text = match (carrier, told) {
            (true, Some(_)) => "card A has a link",
            (true, None) if began.is_some() => {
                "ports were closed meanwhile to find the place: who does so has a link"
            }
            (true, None) => "frames went on leaving the card, and none leaves one without a link",
            (false, _) => "card A had no link meanwhile",
        };
        Evidence::host(told.or(began).or(Some(silence.last.at)), text)
    }

    /// Frames that are damaged on their way are missing, too, and a few in a row may be noise.
    const fn may_be_noise(&self) -> bool {
        let is_short = self.silence.ended.is_some() || self.silence.frames < LONG;
        self.was_answered && is_short && self.still.is_none()
    }

    fn linked(&self, condition: Condition) -> Condition {
        let symptom =
            if self.may_be_noise() { Symptom::FramesLost } else { Symptom::NobodyAnswers };
        let devices = self.view.model.devices.iter().map(|device| device.id);
        let follows = devices.flat_map(|id| {
            [
                Symptom::Silent(id),
                Symptom::WorkingCounter(id),
                Symptom::StateLost(id),
                Symptom::Emergency(id),
            ]
        });
        let condition = condition
            .about([symptom])
            .explaining(follows)
            .explaining([Symptom::FramesLost, Symptom::NoCarrier]);
        if self.spoiled.is_some() && !self.may_be_noise() {
            return condition.explaining([Symptom::CardErrors]);
        }
        condition
    }

    fn advised(&self, condition: Condition) -> Condition {
        if self.spoiled.is_some() {
            return condition
                .advise(
                    "Take SubDevices away from the far end, or plug the cable behind the first half \
                     out: when frames come back, what spoils them lies behind.",
                )
                .advise("Then read the error counters: they name the link.");
        }
        let lasts = self.silence.ended.is_none();
        let is_linked = self.carrier == Some(true);
        if self.found.is_none() && self.was_answered && is_linked && lasts {
            let condition = condition.advise(
                "While it lasts, let `linesman diagnose --active` search: it closes one port after the other \
                 for a moment, until frames come back, and names the link.",
            );
            return advise(condition, self.carrier);
        }
        advise(condition, self.carrier)
    }
}

/// A silence as it is without the ports that were closed to find its place: frames that come back meanwhile
/// do not end it.
fn searched(model: &NetworkModel, silence: &Silence) -> Silence {
    let mut whole = *silence;
    if let Some(hole) = model.hole.filter(|hole| hole.since.at <= silence.since.at) {
        let is_one = hole.ended.is_none_or(|ended| silence.since.at <= ended + SAME_SILENCE);
        if is_one {
            whole.since = hole.since;
            whole.ended = silence.ended.filter(|_| hole.ended.is_some());
        }
    }
    whole
}

/// The link behind which frames vanish, if it was looked for in this silence and found.
fn found_hole(model: &NetworkModel, silence: &Silence) -> Option<Seen<usize>> {
    // Where nobody tells, frames that came back meanwhile have shown that the card has one.
    let has_link = model.host.card(Path::A).carrier.is_none_or(|carrier| carrier.value);
    model.hole.filter(|hole| hole.since == silence.since && has_link)?.found
}

/// True if a silence is over, and neither a link nor the first SubDevice was lost meanwhile, as what was
/// read of the first SubDevice since then shows.
fn nothing_was_cut(view: &View<'_>, silence: &Silence) -> bool {
    let model = view.model;
    let (Some(ended), Some(input)) = (silence.ended, LocateInput::of(model, view.has_ended)) else {
        return false;
    };
    let Some(End::Controller(first, port)) = first_end(model) else { return false };
    let Some(device) = model.device(first) else { return false };
    let lost = device.counters.track(ErrorCounter::LostLink(port));
    let was_read = lost.is_some_and(|track| track.last.at > ended);
    let was_card_cut = model.host.card(Path::A).carrier.is_some_and(|carrier| {
        !carrier.value
            || (carrier.at >= silence.since.at && model.host.card(Path::A).carrier_changes > 0)
    });
    let has_fallen = model.devices.iter().any(|device| {
        device.al.changes.iter().any(|change| change.at >= silence.since.at && change.is_own_fall())
    });
    was_read && !was_card_cut && !has_fallen && !input.any_link_changed(silence.since.at, ended)
}

/// True if other frames were lost than those of a silence, with others coming back between them.
fn is_among_others(model: &NetworkModel, silence: &Silence) -> bool {
    let lost = model.traffic.losses.frames();
    let share = lost.of_spell().saturating_sub(silence.frames);
    share >= FEW && share * 50 >= silence.frames
}

/// Link of the card during a silence; `None` when neither the host says so nor anybody who searched
/// for the place, which nobody does without one, nor frames that went on leaving it.
fn carrier_during(model: &NetworkModel, silence: &Silence) -> Option<bool> {
    let card = model.host.card(Path::A);
    let Some(carrier) = card.carrier else {
        return (search::began(model, silence).is_some() || went_on_leaving(model, silence))
            .then_some(true);
    };
    let came_back = carrier.value && card.carrier_changes > 0 && carrier.at >= silence.since.at;
    Some(carrier.value && !came_back)
}

/// True if frames were seen to leave the card itself for so long that it had a link: the system hands none to a card
/// without one, once it knows.
fn went_on_leaving(model: &NetworkModel, silence: &Silence) -> bool {
    let is_host = model.traffic.requests.senders().iter().any(|sender| sender.is_host);
    is_host && silence.last.at.since(silence.since.at) >= CARRIER_KNOWN
}
