//! Element `Master`: what all SubDevices are told before anything else.

use linesman_proto::command::Command;

use super::transition::{Init, Target, command};
use crate::plan::layout::MAILBOX_STATES;
use crate::plan::{AddressingChoice, DevicePlan, Plan};
use crate::xml_writer::Xml;

pub(super) fn write(xml: &mut Xml, name: &str, plan: &Plan) {
    xml.element("Master", &[], |xml| {
        xml.element("Info", &[], |xml| {
            xml.text("Name", name);
            xml.text("Destination", "ffffffffffff");
            // An address for documentation (RFC 7042): a MainDevice puts its own.
            xml.text("Source", "00005e00530a");
            xml.text("EtherType", "a488");
        });
        let mailboxes = plan.devices.iter().filter(|one| one.mailbox_state.is_some()).count();
        if mailboxes > 0 {
            xml.element("MailboxStates", &[], |xml| {
                xml.text("StartAddr", MAILBOX_STATES.0);
                xml.text("Count", mailboxes);
            });
        }
        xml.element("InitCmds", &[], |xml| {
            for (comment, register, data) in [
                ("clear configured addresses", 0x0010, &[0; 2][..]),
                ("clear error counters", 0x0300, &[0; 8]),
                ("clear FMMUs", 0x0600, &[0; 256]),
                ("clear SyncManagers", 0x0800, &[0; 128]),
                ("clear DC system time", 0x0910, &[0; 32]),
                ("clear DC activation", 0x0981, &[0; 1]),
                ("reset DC speed", 0x0930, &[0x00, 0x10]),
                ("set DC filter", 0x0934, &[0x00, 0x0C]),
            ] {
                let init = Init::new(comment, &["IP"], Target::All, register);
                command(xml, &Init { before: true, ..init }, Command::Bwr, data);
            }
            let by_alias = |one: &DevicePlan| one.settings.addressing == AddressingChoice::Alias;
            if plan.devices.iter().any(by_alias) {
                // Bit 24 of DL control (S2 2.4.1): controllers answer to their second address.
                let init = Init::new("use second addresses", &["IP"], Target::All, 0x0103);
                command(xml, &Init { before: true, ..init }, Command::Bwr, &[1]);
            }
        });
    });
}
