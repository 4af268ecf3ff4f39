//! Description of a device of a project by its maker (ESI).

use super::{Described, ProjectDevice};
use crate::esi::image::image;
use crate::esi::mailbox::InitCommand;
use crate::esi::{Esi, EsiDevice, EsiModule, EsiPdo};
use crate::profile::{DeviceProfile, SyncTimes};
use crate::start_up::{StartUpAction, StartUpCommand, Transition, left_out};
use linesman_proto::mailbox::coe::ObjectAddress;

impl Described {
    /// The device with the modules that the project puts into its slots, else those of the description.
    ///
    /// # Errors
    /// A module that does not fit, or a description that no SII has room for, in words.
    pub fn from_esi(esi: &Esi, device: &EsiDevice, wanted: &ProjectDevice) -> Result<Self, String> {
        let mut pdos: Vec<EsiPdo> = device.pdos.clone();
        let (mut start_up, mut notes) = (Vec::new(), Vec::new());
        if let Some(mailbox) = &device.mailbox {
            start_up.extend(commands(&mailbox.commands));
            start_up.extend(mailbox.settings.iter().cloned());
            notes.extend(
                mailbox
                    .left_out
                    .iter()
                    .map(|(protocol, count)| left_out(&wanted.name, protocol, *count, &[])),
            );
        }
        let mut idents = Vec::new();
        let given = wanted.modules.len();
        let slots = device.slots.clone().unwrap_or_default();
        if given > slots.slots.len() {
            let has = slots.slots.len();
            return Err(format!("modules: {given} are listed, the device has {has} slots"));
        }
        for place in 0..slots.slots.len() {
            let module = module(esi, &slots.slots[place], wanted.modules.get(place), place, given)?;
            idents.push(module.map_or(0, |module| module.ident));
            let Some(module) = module else { continue };
            pdos.extend(module.pdos_in(&slots, place as u16));
            start_up.extend(commands(&module.commands));
        }
        while idents.last() == Some(&0) {
            idents.pop();
        }
        let made = image(device, esi.vendor_id, &pdos).map_err(|error| error.to_string())?;
        let identity = Some([esi.vendor_id, device.product_code, device.revision]);
        let mut profile = DeviceProfile::from_sii(&made);
        profile.sync_times = SyncTimes::from_dictionary(&device.objects);
        // What an SII has no room for.
        for (mode, described) in profile.clock_modes.iter_mut().zip(&device.op_modes) {
            mode.input_reference = Some(described.input_reference);
        }
        Ok(Self {
            profile,
            start_up,
            modules: idents,
            identity,
            revision_rule: device.revision_rule,
            frame_repeat: device.frame_repeat,
            notes,
        })
    }
}

fn module<'a>(
    esi: &'a Esi,
    slot: &crate::esi::module::EsiSlot,
    wanted: Option<&String>,
    place: usize,
    given: usize,
) -> Result<Option<&'a EsiModule>, String> {
    let name = match wanted.map(String::as_str) {
        Some("") => None,
        Some(name) => Some(name),
        // With no list at all the description's own choice holds.
        None if given == 0 => return Ok(slot.default.and_then(|ident| esi.module(ident))),
        None => None,
    };
    let Some(name) = name else {
        return match slot.required && given > 0 {
            true => Err(format!("modules: slot {} cannot stay empty", place + 1)),
            false => Ok(None),
        };
    };
    let fits = |module: &&EsiModule| slot.idents.contains(&module.ident) && module.is_called(name);
    let found = esi.modules.iter().flatten().find(fits);
    found.map(Some).ok_or_else(|| {
        let fitting = slot.idents.iter().filter_map(|ident| esi.module(*ident));
        let fitting: Vec<_> = fitting.map(|module| format!("`{}`", module.type_name)).collect();
        let fitting = fitting.join(", ");
        format!("modules: `{name}` does not fit into slot {}; what fits: {fitting}", place + 1)
    })
}

fn commands(commands: &[InitCommand]) -> impl Iterator<Item = StartUpCommand> {
    commands.iter().flat_map(|command| {
        let transitions = command.transitions.iter();
        transitions.filter_map(|letters| Transition::from_letters(letters)).map(|transition| {
            StartUpCommand {
                transition,
                action: StartUpAction::CoeDownload {
                    object: ObjectAddress::new(command.index, command.subindex),
                    complete_access: command.complete_access,
                    data: command.data.clone(),
                },
                comment: String::new(),
            }
        })
    })
}
