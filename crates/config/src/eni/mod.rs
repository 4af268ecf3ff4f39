//! Network configurations of other tools: EtherCAT Network Information (ENI), XML files.
//!
//! Read first: ETG.2100. [`Eni::parse`] reads a file into a [`Plan`], [`write`](fn@write) makes a file of a
//! plan. What a file prescribes (addresses, FMMUs, frames, commands) is taken over as it stands; what
//! follows from it (who owns which bytes, expected working counters, bits of each SubDevice) is worked
//! out and compared with the file's own numbers, and a contradiction is refused with its place.
//! Elements that are not known are passed over.

mod command;
mod cyclic;
mod error;
mod image;
mod own;
mod project;
mod state;
mod sub_device;
mod wiring;
mod write;

pub use error::EniError;
pub use write::write;

use linesman_proto::time::Span;

use self::cyclic::FileTask;
use self::sub_device::FileDevice;
use crate::esi::encoding;
use crate::esi::xml::{self, Element};
use crate::plan::Plan;

/// The outermost element.
const ROOT: &str = "EtherCATConfig";
/// The element by which files of Linesman say what ENI has no word for. Other programs pass it over.
const OWN: &str = "Linesman";

/// A file that was read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Eni {
    /// What the network is called.
    pub name: String,
    /// What follows from the file.
    pub plan: Plan,
    /// Whether the file says how the SubDevices are wired; a single one needs no word of it.
    pub is_wired: bool,
    /// What the file says and the plan leaves out, for people.
    pub notes: Vec<String>,
}

/// The file as it is being read.
#[derive(Default)]
struct EniFile {
    name: String,
    devices: Vec<FileDevice>,
    tasks: Vec<FileTask>,
    image: Option<Element>,
    mailbox_states: Option<u32>,
    /// Cycle time of tasks that have none.
    cycle: Option<Span>,
    notes: Vec<String>,
}

impl Eni {
    /// Whether bytes are such a file, encrypted or not: by their outermost element.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        let head = &bytes[..bytes.len().min(4096)];
        String::from_utf8_lossy(head).replace('\0', "").contains(ROOT)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`EniError`]: what is no XML, no ENI, encrypted, or contradicts itself, with element and line.
    pub fn parse(bytes: &[u8]) -> Result<Self, EniError> {
        Self::parse_with(bytes, None)
    }

    /// Reads a file; tasks without a cycle time, which it need not say, have `cycle`.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_with(bytes: &[u8], cycle: Option<Span>) -> Result<Self, EniError> {
        let text = encoding::decode(bytes)?;
        if is_encrypted(&text) {
            return Err(EniError::Encrypted);
        }
        let mut file = EniFile { cycle, ..EniFile::default() };
        let mut root = None;
        let containers = |path: &[String]| match path {
            [root] => root == ROOT,
            [root, config] => root == ROOT && config == "Config",
            _ => false,
        };
        xml::walk(&text, &containers, &mut |path, element| match path {
            [] => {
                root = Some((element.line, element.name));
                Ok(())
            }
            [_] => Ok(()),
            _ => file.take(element),
        })?;
        if let Some((line, name)) = root {
            return Err(EniError::NoEni { line, root: name });
        }
        if file.devices.is_empty() {
            return Err(EniError::Empty);
        }
        file.resolve()
    }
}

/// Encrypted files have an element of that name right at their begin, or are an XML-Encryption envelope.
fn is_encrypted(text: &str) -> bool {
    let mut end = text.len().min(4096);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let head = &text[..end];
    ["<EncryptedEtherCATConfig", "<EncryptedData", "<EncryptedConfig", "CipherData", "<Encrypted"]
        .iter()
        .any(|mark| head.contains(mark))
}

impl EniFile {
    fn take(&mut self, element: Element) -> Result<(), crate::esi::EsiError> {
        match element.name.as_str() {
            "Master" => {
                self.name = clean(element.at("Info/Name").map_or("", Element::text));
                self.mailbox_states = match element.child("MailboxStates") {
                    Some(states) => states.child_number("StartAddr")?,
                    None => None,
                };
            }
            "Slave" => {
                let number = self.devices.len() + 1;
                let device = sub_device::sub_device(&element, number, &mut self.notes);
                self.devices.push(device.map_err(|error| error.within("Config"))?);
            }
            "Cyclic" => {
                let number = self.tasks.len() + 1;
                let task = cyclic::task(&element, number, self.cycle);
                self.tasks.push(task.map_err(|error| error.within("Config"))?);
            }
            "ProcessImage" => self.image = Some(element),
            _ => {}
        }
        Ok(())
    }

    fn resolve(mut self) -> Result<Eni, EniError> {
        wiring::sort(&mut self.devices)?;
        let tree = wiring::tree(&self.devices)?;
        if tree.order().iter().enumerate().any(|(position, node)| position != *node) {
            self.notes.push(
                "PreviousPort gives another order of processing than AutoIncAddr: the positions are \
                 believed"
                    .to_owned(),
            );
        }
        let mut plan = Plan::empty(tree);
        for (file, id) in self.devices.iter().zip(0..) {
            let mut device = file.plan.clone();
            device.id = linesman_proto::address::DeviceId(id);
            plan.devices.push(device);
        }
        name_apart(&mut plan);
        cyclic::fill_in(&self.devices, &self.tasks, &mut plan)?;
        own::own(&self.tasks, self.mailbox_states, &mut plan)?;
        own::agree(&self.devices, &self.tasks, &plan)?;
        image::variables(&self.devices, self.image.as_ref(), &mut plan)?;
        if self.tasks.is_empty() {
            self.notes
                .push("there is no Cyclic element: nothing is exchanged cyclically".to_owned());
        }
        let is_wired = wiring::is_said(&self.devices);
        Ok(Eni { name: self.name, plan, is_wired, notes: self.notes })
    }
}

/// A name on one line.
fn clean(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Names are unique in a plan: the second of a name gets its number.
fn name_apart(plan: &mut Plan) {
    let mut seen = std::collections::BTreeSet::new();
    for device in &mut plan.devices {
        if device.name.is_empty() {
            device.name = device.id.no().to_string();
        }
        if !seen.insert(device.name.clone()) {
            device.name = format!("{} ({})", device.name, device.id.no());
            seen.insert(device.name.clone());
        }
    }
}

#[cfg(test)]
mod tests;
