//! A value that was written becomes a start-up command of a project (SW-13): the file is added to, not written
//! anew, so that comments and order stay.

use std::path::Path;

use linesman_config::project::{Project, StartUpEntry};
use linesman_proto::address::StationAddress;
use linesman_proto::mailbox::coe::ObjectAddress;

use crate::failure::Failure;
use crate::files;

/// What is added.
pub(super) struct Command<'a> {
    pub(super) transition: &'a str,
    pub(super) object: ObjectAddress,
    pub(super) complete: bool,
    pub(super) data: &'a [u8],
    pub(super) comment: &'a str,
}

/// Adds a command to a device of a project: to that of this name, else to that with this station address.
/// Gives its name.
pub(super) fn add(
    path: &Path,
    name: Option<&str>,
    station: u16,
    command: &Command<'_>,
) -> Result<String, Failure> {
    let text = files::text(path, "a project")?;
    let mut project = Project::parse(&text).map_err(|error| files::in_file(path, &error))?;
    let stations = project.stations();
    let is_meant = |node: &usize| match name {
        Some(name) => project.devices[*node].name == name,
        None => stations[*node] == StationAddress(station),
    };
    let node = (0..project.devices.len()).find(is_meant);
    let Some(node) = node else {
        let who = match name {
            Some(name) => format!("device is called `{name}`"),
            None => format!("device has station address 0x{station:04X}"),
        };
        let has: Vec<&str> = project.devices.iter().map(|device| device.name.as_str()).collect();
        return Err(Failure::new(
            format!("{}: no {who}; there is {}", path.display(), has.join(", ")),
            "say whose start-up command it is with --as NAME",
        ));
    };
    let entry = StartUpEntry {
        transition: command.transition.to_owned(),
        index: Some(command.object.index.0),
        subindex: command.object.subindex,
        complete_access: command.complete,
        register: None,
        idn: None,
        drive: 0,
        eoe: None,
        net_id: None,
        data: command.data.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" "),
        comment: command.comment.to_owned(),
    };
    let added = insert(&text, node, &lines(&entry));
    let device = &mut project.devices[node];
    device.start_up.push(entry);
    let name = device.name.clone();
    // What was added is what was meant, and nothing else has changed.
    if Project::parse(&added).as_ref() != Ok(&project) {
        let reason =
            format!("{}: the command cannot be added behind device `{name}`", path.display());
        return Err(Failure::new(reason, "write [[device.start_up]] there by hand"));
    }
    files::replace(path, "the project", &added)?;
    Ok(name)
}

fn lines(entry: &StartUpEntry) -> String {
    let StartUpEntry { transition, index, subindex, complete_access, data, comment, .. } = entry;
    let mut text = format!(
        "\n[[device.start_up]]\ntransition = \"{transition}\"\nindex = 0x{:04X}\nsubindex = {subindex}\n",
        index.unwrap_or(0)
    );
    if *complete_access {
        text.push_str("complete_access = true\n");
    }
    text.push_str(&format!("data = \"{data}\"\n"));
    if !comment.is_empty() {
        text.push_str(&format!("comment = {comment:?}\n"));
    }
    text
}

/// The text with lines behind the tables of the device of this number, from 0.
fn insert(text: &str, node: usize, lines: &str) -> String {
    let (mut devices, mut at) = (0, 0);
    let mut end = text.len();
    for line in text.split_inclusive('\n') {
        let table = line.trim_start();
        if table.starts_with('[')
            && !table.starts_with("[device.")
            && !table.starts_with("[[device.")
        {
            if devices == node + 1 {
                end = at;
                break;
            }
            devices += usize::from(table.starts_with("[[device]]"));
        }
        at += line.len();
    }
    let (before, behind) = text.split_at(end);
    let gap = if behind.is_empty() { "" } else { "\n" };
    format!("{}\n{lines}{gap}{behind}", before.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_behind_the_tables_of_their_device() {
        let text = "[[device]]\nname = \"a\" # one\n[device.description]\n\n[[device]]\nname = \"b\"\n\n[ring]\n";
        let first = insert(text, 0, "X\n");
        assert_eq!(
            first,
            "[[device]]\nname = \"a\" # one\n[device.description]\nX\n\n[[device]]\nname = \"b\"\n\n[ring]\n"
        );
        let second = insert(text, 1, "X\n");
        assert!(second.ends_with("name = \"b\"\nX\n\n[ring]\n"), "{second}");
        assert_eq!(insert("[[device]]\nname = 1", 0, "X\n"), "[[device]]\nname = 1\nX\n");
    }
}
