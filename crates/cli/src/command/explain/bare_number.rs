//! Meanings of a number alone: a code, a register, an object, a state word, a command.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::diagnosis::{CodeRange, text_number};
use linesman_proto::mailbox::coe::emergency::code;
use linesman_proto::mailbox::coe::{ErrorRegister, ObjectIndex};
use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::mailbox::soe::SoeError;
use linesman_proto::register::{self, Description};
use linesman_proto::state::status_code::Origin;
use linesman_proto::state::{AlStatusCode, DeviceState};

use super::found::Found;
use super::number::Number;
use super::page::{Kind, Page};
use super::{codes, commands, objects, registers, state_words, states};

/// A reading below this is not worth telling when the digits mean another number rather.
const WORTH_TELLING: u8 = 40;
/// With a reading of this a number is no state word by chance.
const CERTAIN: u8 = 75;
/// Digits of an index: they are rarely meant in decimal.
const INDEX_DIGITS: usize = 4;
/// By how much a number is less likely in its second base.
const SECOND_BASE: u8 = 30;

/// Adds all that a number can be; its readings in several bases, the more likely first.
pub(super) fn add(numbers: &[Number], found: &mut Found) {
    for (order, number) in numbers.iter().enumerate() {
        let mut own = Found::default();
        if number.is_long() {
            long(*number, &mut own);
        } else if let Some(word) = number.word() {
            short(*number, word, &mut own);
        }
        let is_index = number.decimal && number.digits == INDEX_DIGITS;
        for (likelihood, page) in own.into_parts() {
            if is_index && order > 0 && page.kind() != Kind::StationAddress {
                continue;
            }
            let page = match number.decimal && numbers.len() > 1 {
                true => page.note("read as", format!("{} in decimal", number.value)),
                false => page,
            };
            match order {
                0 => found.add(likelihood, page),
                _ if likelihood >= WORTH_TELLING => found.add(likelihood - SECOND_BASE, page),
                _ => {}
            }
        }
    }
}

/// A number of up to four digits.
fn short(number: Number, word: u16, found: &mut Found) {
    let status = AlStatusCode(word);
    let is_standard = status.explain().origin == Origin::Standard;
    if is_standard {
        found.add(90, codes::status(status));
    }
    // Few mean the middle of a register when there is a status code of that number.
    let register = register_at(word).filter(|found| !is_standard || found.offset == 0);
    if let Some(register) = register {
        found.add(if register.offset == 0 { 80 } else { 55 }, registers::register(&register));
    }
    let index = ObjectIndex(word);
    if objects::is_named(index) {
        found.extend(85, objects::pages(index, None));
    }
    if word > 0 && code::lookup(word).known {
        let is_round = word & 0x0FFF == 0;
        found.add(if is_round { 58 } else { 75 }, codes::emergency(word));
    }
    if FoeErrorCode::NAMED.contains(&FoeErrorCode(word.into())) {
        found.add(65, codes::foe(FoeErrorCode(word.into())));
    }
    if text_number::general(word).is_some() && word > 0x0FFF {
        found.add(60, codes::text(word));
    }
    if codes::is_soe(word) {
        found.add(18, codes::soe(SoeError(word)));
    }
    found.extend(48, states::al_status(word).filter(|_| word > 0));
    let state = DeviceState(word);
    if state_words::is_device_state(state) && !found.has(CERTAIN) {
        found.add(70, state_words::device_state(state));
    }
    low_values(number, word, found);
    if number.decimal && (1001..2000).contains(&word) {
        found.add(72, station(word));
    }
    if word >= 0x1000 && !objects::is_named(index) {
        found.add(20, objects::area(index, None));
    }
    if status.explain().origin == Origin::Vendor {
        found.add(15, codes::status(status));
    }
    // A number that no table has is a status code all the same: what to do with one is known too.
    if found.is_empty() {
        found.add(10, codes::status(status));
    }
}

/// Further meanings of a number of one byte.
fn low_values(number: Number, word: u16, found: &mut Found) {
    let Ok(byte) = u8::try_from(word) else { return };
    if number.digits > 2 {
        return;
    }
    found.extend(35, Command::from_code(byte).map(commands::command));
    let sorts: Vec<&str> = ErrorRegister(byte).names().collect();
    if byte > 0 && byte & 0x40 == 0 {
        let title = format!("Error register 0x{byte:02X}: {}", sorts.join(", "));
        let text = "A value of object 0x1001, and the third byte of an emergency: which sorts of errors \
                    are there.";
        found.add(30, Page::new(Kind::Value, title).text(text).fact("see", "CiA 301"));
    }
}

/// A number of five digits and more.
fn long(number: Number, found: &mut Found) {
    let Some(value) = number.long() else { return };
    let code = SdoAbortCode(value);
    let has_class = matches!(value >> 24, 0x05 | 0x06 | 0x08);
    let bytes_first = value.swap_bytes();
    if code.explain().known {
        found.add(90, codes::abort(code));
    } else if has_class {
        found.add(60, codes::abort(code));
    }
    let is_message = |value: u32| {
        matches!(
            CodeRange::of(value),
            CodeRange::Manufacturer | CodeRange::Emergency | CodeRange::Profile
        ) && value > 0xFFFF
    };
    if is_message(value) {
        found.add(70, codes::diagnosis(value));
    }
    if is_message(bytes_first) && !number.decimal {
        found.add(85, codes::diagnosis(bytes_first).note(
            "read as",
            "four bytes in the order of the line, lowest first: the beginning of a diagnosis message",
        ));
    }
    let index = ObjectIndex((value >> 16) as u16);
    let bits = value & 0xFF;
    let is_length = (1..=64).contains(&bits) && !has_class;
    if is_length && index.0 >= 0x2000 && !number.decimal {
        found.add(if objects::is_named(index) { 75 } else { 25 }, objects::mapping(value));
    }
    if found.is_empty() {
        found.add(10, codes::abort(code));
    }
}

/// The register that an address belongs to.
pub(super) fn register_at(word: u16) -> Option<Description> {
    register::describe(RegisterAddress(word))
}

/// A page about a station address.
pub(super) fn station(address: u16) -> Page {
    let title = format!("Station address {address} (0x{address:04X})");
    let which = match address {
        1001..2000 => {
            format!("with TwinCAT, which counts from 1001, the SubDevice no. {}", address - 1000)
        }
        0x1001..=0x1FFF => {
            format!("with SOEM, which counts from 0x1001, the SubDevice no. {}", address - 0x1000)
        }
        _ => String::new(),
    };
    Page::new(Kind::StationAddress, title)
        .text(
            "The address that the MainDevice gives a SubDevice at start-up (register 0x0010). It is lost at \
             power-off.",
        )
        .fact("whose", which)
        .fact("see", "S1 chapter 2")
}
