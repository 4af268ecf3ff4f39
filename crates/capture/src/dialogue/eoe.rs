//! Ethernet frames through the mailbox, their fragments put together; addresses that are set.

use linesman_proto::ethernet::{destination, source};
use linesman_proto::mailbox::eoe::{Assembly, EoeResult, Fragment, IpParameters, Message, Setting};

use super::report::{MailboxProtocol, TransferOutcome};
use super::transfer::Store;
use super::{MailboxMessage, OpenTransfers};

/// Frames of which not all fragments are there yet: out and in.
#[derive(Clone, Default, Debug)]
pub(super) struct Assemblies {
    ways: [Assembling; 2],
}

#[derive(Clone, Default, Debug)]
struct Assembling {
    assembly: Assembly,
    open: Option<usize>,
}

/// Takes a message of type EoE.
pub(super) fn message(
    store: &mut Store,
    mailbox: &mut OpenTransfers,
    message: &MailboxMessage<'_>,
) {
    match Message::parse(message.body) {
        Ok(Message::Fragment(fragment)) => {
            let way = &mut mailbox.eoe.ways[usize::from(message.is_request)];
            take(store, way, message, &fragment);
        }
        Ok(Message::TimeStamp { .. }) => store.single(message, MailboxProtocol::EoE, "time-stamp"),
        Ok(Message::Request { about, parameters, .. }) => {
            mailbox.eoe_setting = store.open(message, MailboxProtocol::EoE, setting(about));
            if let Some(transfer) = store.get(mailbox.eoe_setting) {
                transfer.push(parameters);
                transfer.text = addresses(about, parameters);
            }
        }
        Ok(Message::Response { about, result, parameters, .. }) => {
            let is_asked = |what: &str| what == setting(about);
            let open = mailbox.eoe_setting.take();
            let asked = store.get(open).is_some_and(|open| is_asked(open.what));
            let index = match asked {
                true => open,
                false => store.open(message, MailboxProtocol::EoE, setting(about)),
            };
            let Some(transfer) = store.get(index) else { return };
            transfer.messages += u32::from(asked);
            transfer.push(parameters);
            let is_good = result == EoeResult::SUCCESS;
            let outcome = if is_good { TransferOutcome::Done } else { TransferOutcome::Refused };
            transfer.end(message.when, outcome, (!is_good).then_some(u32::from(result.0)));
            transfer.text = match is_good {
                true => addresses(about, parameters).or(transfer.text.take()),
                false => Some(result.text().to_owned()),
            };
        }
        Err(_) => {}
    }
}

fn take(
    store: &mut Store,
    way: &mut Assembling,
    message: &MailboxMessage<'_>,
    fragment: &Fragment<'_>,
) {
    let what = if message.is_request { "frame-out" } else { "frame-in" };
    let result = way.assembly.take(fragment);
    if fragment.offset() == 0 || way.open.is_none() {
        way.open = store.open(message, MailboxProtocol::EoE, what);
    } else if let Some(transfer) = store.get(way.open) {
        transfer.messages += 1;
    }
    let Some(transfer) = store.get(way.open) else { return };
    match result {
        Ok(Some(frame)) => {
            transfer.push(&frame);
            transfer.text = Some(ethernet(&frame));
            transfer.outcome = TransferOutcome::Told;
            way.open = None;
        }
        Ok(None) => transfer.outcome = TransferOutcome::Unfinished,
        Err(refused) => {
            transfer.text = Some(refused.to_string());
            transfer.outcome = TransferOutcome::Unfinished;
            way.open = None;
        }
    }
}

/// `02:01:05:10:00:01 to ff:ff:ff:ff:ff:ff, type 0x0806`.
fn ethernet(frame: &[u8]) -> String {
    match (source(frame), destination(frame), frame.get(12..14)) {
        (Some(from), Some(to), Some(kind)) => {
            format!("{from} to {to}, type 0x{:02X}{:02X}", kind[0], kind[1])
        }
        (_, _, _) => "no Ethernet header".to_owned(),
    }
}

fn addresses(about: Setting, parameters: &[u8]) -> Option<String> {
    let parameters = match about {
        Setting::SetIp | Setting::GetIp => IpParameters::parse(parameters)?,
        Setting::SetFilter | Setting::GetFilter => return None,
    };
    let dotted = |address: Option<[u8; 4]>| address.map(|[a, b, c, d]| format!("{a}.{b}.{c}.{d}"));
    let named = [
        ("MAC", parameters.mac.map(|mac| mac.to_string())),
        ("IP", dotted(parameters.ip)),
        ("mask", dotted(parameters.mask)),
        ("gateway", dotted(parameters.gateway)),
        ("DNS", dotted(parameters.dns)),
    ];
    let told = named.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", value?)));
    let text = told.collect::<Vec<_>>().join(", ");
    (!text.is_empty()).then_some(text)
}

const fn setting(about: Setting) -> &'static str {
    match about {
        Setting::SetIp => "set-ip",
        Setting::SetFilter => "set-filter",
        Setting::GetIp => "get-ip",
        Setting::GetFilter => "get-filter",
    }
}
