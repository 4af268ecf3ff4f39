//! The register table read for people: what is at an address, what do these bytes say.
//!
//! [`describe`] answers `linesman explain 0x0306`; [`pieces`] and [`summary`] are for a decoder
//! that has a datagram's address and data before it; [`decode`] lists field by field.

use std::fmt::Write as _;

use super::entry::{Field, Form, Register, Unit};
use super::table::ALL;
use crate::address::RegisterAddress;
use crate::port::Port;

/// Which register an address belongs to.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// The register, or the family it is one of.
    pub register: &'static Register,
    /// Which one of the family, counted from 0.
    pub index: u16,
    /// Which byte of it the address is.
    pub offset: u16,
}

impl Description {
    /// The register's name, with port or number if it is one of a family: `AL status`, `RX error
    /// counter, port D`, `SyncManager 3`.
    #[must_use]
    pub fn title(&self) -> String {
        let name = self.register.name;
        match self.register.repeat.map(|repeat| repeat.unit) {
            None => name.to_owned(),
            Some(Unit::Port) => match Port::from_index(usize::from(self.index)) {
                Some(port) => format!("{name}, port {port}"),
                None => format!("{name} {}", self.index),
            },
            Some(Unit::Fmmu | Unit::SyncManager) => format!("{name} {}", self.index),
        }
    }

    /// The fields that have a bit in the byte at the address.
    pub fn fields(&self) -> impl Iterator<Item = &'static Field> {
        let offset = self.offset;
        self.register.fields.iter().filter(move |field| field.touches_byte(offset))
    }

    /// Where the register begins.
    #[must_use]
    pub fn start(&self) -> RegisterAddress {
        self.register.at(self.index).unwrap_or(self.register.address)
    }
}

/// The register at an address; `None` where the address space is reserved, and in process RAM.
#[must_use]
pub fn describe(address: RegisterAddress) -> Option<Description> {
    let behind = ALL.partition_point(|register| register.address <= address);
    let register = ALL.get(behind.checked_sub(1)?)?;
    let distance = address.0 - register.address.0;
    let stride = register.repeat.map_or(register.len, |repeat| repeat.stride);
    let (index, offset) = (distance / stride, distance % stride);
    (index < register.count() && offset < register.len).then_some(Description {
        register,
        index,
        offset,
    })
}

/// The register with this name. Case, hyphens, underscores, commas and spaces do not matter:
/// `AL status`, `al-status` and `AL_STATUS` are the same.
#[must_use]
pub fn by_name(name: &str) -> Option<&'static Register> {
    ALL.iter().find(|register| letters(register.name).eq(letters(name)))
}

/// The address of the register with this name, as [`by_name`] takes it. One of a family is named by its
/// title, `RX error counter, port B` or `FMMU 2`; the name of the family alone is its first one.
#[must_use]
pub fn address_by_name(name: &str) -> Option<RegisterAddress> {
    if let Some(register) = by_name(name) {
        return Some(register.address);
    }
    let members = ALL.iter().filter(|register| register.count() > 1).flat_map(|register| {
        (0..register.count()).map(move |index| Description { register, index, offset: 0 })
    });
    let mut named = members.filter(|member| letters(&member.title()).eq(letters(name)));
    named.next().map(|member| member.start())
}

/// What of a name counts.
fn letters(name: &str) -> impl Iterator<Item = u8> {
    name.bytes().filter(u8::is_ascii_alphanumeric).map(|byte| byte.to_ascii_lowercase())
}

/// One field of a register and what it reads.
#[derive(Clone, Debug)]
pub struct Reading {
    /// The field.
    pub field: &'static Field,
    /// Its bits as an unsigned number; of a run of bytes the first eight.
    pub value: u64,
    /// Whether the data end inside the field, so that `value` is its low part only: 32 bits of a
    /// 64-bit time, as many MainDevices and all 32-bit controllers have it.
    pub partial: bool,
    /// The value as people write it: `SAFEOP`, `yes`, `0x1001`, `-120 ns`.
    pub text: String,
}

/// What `data`, read from the start of a register, say: one reading for each field that is in them.
///
/// Of numbers the low part is enough; other fields must be there as a whole.
#[must_use]
pub fn decode(register: &Register, data: &[u8]) -> Vec<Reading> {
    decode_at(register, 0, data)
}

/// Like [`decode`], for data that begin `offset` bytes behind the start of the register.
#[must_use]
pub fn decode_at(register: &Register, offset: u16, data: &[u8]) -> Vec<Reading> {
    decode_fields(register.fields, offset, data)
}

/// Values of `data` in these fields, which need not be those of a register: objects have such, too.
#[must_use]
pub fn decode_fields(fields: &'static [Field], offset: u16, data: &[u8]) -> Vec<Reading> {
    let first = usize::from(offset) * 8;
    let behind = first + data.len() * 8;
    let read = |field: &'static Field| {
        let (low, high) = (usize::from(field.low), usize::from(field.high));
        if low < first || low >= behind {
            return None;
        }
        let partial = high >= behind;
        if partial && !matches!(field.form, Form::Decimal | Form::Hex | Form::Bytes) {
            return None;
        }
        let value = bits(data, low - first, usize::from(field.width()).min(64));
        let text = if field.form == Form::Bytes {
            bytes_text(data, (low - first) / 8, usize::from(field.width()) / 8)
        } else if partial {
            format!("{} (low {} bits)", value_text(field, value), behind - low)
        } else {
            value_text(field, value)
        };
        Some(Reading { field, value, partial, text })
    };
    fields.iter().filter_map(read).collect()
}

