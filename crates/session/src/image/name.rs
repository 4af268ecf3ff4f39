//! Lookup of the place of a variable by its name.

use linesman_config::plan::{DevicePlan, Plan, Variable};
use linesman_proto::sii::Direction;

use super::{Place, Value};

/// A name that means no variable, or not one of this type.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum VariableError {
    /// No SubDevice is called so.
    #[error("`{name}`: no SubDevice is called `{device}`. Do: name one of: {known}")]
    NoDevice {
        /// The whole name.
        name: String,
        /// Its first part.
        device: String,
        /// The SubDevices with such data.
        known: String,
    },
    /// Several SubDevices are of that type.
    #[error("`{name}`: {count} SubDevices are of this type. Do: name one of: {known}")]
    SeveralDevices {
        /// The whole name.
        name: String,
        /// How many.
        count: usize,
        /// Their names.
        known: String,
    },
    /// The SubDevice has no such variable.
    #[error("`{name}`: {device} has no such {direction}. Do: name one of: {known}")]
    NoVariable {
        /// The whole name.
        name: String,
        /// The SubDevice.
        device: String,
        /// "input" or "output".
        direction: &'static str,
        /// What it has.
        known: String,
    },
    /// It has several that the name may mean.
    #[error("`{name}`: it may mean {known}. Do: name one of them in full")]
    SeveralVariables {
        /// The whole name.
        name: String,
        /// Which.
        known: String,
    },
    /// It is of another type.
    #[error(
        "`{name}`: {wanted} was asked for, but it has {bits} bits{data_type}. Do: ask for a type of \
         that size"
    )]
    OtherType {
        /// The whole name.
        name: String,
        /// The type that was asked for.
        wanted: &'static str,
        /// How many bits it has.
        bits: usize,
        /// Its type as the description says, in brackets; or empty.
        data_type: String,
    },
}

/// Names that are listed at most.
const LISTED: usize = 12;

/// The place of a variable of type `T`.
pub(super) fn resolve<T: Value>(
    plan: &Plan,
    direction: Direction,
    name: &str,
) -> Result<Place, VariableError> {
    let (device, rest) = device(plan, Some(direction), name)?;
    let mine = |one: &&Variable| one.device == device.id && one.direction == direction;
    let variables: Vec<&Variable> = plan.variables.iter().filter(mine).collect();
    if variables.is_empty() {
        return nameless::<T>(device, direction, name, rest);
    }
    let found = matching(&variables, rest);
    match found[..] {
        [one] => {
            if !T::fits(one.bits) {
                let data_type = match one.data_type.as_str() {
                    "" => String::new(),
                    known => format!(" ({known})"),
                };
                let (name, wanted, bits) = (name.to_owned(), T::NAME, one.bits);
                return Err(VariableError::OtherType { name, wanted, bits, data_type });
            }
            Ok(Place { bit_at: one.bit_at, bits: one.bits })
        }
        [] => Err(no_variable(
            device,
            direction,
            name,
            list(variables.iter().map(|one| format!("{}/{}", device.name, one.name))),
        )),
        _ => {
            let known = list(found.iter().map(|one| format!("{}/{}", device.name, one.name)));
            Err(VariableError::SeveralVariables { name: name.to_owned(), known })
        }
    }
}

/// The SubDevice of this name, of this type if there is only one, or of this number.
///
/// # Errors
/// When there is none, or several.
pub fn find_device<'a>(plan: &'a Plan, name: &str) -> Result<&'a DevicePlan, VariableError> {
    match device(plan, None, name)? {
        (device, "") => Ok(device),
        (_, _) => {
            let known = list(plan.devices.iter().map(|device| device.name.clone()));
            let (name, device) = (name.to_owned(), name.to_owned());
            Err(VariableError::NoDevice { name, device, known })
        }
    }
}

/// The SubDevice that a name begins with, by name, type or number, and the rest of the name.
fn device<'a, 'n>(
    plan: &'a Plan,
    direction: Option<Direction>,
    name: &'n str,
) -> Result<(&'a DevicePlan, &'n str), VariableError> {
    // Names may contain a slash: the longest one counts.
    let begins = |known: &str| {
        name.strip_prefix(known).and_then(|rest| match rest.strip_prefix('/') {
            Some(rest) => Some(rest),
            None => rest.is_empty().then_some(""),
        })
    };
    let by_name = (plan.devices.iter())
        .filter_map(|device| begins(&device.name).map(|rest| (device, rest)))
        .max_by_key(|(device, _)| device.name.len());
    if let Some(found) = by_name {
        return Ok(found);
    }
    let first = name.split('/').next().unwrap_or(name);
    let rest = name.get(first.len() + 1..).unwrap_or("");
    let of_type: Vec<&DevicePlan> =
        plan.devices.iter().filter(|device| device.type_name == first).collect();
    match of_type[..] {
        [one] => return Ok((one, rest)),
        [] => {}
        _ => {
            let known = list(of_type.iter().map(|device| device.name.clone()));
            let (name, count) = (name.to_owned(), of_type.len());
            return Err(VariableError::SeveralDevices { name, count, known });
        }
    }
    let number = first.parse::<u32>().ok();
    if let Some(device) = plan.devices.iter().find(|device| Some(device.id.no()) == number) {
        return Ok((device, rest));
    }
    let has = |device: &&DevicePlan| match direction {
        Some(Direction::Inputs) => !device.inputs.is_empty(),
        Some(Direction::Outputs) => !device.outputs.is_empty(),
        None => true,
    };
    let known = list(plan.devices.iter().filter(has).map(|device| device.name.clone()));
    Err(VariableError::NoDevice { name: name.to_owned(), device: first.to_owned(), known })
}

