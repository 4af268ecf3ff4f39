//! `linesman id --against`: numbers of a project beside those that SubDevices tell.

use linesman_config::project::{IdentificationChoice, IdentificationWay, Project, ProjectDevice};
use linesman_proto::address::DeviceId;

use super::ToldNumbers;
use crate::exit::Status;
use crate::failure::Failure;
use crate::text::quantity::count;

/// Numbers of a project beside those that are told.
#[derive(Default)]
pub(super) struct ComparedNumbers {
    /// Numbers that are as planned.
    right: usize,
    pub(super) wrong: Vec<Failure>,
    /// Groups that nobody tells the number of.
    absent: Vec<String>,
    /// Numbers that were not read.
    unread: Vec<String>,
}

impl ComparedNumbers {
    /// Nothing compared shows nothing to be right.
    pub(super) fn status(&self) -> Status {
        if !self.wrong.is_empty() {
            Status::Findings
        } else if !self.unread.is_empty() || self.right + self.absent.len() == 0 {
            Status::Inconclusive
        } else {
            Status::Good
        }
    }

    /// Numbers that were not compared, each with the reason.
    pub(super) fn not_compared(&self) -> impl Iterator<Item = &String> {
        self.absent.iter().chain(&self.unread)
    }

    /// Result, in a line.
    pub(super) fn result(&self) -> String {
        let numbers = count(self.right as u64, "number");
        match (self.wrong.len(), self.right, self.absent.len() + self.unread.len()) {
            (0, 0, 0) => "Nothing was compared: the project names no numbers.".to_owned(),
            (0, _, 0) => "All numbers are as planned.".to_owned(),
            (0, _, others) => format!("As planned: {numbers}; not compared: {others}."),
            (wrong, ..) => format!("Not as planned: {}.", count(wrong as u64, "number")),
        }
    }
}

/// Compares the numbers of a project with those that are told; selectors are not read where another process drives the
/// line (`is_driven`).
pub(super) fn compare(
    project: &Project,
    told: &[ToldNumbers],
    one: Option<DeviceId>,
    is_driven: bool,
) -> ComparedNumbers {
    let mut all = ComparedNumbers::default();
    let Ok(tree) = project.tree() else { return all };
    let planned = |device: &ProjectDevice| {
        let choice = project.identification_of(device)?;
        Some((choice.by, choice.number(device)?))
    };
    let numbers: Vec<_> = project.devices.iter().filter_map(planned).collect();
    for (node, device) in project.devices.iter().enumerate() {
        let Some(choice) = project.identification_of(device) else { continue };
        let Some(wanted) = choice.number(device) else { continue };
        let place = tree.position(node).map(|place| DeviceId(place as u32));
        if one.is_some_and(|one| place != Some(one)) {
            continue;
        }
        let (name, way) = (&device.name, way_in_words(choice.by));
        if is_driven && choice.by == IdentificationWay::Selector {
            all.unread.push(format!("{name}: its {way}, planned {wanted}, was not read"));
            continue;
        }
        let tellers: Vec<&ToldNumbers> =
            told.iter().filter(|told| told.by(choice.by) == wanted).collect();
        let group = project.group_of(name).filter(|group| group.optional && tellers.is_empty());
        if let Some(group) = group {
            // One of its kind with a number that nobody is planned to have is it, or takes its place.
            let is_stranger = |told: &&ToldNumbers| {
                told.product.is_some()
                    && told.product == device.vendor_id.zip(device.product_code)
                    && !numbers.contains(&(choice.by, told.by(choice.by)))
            };
            match told.iter().find(is_stranger) {
                Some(stranger) => all.wrong.push(Failure::new(
                    format!(
                        "{name}: its {way} must be {wanted}, which nobody tells; {}",
                        stranger.tells(choice.by)
                    ),
                    way_to_set(choice.by, wanted),
                )),
                None => {
                    let group = &group.name;
                    all.absent.push(format!(
                        "{name}: nobody tells its {way} {wanted}: group {group} is not there"
                    ));
                }
            }
            continue;
        }
        let here = told.iter().find(|told| Some(told.id) == place);
        match difference(project, device, choice, wanted, here, &tellers) {
            Some(failure) => all.wrong.push(failure),
            None => all.right += 1,
        }
    }
    all
}

const fn way_in_words(way: IdentificationWay) -> &'static str {
    match way {
        IdentificationWay::Selector => "selector",
        IdentificationWay::Alias => "alias",
        IdentificationWay::Serial => "serial number",
    }
}

/// The next step where a number must be `wanted` and is not.
fn way_to_set(way: IdentificationWay, wanted: u32) -> String {
    match way {
        IdentificationWay::Selector => {
            "set it at its switches or display, then off and on".to_owned()
        }
        IdentificationWay::Alias => {
            format!("`linesman id WHERE DEVICE --set {wanted}`, then off and on")
        }
        IdentificationWay::Serial => {
            "write the serial number of the new one into the project".to_owned()
        }
    }
}

/// Difference of the number of one planned SubDevice, if there is one.
fn difference(
    project: &Project,
    device: &ProjectDevice,
    choice: &IdentificationChoice,
    wanted: u32,
    here: Option<&ToldNumbers>,
    tellers: &[&ToldNumbers],
) -> Option<Failure> {
    let name = &device.name;
    let way = way_in_words(choice.by);
    if tellers.len() > 1 {
        let names: Vec<&str> = tellers.iter().map(|one| one.label.as_str()).collect();
        return Some(Failure::new(
            format!("{name}: its {way} {wanted} is told by {}", names.join(" and ")),
            "give each a number of its own",
        ));
    }
    // A group may be anywhere, and absent.
    let group = project.group_of(name);
    match (tellers, group) {
        ([teller], None) if here.is_some_and(|here| here.id != teller.id) => Some(Failure::new(
            format!("{name}: its {way} {wanted} is told by {}, at another place", teller.label),
            "plug each in at its own place, or exchange their numbers",
        )),
        ([], _) => {
            let found =
                here.map_or("nobody is at its place".to_owned(), |here| here.tells(choice.by));
            let advice = way_to_set(choice.by, wanted);
            Some(Failure::new(format!("{name}: its {way} must be {wanted}, but {found}"), advice))
        }
        _ => None,
    }
}
