//! A scan held against what was planned: the state words of an online list, and what differs, one cable
//! or one device at a time.

use linesman_config::compare::{Comparison, Difference, Side, Unlike, Wanted, compare};
use linesman_config::identity;
use linesman_config::inventory::{FoundDevice, Inventory, label};
use linesman_config::project::{Project, ProjectDevice};
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::state::DeviceState;
use linesman_proto::topology::{End, Tree};
use serde::Serialize;

use crate::output::{Output, Table, wrapped};

/// What came of the comparison.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Against {
    /// Whether all is as planned.
    as_planned: bool,
    /// The planned SubDevices, each with what is at its position.
    devices: Vec<Row>,
    /// What differs.
    differences: Vec<DifferenceReport>,
}

/// A planned SubDevice beside what is at its position.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Row {
    /// Its number in the project, from 1.
    no: u32,
    /// Its name.
    name: String,
    /// The type that is found there; `null` for nothing.
    found: Option<String>,
    /// Its state, as an online list writes it: `OP LNK_MIS C`, `INIT VPRS`, `INIT NO_COMM`.
    state: String,
}

/// One thing that is otherwise than planned.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct DifferenceReport {
    /// `missing`, `extra`, `wrong`, `swapped`, `reversed` or `moved`.
    kind: String,
    /// The planned SubDevice, by number; `null` for one that was not planned.
    planned: Option<u32>,
    /// The one found, by its number in this scan; `null` for none.
    found: Option<u32>,
    /// In words.
    text: String,
    /// What to do.
    action: String,
}

/// Holds a scan against a project.
pub(super) fn against(project: &Project, planned: &Tree, inventory: &Inventory) -> Against {
    let wanted: Vec<Wanted> = project.devices.iter().map(ProjectDevice::wanted).collect();
    let there = inventory.there();
    let comparison = compare(
        Side { tree: planned, nodes: &wanted },
        Side { tree: inventory.tree(), nodes: &there },
    );
    let may_go = project.optional_devices();
    let comparison = comparison.without_groups(|node| may_go.contains_key(&node));
    let names = Names { project, inventory };
    Against {
        as_planned: comparison.differences.is_empty(),
        devices: rows(project, planned, &wanted, inventory),
        differences: comparison
            .differences
            .iter()
            .map(|one| names.report(one, &comparison))
            .collect(),
    }
}

/// Position by position, as an online list that goes by the project sees the line.
fn rows(project: &Project, planned: &Tree, wanted: &[Wanted], inventory: &Inventory) -> Vec<Row> {
    let there = inventory.there();
    let row = |(node, device): (usize, &ProjectDevice)| {
        let position = planned.position(node).filter(|at| *at < inventory.devices.len());
        let found = position.map(|at| &inventory.devices[at]);
        let is_wrong = position.is_some_and(|at| {
            linesman_config::compare::unlike(&wanted[node], &there[at]).is_some()
        });
        Row {
            no: DeviceId(node as u32).no(),
            name: device.name.clone(),
            found: found.map(|found| found.profile.type_name.clone()),
            state: state(planned, node, found, is_wrong).to_string(),
        }
    };
    project.devices.iter().enumerate().map(row).collect()
}

fn state(planned: &Tree, node: usize, found: Option<&FoundDevice>, is_wrong: bool) -> DeviceState {
    use linesman_proto::state::{AlState, StateValue};
    let Some(found) = found else {
        return DeviceState::new(StateValue::Known(AlState::Init)).with(DeviceState::NOT_PRESENT);
    };
    let mut word = DeviceState::new(found.al_status.state());
    if found.al_status.error() {
        word = word.with(DeviceState::ERROR);
    }
    if is_wrong {
        word = word.with(DeviceState::WRONG_IDENTITY);
    }
    for port in Port::ALL {
        let (want, have) = (planned.is_open(node, port), found.dl_status.port_state(port));
        let bit = match (want, have.link, have.communication) {
            (true, false, _) => DeviceState::MISSING_LINK,
            (true, true, false) => DeviceState::LINK_ERROR,
            (false, true, _) => DeviceState::ADDITIONAL_LINK,
            (true, true, true) | (false, false, _) => continue,
        };
        word = word.with(bit).at_port(port);
    }
    word
}

/// What people call things.
struct Names<'a> {
    project: &'a Project,
    inventory: &'a Inventory,
}

