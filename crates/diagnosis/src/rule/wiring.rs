//! # Wired otherwise than planned
//!
//! All SubDevices answer, but the tree that they form is not the planned one.
//!
//! **How it is found.** The tree that was found follows from the open ports (0x0110) in the order of
//! processing, and from the receive times of the ports (0x0900): the port with the earliest time is the one
//! by which frames come in. It is laid upon the planned tree with the identities (SII words 0x08 to 0x0F,
//! object 0x1018) and aliases (0x0012) of all SubDevices, at the least cost: one cable, or one device, at a
//! time. Whole branches that are missing and nothing else are no matter of this rule: they may be without
//! power, or cut off. Without identities, and without a plan, links tell: who answers though its IN port has no link
//! is entered by another one.
//!
//! **What it means.**
//!
//! * `C304` a SubDevice is plugged in the wrong way round: frames come in at another port than planned. Of
//!   the first one: the MainDevice is plugged into the wrong port. Or a cable leads to another port or
//!   SubDevice than planned, with all behind it. In a closed ring no receive times tell; there somebody is
//!   plugged in the wrong way round when both copies of a broadcast are processed, that of card B by him and
//!   all that hangs on him. When that of card B alone is processed, by all, it is the cards that are exchanged.
//! * `C305` two SubDevices of the same kind sit in each other's place; only alias or serial number tell.
//!
//! Everything may run all the same. A reversed SubDevice works on what hangs on its port A before itself,
//! which breaks clocks and positions; a cable elsewhere lets outputs go to another machine part.
//!
//! **What to do.** Compare the cables at the named ports with the drawing, in the named order. IN is port A,
//! the upper socket (X1) of most couplers. Where the wiring is what is wanted, scan anew and save the project.

pub(super) mod entry;

use linesman_config::compare::{Comparison, Difference, Unlike};
use linesman_config::fault::{Class, FaultName};
use linesman_config::identity;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::register::table;
use linesman_proto::topology::derive::EntryBasis;
use linesman_proto::topology::{End, Tree};

use super::identity::{EXTRA, MISSING, WRONG};
use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::found_wiring::{FoundWiring, displaced, wanted};
use crate::model::{NetworkModel, Seen};

/// Plugged otherwise.
pub const PLUGGED: RulePage = RulePage {
    code: "C304",
    name: "plugged-otherwise",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("wiring.rs"),
};