/// Variables that `rest` may mean: `PDO/Entry`, each by name or by number; or one of both alone.
fn matching<'a>(variables: &[&'a Variable], rest: &str) -> Vec<&'a Variable> {
    if rest.is_empty() {
        return variables.to_vec();
    }
    let exact = |one: &&&Variable| {
        one.name.eq_ignore_ascii_case(rest)
            || one.name.replacen('.', "/", 1).eq_ignore_ascii_case(rest)
    };
    let found: Vec<_> = variables.iter().filter(exact).copied().collect();
    if !found.is_empty() {
        return found;
    }
    let mut pdos: Vec<&str> = Vec::new();
    for one in variables {
        let (pdo, _) = split(&one.name);
        if !pdos.contains(&pdo) {
            pdos.push(pdo);
        }
    }
    let (first, entry) = match rest.split_once('/') {
        Some((first, entry)) => (first, Some(entry)),
        None => (rest, None),
    };
    let number = first.parse::<usize>().ok().and_then(|no| no.checked_sub(1));
    let in_pdo = |one: &&&Variable| {
        let (pdo, _) = split(&one.name);
        pdo.eq_ignore_ascii_case(first)
            || number.is_some_and(|at| pdos.get(at).is_some_and(|nth| *nth == pdo))
    };
    let of_pdo: Vec<_> = variables.iter().filter(in_pdo).copied().collect();
    let Some(entry) = entry else {
        if !of_pdo.is_empty() {
            return of_pdo;
        }
        // No PDO is called so: the entry alone may be enough.
        let by_entry = |one: &&&Variable| split(&one.name).1.eq_ignore_ascii_case(first);
        return variables.iter().filter(by_entry).copied().collect();
    };
    let nth = entry.parse::<usize>().ok().and_then(|no| no.checked_sub(1));
    let mut chosen = Vec::new();
    for (at, one) in of_pdo.into_iter().enumerate() {
        if split(&one.name).1.eq_ignore_ascii_case(entry) || nth == Some(at) {
            chosen.push(one);
        }
    }
    chosen
}

/// PDO and entry of `PDO.Entry`.
fn split(name: &str) -> (&str, &str) {
    name.split_once('.').unwrap_or((name, ""))
}

/// A SubDevice whose description names nothing: `DEVICE/n` is its nth value of the type.
fn nameless<T: Value>(
    device: &DevicePlan,
    direction: Direction,
    name: &str,
    rest: &str,
) -> Result<Place, VariableError> {
    let bytes = match direction {
        Direction::Inputs => device.inputs.clone(),
        Direction::Outputs => device.outputs.clone(),
    };
    let bits = [1, 8, 16, 32, 64].into_iter().rfind(|bits| T::fits(*bits)).unwrap_or(8);
    let count = bytes.len() * 8 / bits;
    let number = if rest.is_empty() && count == 1 { Some(1) } else { rest.parse::<usize>().ok() };
    match number.and_then(|no| no.checked_sub(1)).filter(|at| *at < count) {
        Some(at) => Ok(Place { bit_at: bytes.start * 8 + at * bits, bits }),
        None => {
            let known = match count {
                0 => "none".to_owned(),
                _ => format!("{0}/1 to {0}/{count}", device.name),
            };
            Err(no_variable(device, direction, name, known))
        }
    }
}

fn no_variable(
    device: &DevicePlan,
    direction: Direction,
    name: &str,
    known: String,
) -> VariableError {
    let direction = match direction {
        Direction::Inputs => "input",
        Direction::Outputs => "output",
    };
    VariableError::NoVariable {
        name: name.to_owned(),
        device: device.name.clone(),
        direction,
        known,
    }
}

fn list(names: impl Iterator<Item = String>) -> String {
    let mut names: Vec<String> = names.collect();
    let more = names.len().saturating_sub(LISTED);
    names.truncate(LISTED);
    match (names.is_empty(), more) {
        (true, _) => "none".to_owned(),
        (false, 0) => names.join(", "),
        (false, more) => format!("{} and {more} more", names.join(", ")),
    }
}
