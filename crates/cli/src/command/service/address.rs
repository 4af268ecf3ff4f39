//! Address of a SubDevice as a word: `3`, `0x1003`, `alias:7`, `position:2`, `Term 4`, `EL3204`, or
//! as it is called in every answer, `Term 4 (EL3104)`.

use linesman_config::inventory::label;
use linesman_proto::address::DeviceId;

use super::known::KnownDevice;
use crate::failure::Failure;

/// Most SubDevices that are named where a word means none of them.
const MOST_NAMED: usize = 6;

/// What a SubDevice is known by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeviceNames<'a> {
    pub(crate) id: DeviceId,
    /// 0 for none.
    pub(crate) station: u16,
    /// 0 for none.
    pub(crate) alias: u16,
    /// Empty for none.
    pub(crate) name: &'a str,
    /// Empty where it is not known.
    pub(crate) type_name: &'a str,
}

impl<'a> From<&'a KnownDevice> for DeviceNames<'a> {
    fn from(known: &'a KnownDevice) -> Self {
        Self {
            id: known.id,
            station: known.station,
            alias: known.alias,
            name: known.name.as_deref().unwrap_or_default(),
            type_name: &known.type_name,
        }
    }
}

impl DeviceNames<'_> {
    fn label(&self) -> String {
        label(self.id, self.name, self.type_name)
    }
}

/// The SubDevice that a word means.
pub(crate) fn find(
    devices: &[DeviceNames<'_>],
    place: &str,
    word: &str,
) -> Result<DeviceId, Failure> {
    match find_all(devices, place, word)?[..] {
        [one] => Ok(one),
        ref found => {
            let numbers: Vec<String> = found.iter().map(|id| id.no().to_string()).collect();
            let reason = format!("{place}: `{word}` may be any of {}", numbers.join(", "));
            Err(Failure::new(reason, "name it by its number"))
        }
    }
}

/// All SubDevices that a word means, at least one: a type may be that of several.
pub(crate) fn find_all(
    devices: &[DeviceNames<'_>],
    place: &str,
    word: &str,
) -> Result<Vec<DeviceId>, Failure> {
    let is = |condition: &dyn Fn(&DeviceNames<'_>) -> bool| -> Vec<DeviceId> {
        devices.iter().filter(|one| condition(one)).map(|one| one.id).collect()
    };
    // As answers write it, quotation marks and all.
    let bare = word.trim().trim_matches(['\'', '"']);
    let alias = |alias: u16| is(&|one| one.alias == alias && alias != 0);
    // A name is nobody else's; numbers and types come behind it.
    let by_name = is(&|one| one.name == bare && !bare.is_empty());
    let found = if !by_name.is_empty() {
        by_name
    } else if let Some(number) = bare.strip_prefix("alias:") {
        alias(number_of(number).ok_or_else(|| no_number(word, "an alias"))?)
    } else if let Some(number) = bare.strip_prefix("position:") {
        let wanted = number_of(number).ok_or_else(|| no_number(word, "a position"))?;
        is(&|one| one.id.index() == usize::from(wanted))
    } else if let Some(hex) = bare.strip_prefix("0x") {
        let wanted = u16::from_str_radix(hex, 16);
        let wanted = wanted.map_err(|_| no_number(word, "a station address"))?;
        let station = is(&|one| one.station == wanted && wanted != 0);
        if station.is_empty() { alias(wanted) } else { station }
    } else if bare.bytes().all(|letter| letter.is_ascii_digit()) && !bare.is_empty() {
        is(&|one| one.id.no().to_string() == bare)
    } else {
        called(devices, bare)
    };
    match found[..] {
        [_, ..] => Ok(found),
        [] => {
            let named = devices.iter().take(MOST_NAMED).map(DeviceNames::label).collect::<Vec<_>>();
            let more = devices.len().saturating_sub(MOST_NAMED);
            let more = if more == 0 { String::new() } else { format!(", and {more} more") };
            let count = devices.len();
            let reason = format!("{place}: `{word}`: none of its {count} SubDevices is called so");
            let advice = format!(
                "name one of {}{more}; its number, station address (0x1003), alias (alias:7) or \
                 position (position:0) does, too; `linesman scan` lists them",
                named.join(", ")
            );
            Err(Failure::new(reason, advice))
        }
    }
}

/// Those that are called so in answers, now or by earlier versions, else those of that type; whatever
/// the case of the letters.
fn called(devices: &[DeviceNames<'_>], word: &str) -> Vec<DeviceId> {
    let is = |condition: &dyn Fn(&DeviceNames<'_>) -> bool| -> Vec<DeviceId> {
        devices.iter().filter(|one| condition(one)).map(|one| one.id).collect()
    };
    let same = |text: &str| !text.is_empty() && text.eq_ignore_ascii_case(word);
    // Where the type is not known, the name in front of one is enough.
    let name = word.strip_suffix(')').and_then(|word| word.rsplit_once(" (")).map(|(name, _)| name);
    let ways: [&dyn Fn(&DeviceNames<'_>) -> bool; 6] = [
        &|one| same(&one.label()),
        &|one| one.type_name.is_empty() && name.is_some_and(|name| name == one.name),
        &|one| same(&format!("SubDevice {}", one.id.no())),
        &|one| same(&format!("{} ({})", one.id.no(), one.type_name)),
        &|one| same(one.name),
        &|one| same(one.type_name),
    ];
    ways.into_iter().map(is).find(|found| !found.is_empty()).unwrap_or_default()
}

fn number_of(text: &str) -> Option<u16> {
    match text.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

fn no_number(word: &str, what: &str) -> Failure {
    Failure::new(
        format!("`{word}`: expected {what}, 0 to 65535"),
        "for example 0x1003, alias:7 or position:0",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_call_a_subdevice_is_understood() {
        let one = |no: u32, name, type_name| DeviceNames {
            id: DeviceId(no - 1),
            station: 0x1000 + no as u16,
            alias: if no == 2 { 7 } else { 0 },
            name,
            type_name,
        };
        let all = [
            one(1, "Term 1 (EK1100)", "EK1100"),
            one(2, "Pump", "EL2008"),
            one(3, "", "EL3104"),
            one(4, "", "EL3104"),
            one(5, "2", ""),
        ];
        for (word, no) in [
            ("1", 1),
            ("Term 1 (EK1100)", 1),
            ("'Term 1 (EK1100)'", 1),
            ("EK1100", 1),
            ("0x1002", 2),
            ("0x0007", 2),
            ("alias:7", 2),
            ("alias:0x7", 2),
            ("position:1", 2),
            ("Pump", 2),
            ("pump", 2),
            ("Pump (EL2008)", 2),
            ("el2008", 2),
            ("SubDevice 3 (EL3104)", 3),
            ("SubDevice 3", 3),
            ("3 (EL3104)", 3),
            ("subdevice 4 (el3104)", 4),
            // A name is nobody else's.
            ("2", 5),
        ] {
            assert_eq!(find(&all, "eth0", word).map(DeviceId::no), Ok(no), "{word}");
        }
        let doubt = find(&all, "eth0", "EL3104").unwrap_err();
        assert_eq!(doubt.reason, "eth0: `EL3104` may be any of 3, 4");
        let nobody = find(&all, "eth0", "9").unwrap_err();
        assert!(nobody.next_step.starts_with("name one of Term 1 (EK1100), Pump (EL2008), "));
        assert!(find(&all, "eth0", "position:x").is_err() && find(&all, "eth0", "").is_err());
    }
}
