//! Mailbox transfers as a table, and in one line.

use linesman_capture::dialogue::{MailboxProtocol, TransferOutcome, TransferReport};
use linesman_proto::mailbox::abort_code;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::mailbox::coe::standard_object::lookup;
use linesman_proto::mailbox::soe::{Idn, LIST_HEADER_LEN, VariableData};

use super::CaptureWriter;
use crate::output::Table;
use crate::text::quantity::time;

/// Bytes of data that are shown as such.
const SHOWN: usize = 16;

impl CaptureWriter<'_> {
    /// Mailbox transfers in order of time.
    pub(super) fn transfers(&self) -> String {
        let transfers = &self.report.transfers;
        if transfers.is_empty() {
            return String::new();
        }
        let (shown, more) = self.shown(transfers.len(), "transfers");
        let headings = ["time", "frame", "SubDevice", "what", "took", "outcome"];
        let mut table = Table::new(&headings, self.paint);
        for one in &transfers[..shown] {
            let at = one.asked_ns.or(one.answered_ns);
            let frame = one.asked_frame.or(one.answered_frame);
            let took = one.asked_ns.zip(one.answered_ns);
            table.row([
                at.map_or_else(String::new, |at| time(at.0)),
                frame.map_or_else(String::new, |frame| frame.0.to_string()),
                self.whom(one.no, one.station, one.position_no),
                what(one),
                took.map_or_else(String::new, |(from, to)| time(to.0.saturating_sub(from.0))),
                self.outcome(one),
            ]);
        }
        self.section("Mailbox dialogue", &(table.render() + &more))
    }

    fn outcome(&self, one: &TransferReport) -> String {
        let said = said(one);
        match one.outcome {
            TransferOutcome::Done | TransferOutcome::Told => said,
            TransferOutcome::Refused => self.paint.bad(&refusal(one)),
            TransferOutcome::Unanswered => self.paint.warning("unanswered"),
            TransferOutcome::Unfinished => self.paint.warning(&format!("unfinished {said}")),
        }
    }
}

/// `upload 0x1018:01 Identity`, `write-file firmware.bin`.
pub(crate) fn what(one: &TransferReport) -> String {
    let mut words = format!("{} {}", one.protocol.name(), one.what);
    match (one.protocol, one.index, one.subindex) {
        (MailboxProtocol::CoE, Some(index), Some(subindex)) => {
            let entry = if one.complete { "all".to_owned() } else { format!("{subindex:02X}") };
            words.push_str(&format!(" 0x{index:04X}:{entry}"));
            if let Some(found) = lookup(ObjectIndex(index)).first() {
                words.push_str(&format!(" {}", found.object.name));
            }
        }
        (MailboxProtocol::SoE, Some(index), _) => words.push_str(&format!(" {}", Idn(index))),
        (_, _, _) => {}
    }
    if one.form.as_deref() == Some("segmented") {
        words.push_str(&format!(", {} messages", one.messages));
    }
    words
}

/// Why it was refused.
pub(crate) fn refusal(one: &TransferReport) -> String {
    match (one.protocol, one.code) {
        (MailboxProtocol::CoE, Some(code)) => {
            format!("refused 0x{code:08X}: {}", abort_code::lookup(code).text)
        }
        (_, Some(code)) => {
            format!("refused 0x{code:04X}: {}", one.text.clone().unwrap_or_default())
        }
        (_, None) => "refused".to_owned(),
    }
}

/// Meaning of the data.
fn said(one: &TransferReport) -> String {
    if let Some(text) = one.text.as_ref().filter(|_| one.protocol == MailboxProtocol::SoE) {
        let data = bytes(&one.data);
        let told = match VariableData::parse(&data) {
            Some(list)
                if list.bytes.len() + LIST_HEADER_LEN == data.len() && is_text(list.bytes) =>
            {
                data_in_words(one, list.bytes, list.bytes.len() as u64)
            }
            Some(_) | None => data_in_words(one, &data, one.size.0),
        };
        return if told.is_empty() { text.clone() } else { format!("{text}: {told}") };
    }
    if let Some(text) = &one.text {
        let code = one.code.map_or_else(String::new, |code| format!("0x{code:04X} "));
        return format!("{code}{text}");
    }
    data_in_words(one, &bytes(&one.data), one.size.0)
}

fn data_in_words(one: &TransferReport, bytes: &[u8], size: u64) -> String {
    match (bytes, size) {
        ([], 0) => String::new(),
        (bytes, size) if is_text(bytes) || is_string(one) => {
            let text = String::from_utf8_lossy(bytes);
            let (text, cut): (String, _) =
                (text.trim_end_matches('\0').chars().take(40).collect(), size > 40);
            format!("\"{text}\"{}", if cut { " …" } else { "" })
        }
        (bytes, 1 | 2 | 4 | 8) => {
            let value = bytes.iter().rev().fold(0_u64, |value, byte| value << 8 | u64::from(*byte));
            let width = 2 * bytes.len();
            format!("0x{value:0width$X} ({value})")
        }
        (bytes, size) => {
            let digits: Vec<String> =
                bytes.iter().take(SHOWN).map(|byte| format!("{byte:02X}")).collect();
            let more = if size > SHOWN as u64 { " …" } else { "" };
            format!("{size} bytes: {}{more}", digits.join(" "))
        }
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    let pairs = hex.as_bytes().chunks_exact(2);
    pairs.filter_map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()).collect()
}

/// Device name, hardware and software version are strings, however short.
fn is_string(one: &TransferReport) -> bool {
    one.protocol == MailboxProtocol::CoE
        && matches!(
            one.index.map(ObjectIndex),
            Some(
                ObjectIndex::DEVICE_NAME
                    | ObjectIndex::HARDWARE_VERSION
                    | ObjectIndex::SOFTWARE_VERSION
            )
        )
}

/// Three printable letters or more, with zeros behind them at most.
fn is_text(bytes: &[u8]) -> bool {
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    end >= 3 && bytes[..end].iter().all(|byte| (0x20..0x7F).contains(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn element_of_a_drive_is_told_with_its_data_or_its_refusal() {
        let transfer = |outcome: &str, data: &str, text: &str| -> TransferReport {
            serde_json::from_value(serde_json::json!({
                "no": 2, "station": 0x1002, "position_no": null, "protocol": "SoE",
                "what": "read-idn", "asked_ns": null, "asked_frame": null, "answered_ns": null,
                "answered_frame": null, "messages": 2, "index": 36, "subindex": null,
                "complete": false, "form": null, "size": data.len() / 2, "data": data,
                "text": text, "outcome": outcome, "code": 0x7005,
            }))
            .unwrap()
        };
        let value = transfer("done", "05000000", "value of drive 0");
        assert_eq!(what(&value), "SoE read-idn S-0-0036");
        assert_eq!(said(&value), "value of drive 0: 0x00000005 (5)");
        let name = transfer("done", "0400040073706565", "name of drive 0");
        assert_eq!(said(&name), "name of drive 0: \"spee\"");
        assert_eq!(said(&transfer("done", "", "value of drive 0")), "value of drive 0");
        let refused = transfer("refused", "", "value of drive 0: it is write-protected");
        assert_eq!(refusal(&refused), "refused 0x7005: value of drive 0: it is write-protected");
    }

    #[test]
    fn data_are_text_where_all_letters_can_be_printed() {
        assert!(is_text(b"EL3004\0\0") && !is_text(b"\0\0\0\0") && !is_text(b"ab\x01"));
        assert!(!is_text(b"A") && bytes("0a1B") == [0x0A, 0x1B]);
    }
}
