//! Variables of the process image: element `ProcessImage` (ETG.2100).

use linesman_proto::sii::Direction;

use super::clean;
use super::sub_device::{FileDevice, fmmus_of};
use crate::esi::EsiError;
use crate::esi::xml::Element;
use crate::plan::{Plan, Variable};

/// Takes over the variables that are process data of a SubDevice. What the configuring tool keeps beside
/// them in its image (states, counters of its own) is no business of a plan.
pub(super) fn variables(
    devices: &[FileDevice],
    image: Option<&Element>,
    plan: &mut Plan,
) -> Result<(), EsiError> {
    let mut variables = Vec::new();
    for (name, direction) in [("Outputs", Direction::Outputs), ("Inputs", Direction::Inputs)] {
        let list = image.and_then(|image| image.child(name));
        for element in list.into_iter().flat_map(|list| list.children("Variable")) {
            let read = variable(element, direction, devices, plan);
            let within = |error: EsiError| error.within(&format!("Config/ProcessImage/{name}"));
            variables.extend(read.map_err(within)?);
        }
    }
    variables.sort_by_key(|one: &Variable| (one.direction == Direction::Inputs, one.bit_at));
    plan.variables = variables;
    Ok(())
}

fn variable(
    element: &Element,
    direction: Direction,
    devices: &[FileDevice],
    plan: &Plan,
) -> Result<Option<Variable>, EsiError> {
    let at = element.child_number::<u64>("BitOffs")?;
    let bits = element.child_number::<u64>("BitSize")?;
    let (Some(at), Some(bits)) = (at, bits) else { return Ok(None) };
    for (file, device) in devices.iter().zip(&plan.devices) {
        // Each run of bits is that of one FMMU, in their order.
        for (run, fmmu) in file.image(direction).iter().zip(fmmus_of(device, direction)) {
            let Some(within) = at.checked_sub(run.start).filter(|within| *within < run.len) else {
                continue;
            };
            if within + bits > run.len {
                let reason = format!(
                    "bits {at} to {} go beyond the data of \"{}\", which end at bit {}",
                    at + bits,
                    device.name,
                    run.start + run.len
                );
                return Err(element.error(reason));
            }
            let behind = u32::try_from(within).unwrap_or(u32::MAX);
            let bit = behind.saturating_add(u32::from(fmmu.physical_start_bit));
            let found = plan.image_bit(device.id, direction, fmmu.physical_start, bit);
            let whole = clean(element.child_text("Name"));
            let written = clean(&file.plan.name);
            let short = whole.strip_prefix(&written).and_then(|rest| rest.strip_prefix('.'));
            return Ok(found.map(|bit_at| Variable {
                device: device.id,
                direction,
                name: short.unwrap_or(&whole).to_owned(),
                data_type: element.child_text("DataType").to_owned(),
                bit_at,
                bits: usize::try_from(bits).unwrap_or(usize::MAX),
            }));
        }
    }
    Ok(None)
}
