//! # A link is up before it carries frames
//!
//! After a link came back, all frames vanished for a while.
//!
//! **How it is found.** A link was lost, once, and is back (0x0110, 0x0310 to 0x0313). While it was down the rest of
//! the line answered; with the link up again nothing came back at all, from nobody, for several frames, and then
//! everything did. On the cable of the card itself it shows when the card had its link back, which the system
//! tells to the millisecond, and several frames that it sent from then on still went missing. A recording does
//! not tell when the card had a link; but without one no frame is recorded as sent, and whoever searches for the
//! place where frames vanish has one, and begins as soon as it has.
//!
//! **What it means.** Ports open their loops as soon as they have a link. A switch, a media converter or a slow
//! device in between that shows its link before it forwards swallows every frame of the line meanwhile, not
//! only those for what is behind it. Watchdogs expire everywhere.
//!
//! **What to do.** Take the device in between out of the line, or switch off its power saving and its
//! spanning-tree waiting time. Where that cannot be, open the loops by hand (0x0100) after a while.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Tree};

use super::{Rule, RulePage, View, link_lost};
use crate::finding::{Condition, Evidence, LinkDirection, Place, Severity, Symptom};
use crate::locate::{LastHop, LinkLosses, LocateInput, Located};
use crate::model::{NetworkModel, Silence, search};

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "H103",
    name: "link-up-too-early",
    severity: Severity::Error,
    class: Class::Hardware,
    source: include_str!("early_link.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Fewer frames that vanish were on their way when the link changed.
const SEVERAL: u64 = 3;
/// So long nothing came back.
const BLIND: Span = Span::ms(5);
/// The loss of a link is read so long after it at most, or before it is counted.
const AROUND: Span = Span::s(1);
/// Counters are read so long after they counted.
const COUNTED: Span = Span::ms(250);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let Some(tree) = &model.tree else { return };
    let all = LinkLosses::all(model);
    let is_first =
        |drops: &&LinkLosses| matches!(tree.links()[drops.link].upstream, End::MainDevice(_));
    // Without the first link nobody answers in any case.
    let suspects: Vec<&LinkLosses> = match all.iter().find(is_first) {
        Some(first) => vec![first],
        None => all.iter().collect(),
    };
    // A link that comes and goes is another trouble.
    // So is one of which one end never knew: what is in between takes the link from both.
    let is_one = |drops: &&LinkLosses| {
        !drops.is_down && drops.count == 1 && !link_lost::is_one_sided(model, tree, drops)
    };
    for drops in suspects.into_iter().filter(is_one) {
        let silence = match tree.links()[drops.link].upstream {
            End::MainDevice(card) => behind_card(model, card),
            End::Controller(..) => behind_link(model, drops),
        };
        if let Some((silence, ended)) = silence {
            conditions.push(condition(model, tree, drops, (silence, ended)));
        }
    }
}

/// Silences that are over, long enough to be no accident.
fn silences(model: &NetworkModel) -> impl Iterator<Item = (&Silence, Instant)> {
    let over =
        model.traffic.losses.silences().iter().rev().filter_map(|one| Some((one, one.ended?)));
    over.filter(|(one, ended)| one.frames >= SEVERAL && ended.since(one.since.at) >= BLIND)
}

/// With another link than the first one lost, the rest of the line answers; unless all vanishes.
fn behind_link<'a>(model: &'a NetworkModel, drops: &LinkLosses) -> Option<(&'a Silence, Instant)> {
    let (from, to) = (drops.first.before(AROUND), drops.ended()? + AROUND);
    let is_then = |at: Instant| at >= from && at <= to;
    // Who starts anew at the begin of a line takes all the others with it.
    let fell = model.devices.iter().any(|device| {
        let mut falls = device.al.changes.iter().filter(|change| change.is_own_fall());
        falls.any(|change| change.to.state().state() == Some(AlState::Init) && is_then(change.at))
    });
    if fell {
        return None;
    }
    silences(model).find(|(silence, ended)| {
        is_then(silence.since.at) && !were_damaged(model, drops.link, silence, *ended)
    })
}

