//! SubDevices that are silent together: behind one link, or with one that has started anew.

use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Link, Tree};

use crate::model::is_on_terminal_bus;
use crate::model::{Absence, Device, NetworkModel, Seen};
use crate::rule::View;

/// Who did not answer for so long was away.
const LONG: Span = Span::ms(100);
/// An absence that has been over for so long is history.
const TOLD_FOR: Span = Span::ms(2_500);
/// What was on its way when somebody fell silent comes back by then.
const ANSWERS_LATE: Span = Span::ms(100);

/// The absence of a SubDevice that lasts, or was over a moment ago. While addresses are given nobody answers to them
/// for a while.
pub(super) fn absence(view: &View<'_>, device: &Device) -> Option<Absence> {
    let latest = *device.joined_absences().last()?;
    let Some(ended) = latest.ended else { return Some(latest) };
    let is_told = ended.since(latest.since.at) >= LONG && view.now.since(ended) <= TOLD_FOR;
    is_told.then_some(latest)
}

/// SubDevices that fell silent together: behind one link, of which nobody says that it is up, or with one through which
/// frames go on to others.
pub(super) struct Branch {
    /// The link; `None` where nobody has seen what the first of them hangs on.
    pub(super) link: Option<Link<DeviceId>>,
    /// Somebody behind the first of them who has answered since.
    pub(super) passed_to: Option<(DeviceId, Seen<()>)>,
    /// Whether the first of them hangs on the terminal bus.
    pub(super) is_on_terminal_bus: bool,
    /// Those that are silent, the first in the order of frames at the head.
    pub(super) devices: Vec<DeviceId>,
    /// The first datagram that none of them answered.
    pub(super) since: Seen<()>,
    /// When all of them answered again.
    pub(super) ended: Option<Instant>,
}

/// All branches that are silent as a whole, or were a moment ago, while whoever is before them answers.
pub(super) fn silent_branches(view: &View<'_>) -> Vec<Branch> {
    let model = view.model;
    let away: Vec<Option<Absence>> =
        model.devices.iter().map(|device| absence(view, device)).collect();
    let is_silent = |id: &DeviceId| away.get(id.index()).is_some_and(Option::is_some);
    // How many answer says the same, and where.
    if counts_all(model, &away) || model.reported.answering.is_some() {
        return Vec::new();
    }
    let branches = match model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len()) {
        Some(tree) => in_tree(model, tree, &is_silent, &away),
        None => in_order(model, &is_silent, &away),
    };
    branches.into_iter().filter(|branch| !is_up(model, branch)).collect()
}

impl Branch {
    /// Whether one of them has started anew since: it was without supply, and no link that opens does that.
    pub(super) fn was_without_supply(&self, model: &NetworkModel) -> bool {
        let has_restarted = |id: &DeviceId| model.device(*id).is_some_and(Device::has_restarted);
        self.ended.is_some() && self.devices.iter().any(has_restarted)
    }
}

/// Whether broadcasts went on counting all: who still counts is there, and has lost its address.
fn counts_all(model: &NetworkModel, away: &[Option<Absence>]) -> bool {
    let traffic = &model.traffic;
    let (Some(now), Some(read)) = (traffic.broadcasts.now(), traffic.broadcasts.latest()) else {
        return false;
    };
    let since = || away.iter().flatten().map(|absence| absence.since.at);
    // Who was not asked again since all were counted may have come back with them.
    let lasts = away.iter().zip(&model.devices).any(|(absence, device)| {
        absence.is_some_and(|absence| absence.ended.is_none())
            && device.last_unanswered.is_none_or(|last| last >= now.at)
    });
    usize::from(now.value) >= model.devices.len()
        && since().max().is_some_and(|latest| read >= latest)
        && (lasts || since().min().is_some_and(|first| now.at < first))
}

fn in_tree(
    model: &NetworkModel,
    tree: &Tree,
    is_silent: &dyn Fn(&DeviceId) -> bool,
    away: &[Option<Absence>],
) -> Vec<Branch> {
    let id = |node: usize| DeviceId(node as u32);
    let heads = tree.order().iter().copied().filter(|node| {
        let above = tree.upstream(*node).and_then(|end| end.node());
        // Behind a link of the ring nobody falls silent: frames come from the other side.
        let is_on_ring = tree.link_above(*node).is_some_and(|link| tree.is_on_ring(link));
        !is_on_ring
            && above.is_some_and(|above| !is_silent(&id(above)))
            && tree.subtree(*node).iter().all(|node| is_silent(&id(*node)))
    });
    let branch = |head: usize| {
        let link = tree.links().get(tree.link_above(head)?)?.map(id);
        let devices: Vec<DeviceId> = tree.subtree(head).iter().map(|node| id(*node)).collect();
        Some(Branch {
            link: Some(link),
            passed_to: None,
            is_on_terminal_bus: is_on_terminal_bus(model, head),
            since: since(away, &devices)?,
            ended: ended(away, &devices),
            devices,
        })
    };
    heads.filter_map(branch).collect()
}

