//! Commands that messages advise, completed with the place that the user has named, so that they can be
//! run as they are printed.
//!
//! Errors of the inner crates, and findings, do not know how the line was named: they say
//! `linesman diagnose`, or WHERE for the place.

use crate::command::service::is_socket;
use linesman_link::input::is_capture_name;

/// What a message writes for the place.
const WHERE: &str = "WHERE";
/// Commands whose first word is the place.
const AT_A_PLACE: [&str; 6] = ["scan", "diagnose", "state", "counters", "probe", "online"];
/// Those that no running MainDevice answers; it is asked by another one.
const NOT_OF_A_RUN: [&str; 3] = ["scan", "diagnose", "probe"];
/// How a message begins a command.
const BEGIN: &str = "`linesman ";

/// The text with its commands made for `place`.
pub(crate) fn complete(text: &str, place: &str) -> String {
    let mut result = String::with_capacity(text.len() + place.len());
    let mut rest = text;
    while let Some((before, command)) = rest.split_once(BEGIN) {
        let Some((command, after)) = command.split_once('`') else { break };
        result.push_str(before);
        result.push_str(BEGIN);
        result.push_str(&made(command, place));
        result.push('`');
        rest = after;
    }
    result.push_str(rest);
    result
}

fn made(command: &str, place: &str) -> String {
    let words: Vec<&str> = command.split(' ').collect();
    let (name, rest) = words.split_first().map_or(("", &[][..]), |(name, rest)| (*name, rest));
    let is_bare = rest.first().is_none_or(|word| word.starts_with('-'));
    let names_place = rest.contains(&WHERE);
    let needs_place = AT_A_PLACE.contains(&name) && is_bare;
    if !names_place && !needs_place {
        return match (name, rest) {
            ("run", []) => format!("run --on {}", of(name, place)),
            _ => command.to_owned(),
        };
    }
    if NOT_OF_A_RUN.contains(&name) && is_socket(place) {
        return format!("online {place}");
    }
    let place = of(name, place);
    let rest = rest.iter().map(|word| if *word == WHERE { place } else { word });
    let all: Vec<&str> = match names_place {
        true => [name].into_iter().chain(rest).collect(),
        false => [name, place].into_iter().chain(rest).collect(),
    };
    all.join(" ")
}

/// The place as this command takes it; where it takes none of its kind, somebody has to choose.
fn of<'a>(name: &str, place: &'a str) -> &'a str {
    let is_file = place.starts_with("capture:")
        || place.starts_with("esi:")
        || is_capture_name(place)
        || place.ends_with(".toml") && !place.starts_with("sim:");
    match (name, place.strip_prefix("listen:")) {
        ("diagnose", _) => place,
        (_, Some(cards)) => cards,
        (_, None) if is_file || place.is_empty() => WHERE,
        (_, None) => place,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_made_for_the_place() {
        for (text, place, expected) in [
            ("see `linesman scan -v`", "eth0", "see `linesman scan eth0 -v`"),
            ("`linesman diagnose`", "sim:a.toml", "`linesman diagnose sim:a.toml`"),
            ("`linesman counters WHERE --clear`", "eth0", "`linesman counters eth0 --clear`"),
            (
                "`linesman counters WHERE --clear`",
                "listen:eth0",
                "`linesman counters eth0 --clear`",
            ),
            ("`linesman diagnose`", "listen:eth0", "`linesman diagnose listen:eth0`"),
            ("`linesman counters WHERE`", "capture:a.pcap", "`linesman counters WHERE`"),
            ("`linesman scan`", "a.pcap", "`linesman scan WHERE`"),
            ("`linesman run` or not", "eth0", "`linesman run --on eth0` or not"),
            ("`linesman run --control`", "eth0", "`linesman run --control`"),
            ("`linesman interfaces` lists", "eth0", "`linesman interfaces` lists"),
            ("`linesman explain 0x0300`", "eth0", "`linesman explain 0x0300`"),
            ("`linesman state eth1`", "eth0", "`linesman state eth1`"),
            ("nothing here", "eth0", "nothing here"),
            ("`linesman scan", "eth0", "`linesman scan"),
        ] {
            assert_eq!(complete(text, place), expected);
        }
    }

    #[test]
    fn a_running_maindevice_is_asked_by_its_socket() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let place = path.display().to_string();
        let online = format!("`linesman online {place}`");
        assert_eq!(complete("`linesman diagnose`", &place), online);
        assert_eq!(complete("`linesman scan -v`", &place), online);
        assert_eq!(complete("`linesman state`", &place), format!("`linesman state {place}`"));
    }
}