/// Whether as many frames were damaged elsewhere meanwhile: those are lost, too, but somebody counts them. What
/// a link swallows that carries nothing yet is counted by nobody.
fn were_damaged(model: &NetworkModel, link: usize, silence: &Silence, ended: Instant) -> bool {
    let Some(input) = LocateInput::of(model, true) else { return false };
    let located = Located::on(&input);
    let is_then =
        |first: Instant, last: Instant| first <= ended + COUNTED && last >= silence.since.at;
    let hops = located
        .hops
        .iter()
        .filter(|damage| damage.hop.link != link && is_then(damage.first, damage.last));
    let cards = located
        .last_hops
        .iter()
        .filter(|hop| matches!(hop, LastHop::Damaged { .. }) && is_then(hop.first(), hop.last()));
    let frames =
        hops.map(|damage| damage.frames).sum::<u64>() + cards.map(LastHop::frames).sum::<u64>();
    frames >= silence.frames
}

/// The card had its link again, and still nothing came back of what it sent from then on. When the link came is
/// known a little late at most: what was lost later was lost with the link up.
fn behind_card(model: &NetworkModel, card: Path) -> Option<(&Silence, Instant)> {
    let history = model.host.card(card);
    let came = |silence: &Silence| match history.carrier {
        Some(carrier) => (carrier.value && history.carrier_changes > 0).then_some(carrier.at),
        // Whoever began to search so late had no link before.
        None => search::began(model, silence)
            .map(|began| began.at)
            .filter(|began| began.since(silence.since.at) >= search::BEGINS_WITHIN)
            .or_else(|| sent_again(model, silence)),
    };
    let is_blind = |silence: &Silence| {
        came(silence).is_some_and(|came| {
            silence.since.at <= came
                && silence.has_three_since(came)
                && silence.last.at >= came + BLIND
        })
    };
    silences(model).find(|(silence, _)| is_blind(silence))
}

/// When frames were sent again of which none came back, after none had left. A card without a link takes none,
/// so none is recorded: it had its link again.
fn sent_again(model: &NetworkModel, silence: &Silence) -> Option<Instant> {
    model.quiet_before(silence).map(|pause| pause.to)
}

fn condition(
    model: &NetworkModel,
    tree: &Tree,
    drops: &LinkLosses,
    (silence, ended): (&Silence, Instant),
) -> Condition {
    let link = tree.links()[drops.link].map(|node| DeviceId(node as u32));
    let place = Place::link(model.network, link, Some(LinkDirection::Both));
    let since = silence.since;
    let text = format!(
        "nothing came back for {:.1} ms, {} frames, about when this link came up again; then everything did",
        ended.since(since.at).as_secs_f64() * 1e3,
        silence.frames
    );
    let all = model.devices.iter().flat_map(|device| {
        let id = device.id;
        [
            Symptom::Silent(id),
            Symptom::StateLost(id),
            Symptom::WorkingCounter(id),
            Symptom::Emergency(id),
        ]
    });
    Condition::new(&PAGE, place, FaultName::EarlyLink, since.at.min(drops.first))
        .confidence(0.7)
        .or(FaultName::LinkFlapping, 0.15)
        .confirmed(ended)
        .ended(ended.max(drops.ended().unwrap_or(ended)))
        .shown_by(Evidence::frame(since.at, since.frame.unwrap_or(0), text))
        .explaining(link_lost::follows(model, tree, drops.link))
        .explaining([Symptom::FramesLost, Symptom::NobodyAnswers, Symptom::NoCarrier])
        .explaining(all)
        .advise(
            "Look what is between the two ends of this link: a switch, a converter, a slow device.",
        )
        .advise("Connect both ends with a cable, and unplug and plug it: all else must go on.")
}