/// Twins in each other's place.
pub const TWINS: RulePage = RulePage {
    code: "C305",
    name: "twins-swapped",
    severity: Severity::Error,
    class: Class::Configuration,
    source: include_str!("wiring.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PLUGGED, TWINS], judge };

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    compared(view, conditions);
    let by_links = entry::conditions(view.model, conditions);
    conditions.extend(by_links);
}

fn compared(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let Some(found) = FoundWiring::of(view.model) else { return };
    let comparison = found.compare();
    if !found.tells(&comparison) {
        return;
    }
    for difference in &comparison.differences {
        let mut condition = found.condition(difference, &comparison.pairs);
        if !matches!(difference, Difference::Swapped { .. } | Difference::Wrong { .. }) {
            condition = condition.explaining(found.shifted(&comparison));
        }
        conditions.push(condition.confirmed(found.at));
        if let Difference::Swapped { one, other, twins } = difference {
            conditions.push(found.swapped(*other, *one, *twins).confirmed(found.at));
        }
    }
}

impl<'a> FoundWiring<'a> {
    fn condition(&self, difference: &Difference, pairs: &[Option<usize>]) -> Condition {
        match difference {
            Difference::Missing { planned, all } => self.missing(*planned, all.len()),
            Difference::Extra { found, all, on } => self.extra(*found, all.len(), *on, pairs),
            Difference::Wrong { planned, found, what } => self.wrong(*planned, *found, *what),
            Difference::Swapped { one, other, twins } => self.swapped(*one, *other, *twins),
            Difference::Reversed { planned, found, entry, wanted } => {
                self.reversed(*planned, *found, *entry, *wanted)
            }
            Difference::Moved { planned, found, wanted, on } => {
                self.moved(*planned, *found, *wanted, *on)
            }
        }
    }

    fn missing(&self, planned: usize, count: usize) -> Condition {
        let label = self.label(planned);
        let text = match count {
            1 => format!("{label} is not in the line; its neighbours are wired to each other"),
            _ => format!("{label}{} are not in the line", and_behind(count)),
        };
        let equals = if count == 1 {
            equals_in_a_row(self.model, self.planned, planned)
        } else {
            Vec::new()
        };
        let sure = 0.85 / (1 + equals.len()) as f64;
        let mut condition =
            self.begin(&MISSING, self.place(planned), FaultName::DeviceMissing, sure, text);
        for equal in &equals {
            condition = condition.or_at(FaultName::DeviceMissing, self.place(*equal), sure);
        }
        if !equals.is_empty() {
            let labels: Vec<String> = equals.iter().map(|equal| self.label(*equal)).collect();
            condition = condition.advise(format!(
                "{label} stands in a row with equal ones, {}: it may be any of them. A station alias in \
                 the project, or a serial number, tells them apart.",
                labels.join(", ")
            ));
        }
        condition
            .or(FaultName::DeviceWrong, 0.1)
            .advise(format!("Put {label} into its place, or take it out of the project."))
            .advise("Compare the line around it with the project, label by label.")
    }

    fn extra(
        &self,
        found: usize,
        count: usize,
        on: Option<End>,
        pairs: &[Option<usize>],
    ) -> Condition {
        let (what, at) = (self.kind(found), self.found_end(on));
        let more = and_behind(count);
        let text =
            format!("{what}{more} at {at} is in no plan; all behind are further on than planned");
        let id = self.ids.get(found).copied().unwrap_or_default();
        let place = Place::device(self.model.network, id);
        let equals = if count == 1 { self.equals_found(found, pairs) } else { Vec::new() };
        let sure = 0.85 / (1 + equals.len()) as f64;
        let mut condition = self.begin(&EXTRA, place, FaultName::DeviceExtra, sure, text);
        for equal in &equals {
            let place = Place::device(self.model.network, *equal);
            condition = condition.or_at(FaultName::DeviceExtra, place, sure);
        }
        if !equals.is_empty() {
            condition = condition.advise(format!(
                "{} more of its kind stand in a row with it: it may be any of them. A station alias in the \
                 project, or a serial number, tells them apart.",
                equals.len()
            ));
        }
        condition.or(FaultName::DeviceWrong, 0.1).advise(format!(
            "Take {what} at {at} out of the line, or scan anew and save the project."
        ))
    }

    /// Who stands in a row with a found one that nobody planned, and could as well be the one too many: of its
    /// kind, and the project knows no other name of him.
    fn equals_found(&self, found: usize, pairs: &[Option<usize>]) -> Vec<DeviceId> {
        let kind = |node: usize| {
            let identity = self.there.get(node)?.identity?;
            Some((identity.vendor_id, identity.product_code, identity.revision))
        };
        let alike = |node: usize| {
            let planned = pairs.iter().position(|pair| *pair == Some(node));
            let is_named =
                planned.and_then(|planned| self.wanted.get(planned)).is_some_and(|wanted| {
                    wanted.alias.is_some()
                        || wanted.identity.is_none_or(|identity| identity.serial_number != 0)
                });
            kind(node).is_some() && kind(node) == kind(found) && !is_named
        };
        let row = self.tree.in_a_row(found, alike);
        row.into_iter().filter_map(|node| self.ids.get(node).copied()).collect()
    }

    fn wrong(&self, planned: usize, found: usize, what: Unlike) -> Condition {
        let label = self.label(planned);
        let text = match what {
            Unlike::Identity(what) => {
                let there = self.there[found].identity.map(|there| identity::text(&there));
                let wanted = self.wanted[planned].identity.map(|wanted| identity::text(&wanted));
                format!(
                    "{label} has another {what} than planned: found {}; planned {}",
                    there.unwrap_or_default(),
                    wanted.unwrap_or_default()
                )
            }
            Unlike::Alias { planned, found } => {
                format!("{label} has alias {found}, planned was {planned}")
            }
        };
        let cause = match what {
            Unlike::Identity(_) => FaultName::DeviceWrong,
            Unlike::Alias { .. } => FaultName::TwinsSwapped,
        };
        self.begin(&WRONG, self.place(planned), cause, 0.85, text)
            .or(FaultName::DevicesSwapped, 0.05)
            .advise("Compare the device's label with the project, and change one of them.")
            .advise("Check whether cables are plugged in the planned order.")
    }

    fn swapped(&self, one: usize, other: usize, twins: bool) -> Condition {
        let (label, other_label) = (self.label(one), self.label(other));
        let text = format!("{label} and {other_label} sit in each other's place");
        let (page, cause) = if twins {
            (&TWINS, FaultName::TwinsSwapped)
        } else {
            (&WRONG, FaultName::DevicesSwapped)
        };
        self.begin(page, self.place(one), cause, 0.85, text)
            .or_at(cause, self.place(other), 0.05)
            .or(FaultName::DeviceWrong, 0.05)
            .advise(format!("Exchange {label} and {other_label}, with what is wired to them."))
    }

    fn reversed(&self, planned: usize, found: usize, entry: Port, wanted: Port) -> Condition {
        let label = self.label(planned);
        let first = matches!(self.planned.upstream(planned), Some(End::MainDevice(_)));
        let (cause, what) = if first {
            (FaultName::MainDeviceWrongPort, "the MainDevice is plugged into")
        } else {
            (FaultName::PortsSwapped, "the cable from the MainDevice's side is plugged into")
        };
        let other = if first { FaultName::PortsSwapped } else { FaultName::DevicesSwapped };
        let text =
            format!("{label}: {what} port {entry} instead of port {wanted}{}", self.times(found));
        self.begin(&PLUGGED, self.place(planned), cause, 0.9, text)
            .or(other, 0.05)
            .advise(format!("Exchange the cables at ports {wanted} and {entry} of {label}."))
    }

    fn moved(
        &self,
        planned: usize,
        found: usize,
        wanted: Option<End>,
        on: Option<End>,
    ) -> Condition {
        let label = self.label(planned);
        let count = self.planned.subtree(planned).len();
        let more = and_behind(count);
        let (at, right) = (self.found_end(on), self.planned_end(wanted));
        let text = format!("{label}{more} hang on {at}; planned was {right}");
        let mut condition = self
            .begin(&PLUGGED, self.place(planned), FaultName::PortsSwapped, 0.5, text)
            .or(FaultName::DevicesSwapped, 0.3)
            .advise(format!("Plug the cable to {label} into {right}; it is in {at} now."))
            .advise("If the wiring is as it is wanted, scan anew and save the project.");
        if let Some(id) = self.ids.get(found) {
            let dl = self.model.device(*id).and_then(|device| device.dl.first);
            condition.evidence.extend(dl.map(|seen| {
                let text = format!("open ports as found, at {at}: {}", ports(&self.tree, found));
                Evidence::register(*id, table::DL_STATUS.address, &seen, text)
            }));
        }
        condition
    }

    fn begin(
        &self,
        page: &'static RulePage,
        place: Place,
        cause: FaultName,
        confidence: f64,
        text: String,
    ) -> Condition {
        let seen = Seen::new((), self.at, self.frame);
        let device = match place {
            Place::Device { device, .. } => device,
            Place::Link { .. } | Place::Network { .. } | Place::Host => DeviceId::default(),
        };
        let shown = Evidence::register(device, table::SII_DATA.address, &seen, text);
        Condition::new(page, place, cause, self.at).confidence(confidence).shown_by(shown)
    }

    /// Who answers from another place than planned: ports that should lead on end the line there, and the
    /// last planned ones never answer.
    fn shifted(&self, comparison: &Comparison) -> Vec<Symptom> {
        let is_same =
            |(node, id): (usize, &DeviceId)| comparison.pairs.get(id.index()) == Some(&Some(node));
        let first = self.ids.iter().enumerate().position(|pair| !is_same(pair));
        let first = first.unwrap_or(self.ids.len()).saturating_sub(1);
        let order = self.planned.order();
        let behind = order.iter().skip(first).map(|node| DeviceId(*node as u32));
        let swapped = comparison.differences.iter().flat_map(|difference| match difference {
            Difference::Reversed { planned, .. } => Some(DeviceId(*planned as u32)),
            Difference::Moved { planned, .. } => {
                self.planned.parent(*planned).map(|node| DeviceId(node as u32))
            }
            Difference::Missing { .. }
            | Difference::Extra { .. }
            | Difference::Wrong { .. }
            | Difference::Swapped { .. } => None,
        });
        let concerned = displaced(behind.chain(swapped));
        let ends = comparison.differences.iter().flat_map(|difference| match difference {
            Difference::Reversed { planned, .. } => self.ends_around(*planned),
            Difference::Moved { .. }
            | Difference::Missing { .. }
            | Difference::Extra { .. }
            | Difference::Wrong { .. }
            | Difference::Swapped { .. } => Vec::new(),
        });
        concerned.chain(ends).collect()
    }

    /// The far ends of the cables of a device that sits in the line the other way round: one of its own
    /// ports has no link where one belongs, and the plan sees that as both ends of a cable.
    fn ends_around(&self, planned: usize) -> Vec<Symptom> {
        let far = |port| self.planned.opposite(End::Controller(planned, port));
        let ends = Port::ALL.into_iter().filter_map(far);
        ends.flat_map(|end| match end {
            End::Controller(node, port) => {
                let id = DeviceId(node as u32);
                vec![Symptom::LinkDown(id, port), Symptom::LinkCounted(id, port)]
            }
            End::MainDevice(_) => Vec::new(),
        })
        .collect()
    }

    fn place(&self, planned: usize) -> Place {
        Place::device(self.model.network, DeviceId(planned as u32))
    }

    fn label(&self, planned: usize) -> String {
        self.model.label(DeviceId(planned as u32))
    }

    /// What a found node is, as no name in the plan says.
    fn kind(&self, found: usize) -> String {
        let id = self.ids.get(found).copied().unwrap_or_default();
        let sii = self.model.device(id).and_then(|device| device.sii.type_name());
        sii.unwrap_or_else(|| format!("the SubDevice at position {found}"))
    }

    fn planned_end(&self, end: Option<End>) -> String {
        match end {
            Some(End::Controller(node, port)) => format!("port {port} of {}", self.label(node)),
            Some(End::MainDevice(path)) => format!("card {path} of the MainDevice"),
            None => "nothing".to_owned(),
        }
    }

    /// An end of the found tree, named by the plan where the position fits.
    fn found_end(&self, end: Option<End>) -> String {
        let named = end.map(|end| end.map(|node| self.ids.get(node).map_or(node, |id| id.index())));
        self.planned_end(named)
    }

    /// What the receive times say of a node.
    fn times(&self, found: usize) -> String {
        let device = self.ids.get(found).and_then(|id| self.model.device(*id));
        match (self.basis.get(found), device.and_then(|device| device.received)) {
            (Some(EntryBasis::ReceiveTimes), Some(times)) => {
                let entry = self.tree.entry(found);
                let open = self.tree.open_ports(found).filter(|port| *port != entry);
                let later = |port: Port| Some((port, times[port]?.delta(times[entry]?)));
                let later: Vec<String> = open
                    .filter_map(later)
                    .map(|(port, ns)| format!("{port} {ns} ns later"))
                    .collect();
                format!("; receive times: {entry} first, {}", later.join(", "))
            }
            _ => String::new(),
        }
    }
}

/// The planned ones in a row with one of them that nobody could tell from it.
pub(super) fn equals_in_a_row(model: &NetworkModel, tree: &Tree, planned: usize) -> Vec<usize> {
    let alike = |other: usize| {
        let [one, other] = [planned, other].map(|node| wanted(model.devices.get(node)));
        let has_serial = one.identity.is_some_and(|identity| identity.serial_number != 0);
        one.identity.is_some() && one == other && one.alias.is_none() && !has_serial
    };
    tree.in_a_row(planned, alike)
}

fn and_behind(count: usize) -> String {
    if count == 1 { String::new() } else { format!(" and {} behind it", count - 1) }
}

fn ports(tree: &Tree, node: usize) -> String {
    tree.open_ports(node).map(|port| port.to_string()).collect::<Vec<_>>().join(" ")
}