/// What `data`, read from the start of a register, say in one line: set flags by name, values by
/// name or number. `PREOP, error` for AL status 0x0012; `0x001E invalid input configuration` for
/// the code.
#[must_use]
pub fn summary(register: &Register, data: &[u8]) -> String {
    summary_at(register, 0, data)
}

/// Like [`summary`], for data that begin `offset` bytes behind the start of the register.
#[must_use]
pub fn summary_at(register: &Register, offset: u16, data: &[u8]) -> String {
    if let Some(text) = register.view.and_then(|view| view(offset, data)) {
        return text;
    }
    let readings = decode_at(register, offset, data);
    let alone = register.fields.len() == 1;
    let words: Vec<String> = readings.iter().filter_map(|reading| word(reading, alone)).collect();
    match (words.is_empty(), readings.is_empty()) {
        (false, _) => words.join(", "),
        (true, false) => "nothing set".to_owned(),
        (true, true) => hex_bytes(data),
    }
}

/// A stretch of a datagram's data that belongs to one register, or to none.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Where the stretch begins.
    pub address: RegisterAddress,
    /// The register; `None` for reserved addresses and process RAM.
    pub description: Option<Description>,
    /// The bytes.
    pub data: &'a [u8],
}

impl Piece<'_> {
    /// What its bytes say in one line; `None` where there is no register.
    #[must_use]
    pub fn summary(&self) -> Option<String> {
        self.description.map(|found| summary_at(found.register, found.offset, self.data))
    }
}

/// Cuts the data of a datagram that begins at `address` at the borders of registers. Reserved
/// stretches and process RAM come as one piece each.
pub fn pieces(address: RegisterAddress, data: &[u8]) -> impl Iterator<Item = Piece<'_>> {
    let mut position = usize::from(address.0);
    let mut rest = data;
    std::iter::from_fn(move || {
        // Addresses wrap nowhere: what lies behind 0xFFFF does not exist.
        let address = RegisterAddress(u16::try_from(position).ok()?);
        if rest.is_empty() {
            return None;
        }
        let description = describe(address);
        let room = match description {
            Some(found) => usize::from(found.register.len - found.offset),
            None => next_register(address) - position,
        };
        let (data, behind) = rest.split_at(room.min(rest.len()));
        position += room;
        rest = behind;
        Some(Piece { address, description, data })
    })
}

/// Where the next register behind a reserved address begins; the end of all memory if there is
/// none.
fn next_register(address: RegisterAddress) -> usize {
    let behind = ALL.partition_point(|register| register.address <= address);
    ALL.get(behind).map_or(0x1_0000, |register| usize::from(register.address.0))
}

/// `width` bits (at most 64) of little-endian data from bit `low` up; bits behind the end are 0.
fn bits(data: &[u8], low: usize, width: usize) -> u64 {
    (0..width).fold(0, |value, bit| {
        let at = low + bit;
        let set = data.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0);
        value | u64::from(set) << bit
    })
}

fn value_text(field: &Field, value: u64) -> String {
    if let Some(name) = field.value_name(value) {
        return name.to_owned();
    }
    let width = field.width();
    let digits = usize::from(width.div_ceil(4));
    let number = match field.form {
        Form::Flag => return if value == 0 { "no" } else { "yes" }.to_owned(),
        Form::Choice => return format!("unknown (0x{value:0digits$X})"),
        Form::Hex | Form::Bytes => return format!("0x{value:0digits$X}"),
        Form::Decimal => value.to_string(),
        Form::Signed => sign_extended(value, width).to_string(),
        Form::SignMagnitude => sign_magnitude(value, width).to_string(),
    };
    match field.unit {
        "" => number,
        "bytes" if number == "1" => "1 byte".to_owned(),
        unit => format!("{number} {unit}"),
    }
}

/// The value of `width` bits in two's complement.
fn sign_extended(value: u64, width: u16) -> i64 {
    let unused = u32::from(64 - width.min(64));
    ((value << unused) as i64) >> unused
}

/// The value of `width` bits of which the highest is the sign.
fn sign_magnitude(value: u64, width: u16) -> i64 {
    let sign = 1 << (width.min(64) - 1);
    let magnitude = (value & (sign - 1)) as i64;
    if value & sign == 0 { magnitude } else { -magnitude }
}

fn bytes_text(data: &[u8], first: usize, count: usize) -> String {
    hex_bytes(data.get(first..).map_or(&[], |rest| &rest[..count.min(rest.len())]))
}

fn hex_bytes(data: &[u8]) -> String {
    data.iter().fold(String::new(), |mut text, byte| {
        let gap = if text.is_empty() { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(text, "{gap}{byte:02X}");
        text
    })
}

/// The part of a one-line summary that a reading makes; `None` for a flag that is not set.
fn word(reading: &Reading, alone: bool) -> Option<String> {
    let Reading { field, value, text, partial: _ } = reading;
    if field.form == Form::Flag {
        return (*value != 0).then(|| field.name.to_owned());
    }
    Some(if alone { text.clone() } else { format!("{} {text}", field.name) })
}

#[cfg(test)]
mod tests;