/// Where nobody has seen the wiring: those that follow upon one another in the order of positions, which is that in which
/// frames reach them, so that all behind a link do. Somebody before them answers.
fn in_order(
    model: &NetworkModel,
    is_silent: &dyn Fn(&DeviceId) -> bool,
    away: &[Option<Absence>],
) -> Vec<Branch> {
    let is_away = |device: &Device| is_silent(&device.id);
    // Of whom nothing was heard and who was not asked nobody knows.
    let is_known = |device: &&Device| is_away(device) || device.answered.is_some();
    let known: Vec<&Device> = model.devices.iter().filter(is_known).collect();
    let runs = known.chunk_by(|one, next| is_away(one) == is_away(next));
    let silent = runs.skip(1).filter(|run| run.first().is_some_and(|first| is_away(first)));
    let branch = |run: &[&Device]| {
        let devices: Vec<DeviceId> = run.iter().map(|device| device.id).collect();
        Some(Branch {
            link: None,
            passed_to: None,
            is_on_terminal_bus: false,
            since: since(away, &devices)?,
            ended: ended(away, &devices),
            devices,
        })
    };
    silent.filter_map(branch).collect()
}

/// Those that stay silent though frames go through the first of them, to others that have answered since: they have their
/// supply, and not their station addresses.
pub(super) fn passed(view: &View<'_>) -> Vec<Branch> {
    let model = view.model;
    let lasting = |device: &Device| absence(view, device).filter(|one| one.ended.is_none());
    let away: Vec<Option<Absence>> = model.devices.iter().map(lasting).collect();
    let is_silent = |id: DeviceId| away.get(id.index()).is_some_and(Option::is_some);
    let group = |head: DeviceId, behind: &mut dyn Iterator<Item = DeviceId>| {
        let head_since = away.get(head.index()).copied().flatten()?.since;
        let (mut devices, mut passed_to) = (vec![head], None);
        for id in behind {
            if is_silent(id) {
                devices.push(id);
                continue;
            }
            let answered = model.device(id).and_then(|device| device.answered);
            let later = answered.filter(|seen| seen.at > head_since.at + ANSWERS_LATE);
            passed_to = passed_to.or(later.map(|seen| (id, seen)));
        }
        passed_to?;
        let since = since(&away, &devices)?;
        let (link, is_on_terminal_bus, ended) = (None, false, None);
        Some(Branch { link, passed_to, is_on_terminal_bus, devices, since, ended })
    };
    let id = |node: usize| DeviceId(node as u32);
    match model.tree.as_ref().filter(|tree| tree.len() <= model.devices.len()) {
        Some(tree) if tree.closes_at().is_some() => Vec::new(),
        Some(tree) => {
            let is_head = |node: &usize| {
                let above = tree.upstream(*node).and_then(|end| end.node());
                is_silent(id(*node)) && above.is_none_or(|above| !is_silent(id(above)))
            };
            let heads = tree.order().iter().copied().filter(is_head);
            let behind = |head: usize| tree.subtree(head).iter().skip(1).map(|node| id(*node));
            heads.filter_map(|head| group(id(head), &mut behind(head))).collect()
        }
        // Whatever hangs on what, frames go through the first one to all others: of those that follow upon it and are
        // silent with it nobody knows more.
        None => {
            let all = model.devices.iter().map(|device| device.id);
            let mut all = all
                .skip_while(|id| !is_silent(*id) && model.devices[id.index()].answered.is_none());
            let head = all.next().filter(|head| is_silent(*head));
            head.and_then(|head| group(head, &mut all)).into_iter().collect()
        }
    }
}

fn since(away: &[Option<Absence>], devices: &[DeviceId]) -> Option<Seen<()>> {
    let absences = devices.iter().filter_map(|id| away.get(id.index()).copied().flatten());
    absences.map(|absence| absence.since).min_by_key(|seen| seen.at)
}

/// When all of them answered again.
fn ended(away: &[Option<Absence>], devices: &[DeviceId]) -> Option<Instant> {
    let absences = devices.iter().map(|id| away.get(id.index()).copied().flatten());
    let ended: Option<Vec<Instant>> = absences.map(|absence| absence?.ended).collect();
    ended?.into_iter().max()
}

/// Whether the near end says, after all fell silent, that the link is there, or that it is not: then another rule
/// tells of it.
fn is_up(model: &NetworkModel, branch: &Branch) -> bool {
    let Some(End::Controller(id, _)) = branch.link.map(|link| link.upstream) else { return false };
    let dl = model.device(id).map(|device| &device.dl).filter(|dl| !dl.is_assumed);
    let read = dl.and_then(|dl| dl.latest_reading);
    read.is_some_and(|read| read >= branch.since.at)
}