impl Names<'_> {
    fn planned(&self, node: usize) -> String {
        let id = DeviceId(node as u32);
        let device = self.project.devices.get(node);
        device.map_or_else(|| label(id, "", ""), |one| label(id, &one.name, &one.type_name))
    }

    fn found(&self, node: usize) -> String {
        self.inventory.devices.get(node).map_or_else(String::new, FoundDevice::label)
    }

    fn end(&self, end: Option<End>, name: impl Fn(usize) -> String) -> String {
        match end {
            Some(End::Controller(node, port)) => format!("port {port} of {}", name(node)),
            Some(End::MainDevice(path)) => format!("card {path} of the MainDevice"),
            None => "nothing".to_owned(),
        }
    }

    /// An end of what was found, by the name of the plan where there is one.
    fn found_end(&self, end: Option<End>, comparison: &Comparison) -> String {
        self.end(end, |node| {
            let planned = comparison.pairs.iter().position(|pair| *pair == Some(node));
            planned.map_or_else(
                || format!("{} of this scan", self.found(node)),
                |node| self.planned(node),
            )
        })
    }

    fn report(&self, difference: &Difference, comparison: &Comparison) -> DifferenceReport {
        let no = |node: usize| Some(DeviceId(node as u32).no());
        let more = |count: usize| match count {
            1 => String::new(),
            count => format!(" and {} behind it", count - 1),
        };
        let (kind, planned, found, text, action) = match difference {
            Difference::Missing { planned, all } => {
                let (name, more) = (self.planned(*planned), more(all.len()));
                let text = format!("{name}{more}: not in the line");
                let action = format!(
                    "is {name} powered, and its cable plugged in? Else take it out of the project"
                );
                ("missing", no(*planned), None, text, action)
            }
            Difference::Extra { found, all, on } => {
                let (name, more) = (self.found(*found), more(all.len()));
                let at = self.found_end(*on, comparison);
                let text = format!("{name} of this scan{more}, at {at}: in no plan");
                let action =
                    format!("take it out, or plan it: `linesman scan WHERE --save FILE` ({name})");
                ("extra", None, no(*found), text, action)
            }
            Difference::Wrong { planned, found, what } => {
                let name = self.planned(*planned);
                let text = match what {
                    Unlike::Identity(what) => {
                        let wanted = self.project.devices[*planned].identity();
                        let there = self.inventory.devices[*found].identity;
                        let words = |one: Option<identity::Identity>| {
                            one.map_or_else(|| "nothing".to_owned(), |one| identity::text(&one))
                        };
                        format!(
                            "{name}: another {what}: found {}; planned {}",
                            words(there),
                            words(wanted)
                        )
                    }
                    Unlike::Alias { planned, found } => {
                        format!("{name}: alias {found}, planned was {planned}")
                    }
                };
                let action = "compare the label of the device with the project".to_owned();
                ("wrong", no(*planned), no(*found), text, action)
            }
            Difference::Swapped { one, other, twins } => {
                let (one_name, other_name) = (self.planned(*one), self.planned(*other));
                let told = if *twins { ", of the same kind" } else { "" };
                let text = format!("{one_name} and {other_name}{told}: in each other's place");
                let action = format!("exchange {one_name} and {other_name}");
                ("swapped", no(*one), comparison.pairs[*one].and_then(no), text, action)
            }
            Difference::Reversed { planned, found, entry, wanted } => {
                let name = self.planned(*planned);
                let text =
                    format!("{name}: frames come in at port {entry} instead of port {wanted}");
                let action = format!("exchange the cables at ports {wanted} and {entry} of {name}");
                ("reversed", no(*planned), no(*found), text, action)
            }
            Difference::Moved { planned, found, wanted, on } => {
                let name = self.planned(*planned);
                let right = self.end(*wanted, |node| self.planned(node));
                let at = self.found_end(*on, comparison);
                let text = format!("{name}: at {at}; planned was {right}");
                let action = format!("plug its cable into {right}; it is in {at} now");
                ("moved", no(*planned), no(*found), text, action)
            }
        };
        DifferenceReport { kind: kind.to_owned(), planned, found, text, action }
    }
}

impl Against {
    /// Whether all is as planned.
    pub(super) const fn is_as_planned(&self) -> bool {
        self.as_planned
    }

    /// For people: only what is not as planned, and what to look at.
    pub(super) fn text(&self, output: &Output) -> String {
        let (paint, width) = (output.paint(), output.width());
        if self.as_planned {
            return format!("\n{}\n", paint.good("All is as planned."));
        }
        let mut table = Table::new(&["no", "planned", "found at its position", "state"], paint);
        for row in &self.devices {
            table.row([
                row.no.to_string(),
                row.name.clone(),
                row.found.clone().unwrap_or_else(|| "-".to_owned()),
                row.state.clone(),
            ]);
        }
        let mut text = format!("\n{}\n", table.render());
        for difference in &self.differences {
            let kind = paint.bad(&difference.kind);
            text.push_str(&wrapped("  x ", &format!("{kind}: {}", difference.text), width));
            text.push_str(&wrapped("    do: ", &output.hint(&difference.action), width));
        }
        text.push_str(&wrapped("  ", HINT, width));
        text
    }
}

/// S0 L1623: what such a table mostly comes from.
const HINT: &str = "Mostly a device is missing, or cables are plugged in the wrong order. One of them \
                    moves all behind it to another position.";
