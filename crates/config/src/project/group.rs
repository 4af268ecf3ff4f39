//! Hot connect groups of a project: `[[group]]`, and the numbers that tell equal devices apart:
//! `identification`.

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::register::AL_STATUS_CODE;
use linesman_proto::sii::Identification;
use linesman_proto::topology::{End, Tree};
use serde::{Deserialize, Serialize};

use super::{Project, ProjectDevice, ProjectError};
use crate::attachment::Attachment;
use crate::plan::{AddressingChoice, HotConnectGroup, IdentificationCheck, IdentificationSource};

/// Devices that are plugged in and out together while the network runs: `[[group]]`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProjectGroup {
    /// Unique name.
    pub name: String,
    /// The device by which the group is plugged in, and by whose number it is known.
    pub first: String,
    /// The devices behind it, by name; all that hang behind it in the project unless said.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<String>,
    /// The number of its first device; that of the device itself unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identification: Option<IdentificationChoice>,
    /// It may be absent; else its absence is an error.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub optional: bool,
    /// Ports at which it may be plugged in, such as `K1.C`; any free port unless said.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<Attachment>,
}

/// The number by which a device is told apart from its equals: `identification = { … }`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, expecting = "a table such as { by = \"selector\", value = 5 }")]
pub struct IdentificationChoice {
    /// Where the number comes from.
    pub by: IdentificationWay,
    /// The number; of `alias` and `serial` that of the device unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub value: Option<u32>,
    /// Where a selector is read: 0x0134 through AL control, else a word of memory; as in its description
    /// unless said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub register: Option<u16>,
    /// A device with another number is not driven; else the difference is told only.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub compulsory: bool,
}

/// A source of identification numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IdentificationWay {
    /// A switch or a display at the device, read as its description says.
    Selector,
    /// The station alias in its EEPROM.
    Alias,
    /// The serial number in its EEPROM.
    Serial,
}

fn yes() -> bool {
    true
}

fn is_yes(value: &bool) -> bool {
    *value
}

impl IdentificationChoice {
    /// The number, its own or that of the device; `None` where there is none.
    #[must_use]
    pub fn number(&self, device: &ProjectDevice) -> Option<u32> {
        let of_device = match self.by {
            IdentificationWay::Selector => None,
            IdentificationWay::Alias => device.alias.map(u32::from),
            IdentificationWay::Serial => device.serial,
        };
        self.value.or(of_device)
    }

    /// Checks what can be checked without a description.
    fn check(&self, device: &ProjectDevice) -> Result<(), String> {
        let Some(number) = self.number(device) else {
            let key = match self.by {
                IdentificationWay::Selector => "",
                IdentificationWay::Alias => ", or `alias` of the device",
                IdentificationWay::Serial => ", or `serial` of the device",
            };
            return Err(format!("identification: there is no number: expected `value`{key}"));
        };
        let most = match self.by {
            IdentificationWay::Selector | IdentificationWay::Alias => u32::from(u16::MAX),
            IdentificationWay::Serial => u32::MAX,
        };
        if number == 0 || number > most {
            return Err(format!("identification: value {number}, expected 1 to {most}"));
        }
        let of_device = match self.by {
            IdentificationWay::Selector => None,
            IdentificationWay::Alias => device.alias.map(u32::from),
            IdentificationWay::Serial => device.serial,
        };
        if let Some(other) = of_device.filter(|other| *other != number) {
            return Err(format!(
                "identification: value {number}, but `{}` of the device is {other}: expected the same number",
                if self.by == IdentificationWay::Alias { "alias" } else { "serial" }
            ));
        }
        if self.register.is_some() && self.by != IdentificationWay::Selector {
            return Err(
                "identification: `register` is that of a selector: expected by = \"selector\""
                    .to_owned(),
            );
        }
        if !self.compulsory && self.by == IdentificationWay::Serial {
            return Err("identification: a serial number is always compared: expected no `compulsory = false`"
                .to_owned());
        }
        Ok(())
    }

    /// The check of a device whose description says this of its selector.
    ///
    /// # Errors
    /// A selector that the description does not have, in words with the next step.
    pub(super) fn planned(
        &self,
        device: &ProjectDevice,
        described: Identification,
    ) -> Result<IdentificationCheck, String> {
        let source = match (self.by, self.register, described) {
            (IdentificationWay::Alias, ..) => IdentificationSource::Alias,
            (IdentificationWay::Serial, ..) => IdentificationSource::Serial,
            (_, Some(register), _) if register == AL_STATUS_CODE.address.0 => {
                IdentificationSource::AlStatus
            }
            (_, Some(register), _) => IdentificationSource::Memory(RegisterAddress(register)),
            (_, None, Identification::AlStatus) => IdentificationSource::AlStatus,
            (_, None, Identification::Memory(at)) => IdentificationSource::Memory(at),
            (_, None, Identification::None) => {
                return Err("identification: its description names no selector: expected by = \"alias\" (written \
                            with `linesman sii WHERE DEVICE alias N`) or `register`"
                    .to_owned());
            }
        };
        let value = self.number(device).unwrap_or(0);
        Ok(IdentificationCheck { source, value, compulsory: self.compulsory })
    }
}

