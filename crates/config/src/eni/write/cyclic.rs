//! Elements `Cyclic` and `ProcessImage`.

use std::ops::Range;

use linesman_proto::address::DeviceId;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::FmmuConfig;
use linesman_proto::sii::Direction;

use crate::eni::OWN;
use crate::eni::sub_device::fmmus_of;
use crate::plan::{DatagramPlan, DevicePlan, IoAt, PathView, Plan, Presence, Role, expect};
use crate::xml_writer::Xml;

/// Where the data of each datagram lie in the file's process image: one behind the other.
pub(super) struct Image {
    /// Logical address and first byte of each logical datagram.
    logical: Vec<(Range<u64>, usize, Vec<(DeviceId, Direction)>)>,
    /// First byte of every datagram.
    starts: Vec<usize>,
    len: usize,
}

impl Image {
    pub(super) fn of(plan: &Plan) -> Self {
        let mut image = Self { logical: Vec::new(), starts: Vec::new(), len: 0 };
        for (.., datagram) in plan.datagrams() {
            if let DatagramAddress::Logical(start) = datagram.address {
                let start = u64::from(start.0);
                let mut owners: Vec<_> =
                    datagram.ownership.iter().map(|one| (one.device, one.direction)).collect();
                owners.sort_unstable();
                owners.dedup();
                let range = start..start + datagram.len as u64;
                image.logical.push((range, image.len, owners));
            }
            image.starts.push(image.len);
            image.len += datagram.len;
        }
        image
    }

    /// The bits of an FMMU in the file's process image.
    fn bits(
        &self,
        device: DeviceId,
        direction: Direction,
        fmmu: &FmmuConfig,
    ) -> Option<Range<u64>> {
        let at = u64::from(fmmu.logical_start.0);
        let (range, byte, _) = self.logical.iter().find(|(range, _, owners)| {
            range.contains(&at) && owners.binary_search(&(device, direction)).is_ok()
        })?;
        let first = (*byte as u64 + at - range.start) * 8 + u64::from(fmmu.logical_start_bit);
        Some(first..first + u64::from(fmmu.bit_len()))
    }

    /// The runs of a SubDevice, one for each of its FMMUs.
    pub(super) fn runs(&self, device: &DevicePlan, direction: Direction) -> Vec<Bits> {
        let runs = fmmus_of(device, direction);
        runs.filter_map(|fmmu| self.bits(device.id, direction, fmmu))
            .map(|range| Bits { start: range.start, end: range.end })
            .collect()
    }
}

/// A run of bits.
pub(super) struct Bits {
    pub(super) start: u64,
    end: u64,
}

impl Bits {
    pub(super) fn len(&self) -> u64 {
        self.end - self.start
    }
}

pub(super) fn write(xml: &mut Xml, plan: &Plan, image: &Image) {
    let mut starts = image.starts.iter();
    let present = Presence::full(plan.devices.len());
    for (task, number) in plan.tasks.iter().zip(1_u32..) {
        xml.element("Cyclic", &[], |xml| {
            xml.text("Comment", format!("synchronized with task '{}'", task.name));
            xml.text("CycleTime", task.cycle.as_nanos() / 1_000);
            xml.text("TaskId", number);
            if task.io_at == IoAt::TaskEnd {
                xml.empty(OWN, &[("io-at", "task-end".to_owned())]);
            }
            for frame in &task.frames {
                xml.element("Frame", &[], |xml| {
                    for datagram in &frame.datagrams {
                        let start = starts.next().copied().unwrap_or(0);
                        let unit = datagram.sync_unit.and_then(|unit| task.sync_units.get(unit));
                        let unit = unit.map(|unit| unit.name.clone());
                        write_datagram(xml, datagram, start, &present, unit);
                    }
                    if frame.ahead.as_nanos() > 0 || frame.repeats > 0 {
                        xml.empty(
                            OWN,
                            &[
                                ("ahead-ns", frame.ahead.as_nanos().to_string()),
                                ("repeats", frame.repeats.to_string()),
                            ],
                        );
                    }
                });
            }
        });
    }
}

fn write_datagram(
    xml: &mut Xml,
    datagram: &DatagramPlan,
    start: usize,
    present: &Presence,
    unit: Option<String>,
) {
    let states: &[&str] = match datagram.role {
        Role::ProcessData => &["SAFEOP", "OP"],
        Role::Presence
        | Role::LatchedTime
        | Role::ReferenceClock
        | Role::ClockShift
        | Role::MailboxStates
        | Role::Other => &["PREOP", "SAFEOP", "OP"],
    };
    xml.element("Cmd", &[], |xml| {
        for state in states {
            xml.text("State", state);
        }
        xml.text("Comment", "cyclic cmd");
        xml.text("Cmd", datagram.command.code());
        match datagram.address {
            DatagramAddress::Logical(address) => xml.text("Addr", address.0),
            DatagramAddress::Physical(address, register) => {
                xml.text("Adp", address);
                xml.text("Ado", register.0);
            }
        }
        xml.text("DataLength", datagram.len);
        if datagram.role.is_judged() {
            xml.text("Cnt", expect::expect(datagram, present, PathView::Merged).0);
        }
        xml.text("InputOffs", start);
        xml.text("OutputOffs", start);
        if let Some(unit) = unit {
            xml.empty(OWN, &[("sync-unit", unit)]);
        }
    });
}

pub(super) fn write_image(xml: &mut Xml, plan: &Plan, image: &Image) {
    xml.element("ProcessImage", &[], |xml| {
        for (name, direction) in [("Inputs", Direction::Inputs), ("Outputs", Direction::Outputs)] {
            xml.element(name, &[], |xml| {
                xml.text("ByteSize", image.len);
                for variable in plan.variables.iter().filter(|one| one.direction == direction) {
                    let Some(device) = plan.device(variable.device) else { continue };
                    let Some(at) = place(plan, image, device, direction, variable.bit_at) else {
                        continue;
                    };
                    xml.element("Variable", &[], |xml| {
                        xml.text("Name", format!("{}.{}", device.name, variable.name));
                        xml.text("DataType", &variable.data_type);
                        xml.text("BitSize", variable.bits);
                        xml.text("BitOffs", at);
                    });
                }
            });
        }
    });
}

/// The bit of the file's process image that is bit `at` of the plan's.
fn place(
    plan: &Plan,
    image: &Image,
    device: &DevicePlan,
    direction: Direction,
    at: usize,
) -> Option<u64> {
    fmmus_of(device, direction).find_map(|fmmu| {
        let first = u32::from(fmmu.physical_start_bit);
        let begins = plan.image_bit(device.id, direction, fmmu.physical_start, first)?;
        let within = at.checked_sub(begins)? as u64;
        let bits = image.bits(device.id, direction, fmmu)?;
        (within < bits.end - bits.start).then_some(bits.start + within)
    })
}
