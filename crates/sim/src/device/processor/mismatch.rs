//! Settings that do not fit what the device's data say: a fault.

use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::sii::MailboxPair;

use super::Processor;
use crate::device::Mismatch;
use crate::device::dictionary::Dictionary;

/// The PDOs of the inputs of a device with a mailbox.
const INPUT_ASSIGNMENT: ObjectIndex = ObjectIndex(0x1C13);
/// Those of its outputs.
const OUTPUT_ASSIGNMENT: ObjectIndex = ObjectIndex(0x1C12);
/// Idents of the modules that the device has found.
const DETECTED_MODULES: ObjectIndex = ObjectIndex(0xF050);

/// What was before.
#[derive(Clone, Debug)]
pub(super) struct Former {
    what: Mismatch,
    dictionary: Dictionary,
    mailbox: MailboxPair,
}

impl Processor {
    /// A setting is another one from now on, also after power-on, or what it was.
    pub(super) fn mismatch(&mut self, what: Mismatch, begins: bool) {
        if begins {
            self.former.push(Former {
                what,
                dictionary: self.description.dictionary.clone(),
                mailbox: self.description.mailbox,
            });
            match what {
                Mismatch::ProcessData => {
                    let lists = [INPUT_ASSIGNMENT, OUTPUT_ASSIGNMENT];
                    let list = lists.into_iter().find(|list| shorten(&mut self.dictionary, *list));
                    if let Some(list) = list {
                        shorten(&mut self.description.dictionary, list);
                    }
                }
                Mismatch::Modules => {
                    shorten(&mut self.dictionary, DETECTED_MODULES);
                    shorten(&mut self.description.dictionary, DETECTED_MODULES);
                }
                Mismatch::Mailbox => {
                    let mailbox = &mut self.description.mailbox;
                    mailbox.receive.size /= 2;
                    mailbox.send.size /= 2;
                }
            }
            return;
        }
        let Some(at) = self.former.iter().position(|former| former.what == what) else { return };
        let former = self.former.remove(at);
        self.description.mailbox = former.mailbox;
        for list in [INPUT_ASSIGNMENT, OUTPUT_ASSIGNMENT, DETECTED_MODULES] {
            if let Some(object) = former.dictionary.object(list).cloned() {
                self.dictionary.replace(object);
            }
        }
        self.description.dictionary = former.dictionary;
    }
}

/// Takes the last entry off a list; false when there is none.
fn shorten(dictionary: &mut Dictionary, list: ObjectIndex) -> bool {
    let Some(mut object) = dictionary.object(list).cloned() else { return false };
    let Some(count) = object.entries.first_mut() else { return false };
    let Some(fewer) = count.as_number().checked_sub(1) else { return false };
    count.value = vec![fewer as u8];
    dictionary.replace(object);
    true
}