impl Project {
    /// The number by which a device is told apart: that of the group that it begins, else its own.
    #[must_use]
    pub fn identification_of<'a>(
        &'a self,
        device: &'a ProjectDevice,
    ) -> Option<&'a IdentificationChoice> {
        let group = self.groups.iter().find(|group| group.first == device.name);
        let of_group = group.and_then(|group| group.identification.as_ref());
        of_group.or(device.identification.as_ref())
    }

    /// The group that a device belongs to, as far as the wiring is sound.
    #[must_use]
    pub fn group_of(&self, device: &str) -> Option<&ProjectGroup> {
        let tree = self.tree().ok()?;
        let node = self.node(device)?;
        self.groups.iter().find(|group| self.members(&tree, group).contains(&node))
    }

    /// Devices of groups that may be absent, each with the first device of its group, by their places in the
    /// project.
    #[must_use]
    pub fn optional_devices(&self) -> BTreeMap<usize, usize> {
        let Ok(tree) = self.tree() else { return BTreeMap::new() };
        let groups = self.groups.iter().filter(|group| group.optional);
        let members = groups.flat_map(|group| {
            let members = self.members(&tree, group);
            let first = members.first().copied().unwrap_or_default();
            members.into_iter().map(move |member| (member, first))
        });
        members.collect()
    }

    fn node(&self, name: &str) -> Option<usize> {
        self.devices.iter().position(|device| device.name == name)
    }

    /// The devices of a group in processing order: its first one and all behind it.
    pub(super) fn members(&self, tree: &Tree, group: &ProjectGroup) -> Vec<usize> {
        let Some(first) = self.node(&group.first) else { return Vec::new() };
        let is_inside = |node: &&usize| **node == first || tree.is_downstream_of(**node, first);
        tree.order().iter().filter(is_inside).copied().collect()
    }

    /// The groups for the planner; `places` is the place of each device in processing order.
    pub(super) fn planned_groups(&self, tree: &Tree, places: &[usize]) -> Vec<HotConnectGroup> {
        let id = |node: usize| places.get(node).map(|place| DeviceId(*place as u32));
        let end = |on: &Attachment| match on {
            Attachment::MainDevice(path) => Some(End::MainDevice(*path)),
            Attachment::Device { name, port } => {
                Some(End::Controller(id(self.node(name)?)?.index(), *port))
            }
        };
        let groups = self.groups.iter().map(|group| HotConnectGroup {
            name: group.name.clone(),
            members: self.members(tree, group).into_iter().filter_map(id).collect(),
            optional: group.optional,
            places: group.places.iter().filter_map(end).collect(),
        });
        groups.collect()
    }

    /// Checks groups and numbers; `text` is the file, for the lines of its tables.
    pub(super) fn check_groups(&self, text: &str) -> Result<(), ProjectError> {
        let tree = self.tree()?;
        for (at, group) in self.groups.iter().enumerate() {
            let wrong = |reason: String| {
                let line = line_of(text, "[[group]]", at);
                let whose = format!("group `{}`{line}", group.name);
                ProjectError::Value { whose, reason }
            };
            if self.groups[..at].iter().any(|other| other.name == group.name) {
                let reason = "another group has this name: give each a name of its own".to_owned();
                return Err(wrong(reason));
            }
            self.check_members(&tree, at).map_err(wrong)?;
            for place in &group.places {
                self.check_place(&tree, at, place).map_err(wrong)?;
            }
        }
        self.check_numbers(text)
    }

    /// Whether the devices of a group hang together, and are in no other group.
    fn check_members(&self, tree: &Tree, at: usize) -> Result<(), String> {
        let group = &self.groups[at];
        let Some(first) = self.node(&group.first) else {
            return Err(format!(
                "first = `{}`, but no [[device]] is called so: expected the device by which it is plugged in",
                group.first
            ));
        };
        let members = self.members(tree, group);
        let name = |node: usize| self.devices[node].name.as_str();
        for other in &self.groups[..at] {
            let theirs = self.members(tree, other);
            if let Some(node) = members.iter().find(|node| theirs.contains(node)) {
                return Err(format!(
                    "`{}` is in group `{}` already: expected groups that do not hang on each other in the \
                     project",
                    name(*node),
                    other.name
                ));
            }
        }
        if !group.members.is_empty() {
            let is_listed = |node: usize| {
                node == first || group.members.iter().any(|member| member == name(node))
            };
            if let Some(left_out) = members.iter().find(|node| !is_listed(**node)) {
                return Err(format!(
                    "`{}` hangs behind `{}` and would go with it: add it to `members`, or leave `members` out",
                    name(*left_out),
                    group.first
                ));
            }
            let is_behind = |member: &&String| members.iter().any(|node| name(*node) == **member);
            if let Some(alien) = group.members.iter().find(|member| !is_behind(member)) {
                return Err(format!(
                    "member `{alien}` does not hang behind `{}`: expected devices of that branch",
                    group.first
                ));
            }
        }
        let is_found_otherwise =
            |node: &&usize| self.devices[**node].addressing != AddressingChoice::Auto;
        if let Some(node) = members.iter().find(is_found_otherwise) {
            return Err(format!(
                "`{}` has an `addressing` of its own: a group is found by the number of its first device; expected none",
                name(*node)
            ));
        }
        let device = &self.devices[first];
        let Some(choice) = self.identification_of(device) else {
            return Err(format!(
                "nothing tells it from others: expected `identification = {{ by = \"selector\", value = N }}`, or by \
                 \"alias\" (written with `linesman sii WHERE DEVICE alias N`) or \"serial\", here or at `{}`",
                group.first
            ));
        };
        if let (Some(here), Some(own)) = (&group.identification, &device.identification)
            && here != own
        {
            return Err(format!(
                "its identification differs from that of device `{}`: expected it in one of the two places",
                group.first
            ));
        }
        if !choice.compulsory {
            return Err(
                "identification: a group is known by its number: expected no `compulsory = false`"
                    .to_owned(),
            );
        }
        Ok(())
    }

    /// Whether a group can be plugged in at a place.
    fn check_place(&self, tree: &Tree, at: usize, place: &Attachment) -> Result<(), String> {
        let Attachment::Device { name, port } = place else {
            return Err(format!(
                "places: `{place}` is the port of the MainDevice: the first SubDevice is never in a group"
            ));
        };
        let Some(node) = self.node(name) else {
            return Err(format!("places: `{place}`: no device is called `{name}`"));
        };
        if self.members(tree, &self.groups[at]).contains(&node) {
            return Err(format!("places: `{place}` is a port of the group itself"));
        }
        let taken_by = match tree.opposite(End::Controller(node, *port)) {
            Some(End::Controller(other, _)) => Some(other),
            Some(End::MainDevice(_)) => {
                return Err(format!(
                    "places: `{place}` leads to the MainDevice: expected a free port"
                ));
            }
            None => None,
        };
        let is_of_group =
            |other: usize| self.groups.iter().any(|group| self.node(&group.first) == Some(other));
        match taken_by.filter(|other| !is_of_group(*other)) {
            Some(other) => Err(format!(
                "places: `{}` hangs at `{place}`: expected a free port, or that of a group",
                self.devices[other].name
            )),
            None => Ok(()),
        }
    }

    /// Whether the numbers make sense, and are not given twice to devices that may be equal.
    fn check_numbers(&self, text: &str) -> Result<(), ProjectError> {
        let chosen: Vec<(usize, &IdentificationChoice, u32)> = (self.devices.iter().enumerate())
            .filter_map(|(node, device)| {
                let choice = self.identification_of(device)?;
                Some((node, choice, choice.number(device).unwrap_or(0)))
            })
            .collect();
        for (at, (node, choice, number)) in chosen.iter().enumerate() {
            let device = &self.devices[*node];
            let wrong = |reason: String| {
                let line = line_of(text, "[[device]]", *node);
                let whose = format!("device `{}`{line}", device.name);
                ProjectError::Value { whose, reason }
            };
            choice.check(device).map_err(wrong)?;
            let is_same = |(other, their, value): &&(usize, &IdentificationChoice, u32)| {
                their.by == choice.by
                    && value == number
                    && may_be_equal(device, &self.devices[*other])
            };
            if let Some((other, ..)) = chosen[..at].iter().find(is_same) {
                return Err(wrong(format!(
                    "identification: number {number} is that of `{}` already: give each of equal devices a number \
                     of its own",
                    self.devices[*other].name
                )));
            }
        }
        Ok(())
    }
}

/// Whether nothing in the project says that two devices are of different types.
fn may_be_equal(one: &ProjectDevice, other: &ProjectDevice) -> bool {
    let may = |one: Option<u32>, other: Option<u32>| {
        one.zip(other).is_none_or(|(one, other)| one == other)
    };
    may(one.vendor_id, other.vendor_id)
        && may(one.product_code, other.product_code)
        && (one.type_name.is_empty()
            || other.type_name.is_empty()
            || one.type_name == other.type_name)
}

/// ` (line 12)` for the table with this header, counted from 0; nothing where there is none.
fn line_of(text: &str, header: &str, at: usize) -> String {
    let lines = text.lines().zip(1_usize..);
    let mut found = lines.filter(|(line, _)| line.trim_start().starts_with(header));
    found.nth(at).map_or_else(String::new, |(_, number)| format!(" (line {number})"))
}

#[cfg(test)]
mod tests;
