//! Cyclic frames: elements `Cyclic` (ETG.2100).

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::frame::MAX_DATAGRAM_DATA;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::frame_size;
use linesman_proto::register::{FmmuConfig, SYSTEM_TIME};
use linesman_proto::sii::Direction;
use linesman_proto::time::Span;

use super::sub_device::{FileDevice, ImageBits};
use super::{OWN, clean};
use crate::esi::EsiError;
use crate::esi::value;
use crate::esi::xml::Element;
use crate::plan::{IoAt, Plan};

/// A task as the file has it.
pub(super) struct FileTask {
    pub(super) name: String,
    pub(super) cycle: Span,
    pub(super) io_at: IoAt,
    pub(super) frames: Vec<FileFrame>,
}

/// A frame as the file has it.
#[derive(Default)]
pub(super) struct FileFrame {
    pub(super) ahead: Span,
    pub(super) repeats: u8,
    pub(super) datagrams: Vec<FileDatagram>,
}

/// A datagram as the file has it.
pub(super) struct FileDatagram {
    pub(super) line: u32,
    pub(super) command: Command,
    pub(super) address: DatagramAddress,
    pub(super) len: usize,
    /// The working counter that the file expects.
    pub(super) expected: Option<u16>,
    /// Where its inputs and outputs lie in the file's process image, in bytes.
    pub(super) image: Option<u64>,
    pub(super) comment: String,
    /// Name of its sync unit, in files of Linesman.
    pub(super) sync_unit: Option<String>,
}

impl FileDatagram {
    /// The logical addresses it covers.
    pub(super) fn logical(&self) -> Option<std::ops::Range<u64>> {
        match self.address {
            DatagramAddress::Logical(start) => {
                Some(u64::from(start.0)..u64::from(start.0) + self.len as u64)
            }
            DatagramAddress::Physical(..) => None,
        }
    }

    /// Whether it serves a direction.
    pub(super) fn serves(&self, direction: Direction) -> bool {
        match direction {
            Direction::Outputs => matches!(self.command, Command::Lwr | Command::Lrw),
            Direction::Inputs => matches!(self.command, Command::Lrd | Command::Lrw),
        }
    }

    /// Whether it is about the system time.
    pub(super) fn is_time(&self) -> bool {
        matches!(self.address, DatagramAddress::Physical(_, at) if at == SYSTEM_TIME.address)
    }

    pub(super) fn error(&self, reason: impl Into<String>) -> EsiError {
        let element =
            format!("Config/Cyclic/Frame/Cmd {} \"{}\"", self.command.name(), self.comment);
        EsiError::new(self.line, &element, reason)
    }
}

/// The task of an element; `number` counts from 1. One without a cycle time has `otherwise`.
pub(super) fn task(
    element: &Element,
    number: usize,
    otherwise: Option<Span>,
) -> Result<FileTask, EsiError> {
    let comment = clean(element.child_text("Comment"));
    // "synchronized with task 'NC-Task 1 SAF'"
    let mut quoted = comment.split('\'');
    let name = match (quoted.next(), quoted.next()) {
        (Some(_), Some(name)) if !name.is_empty() => name.to_owned(),
        _ => format!("Task {number}"),
    };
    let cycle = element.child_number::<u32>("CycleTime").map_err(|one| one.within("Cyclic"))?;
    let cycle = cycle.filter(|us| *us > 0).map(|us| Span::us(u64::from(us)));
    let missing = || {
        element.error(
            "it has no CycleTime, expected one in µs above 0. Do: say it, `--cycle-us 1000`, or export \
             the file again",
        )
    };
    let cycle = cycle.or(otherwise).ok_or_else(missing)?;
    let frames = element.children("Frame").map(frame).collect::<Result<_, _>>();
    let own = element.child(OWN);
    let at_end = own.is_some_and(|own| own.attribute("io-at") == Some("task-end"));
    Ok(FileTask {
        name,
        cycle,
        io_at: if at_end { IoAt::TaskEnd } else { IoAt::TaskBegin },
        frames: frames.map_err(|error| error.within("Cyclic"))?,
    })
}

fn frame(element: &Element) -> Result<FileFrame, EsiError> {
    let mut frame = FileFrame::default();
    if let Some(own) = element.child(OWN) {
        frame.ahead = Span::ns(own.attribute_number("ahead-ns")?.unwrap_or(0));
        frame.repeats = own.attribute_number("repeats")?.unwrap_or(0);
    }
    for command in element.children("Cmd") {
        frame.datagrams.push(datagram(command).map_err(|error| error.within("Frame"))?);
    }
    let size = frame_size(frame.datagrams.iter().map(|datagram| datagram.len));
    if size > MAX_LEN {
        let reason =
            format!("its datagrams make {size} bytes, an Ethernet frame has at most {MAX_LEN}");
        return Err(element.error(reason));
    }
    Ok(frame)
}

fn datagram(element: &Element) -> Result<FileDatagram, EsiError> {
    let code: u8 = element.child_number("Cmd")?.ok_or_else(|| element.error("it has no Cmd"))?;
    let command = Command::from_code(code)
        .ok_or_else(|| element.error(format!("Cmd {code}, expected a command, 0 to 14")))?;
    let needed = |name: &str| element.error(format!("{} has no {name}", command.name()));
    let address = if command.addressing() == Addressing::Logical {
        let start = element.child_number("Addr")?.ok_or_else(|| needed("Addr"))?;
        DatagramAddress::Logical(LogicalAddress(start))
    } else {
        let register = element.child_number("Ado")?.unwrap_or(0);
        DatagramAddress::Physical(
            element.child_number("Adp")?.unwrap_or(0),
            RegisterAddress(register),
        )
    };
    let len: Option<usize> = element.child_number("DataLength")?;
    let data =
        element.child("Data").map(|data| value::bytes(data.text()).map_err(|one| data.error(one)));
    let len = match (len, data.transpose()?) {
        (Some(len), _) => len,
        (None, Some(data)) => data.len(),
        (None, None) => return Err(needed("DataLength")),
    };
    if len > MAX_DATAGRAM_DATA {
        let reason = format!("{len} bytes, a datagram carries at most {MAX_DATAGRAM_DATA}");
        return Err(element.error(reason));
    }
    let offset = |name: &str| element.child_number::<u64>(name);
    Ok(FileDatagram {
        line: element.line,
        command,
        address,
        len,
        expected: element.child_number("Cnt")?,
        image: offset("InputOffs")?.or(offset("OutputOffs")?),
        comment: clean(element.child_text("Comment")),
        sync_unit: element.child(OWN).and_then(|own| own.attribute("sync-unit")).map(str::to_owned),
    })
}

/// Some tools write datagram headers into the process image, others the data only.
const HEADERS: [u64; 2] = [0, 10];

/// FMMUs of SubDevices whose commands set none, from where their data lie in the process image.
pub(super) fn fill_in(
    devices: &[FileDevice],
    tasks: &[FileTask],
    plan: &mut Plan,
) -> Result<(), EsiError> {
    let datagrams: Vec<&FileDatagram> =
        tasks.iter().flat_map(|task| &task.frames).flat_map(|frame| &frame.datagrams).collect();
    for (file, device) in devices.iter().zip(&mut plan.devices) {
        if !device.fmmus.is_empty() {
            continue;
        }
        for direction in [Direction::Outputs, Direction::Inputs] {
            let managers: Vec<_> = device
                .sync_managers
                .iter()
                .filter(|(_, manager)| {
                    use linesman_proto::register::SmDirection;
                    match manager.control.direction() {
                        SmDirection::MainDeviceWrites => direction == Direction::Outputs,
                        SmDirection::MainDeviceReads => direction == Direction::Inputs,
                        SmDirection::Reserved(_) => false,
                    }
                })
                .map(|(_, manager)| *manager)
                .collect();
            for (run, manager) in file.image(direction).iter().zip(managers) {
                let Some(logical) = logical_of(*run, direction, &datagrams) else {
                    let reason = format!(
                        "bit {} of the process image is in no cyclic datagram of its direction",
                        run.start
                    );
                    return Err(file.error("ProcessData", run.line, reason));
                };
                let len = u16::try_from(run.len.div_ceil(8)).unwrap_or(u16::MAX);
                let fmmu = match direction {
                    Direction::Outputs => FmmuConfig::outputs(logical, len, manager.start),
                    Direction::Inputs => FmmuConfig::inputs(logical, len, manager.start),
                };
                device.fmmus.push((device.fmmus.len() as u8, fmmu));
            }
        }
    }
    Ok(())
}

/// The logical address of a run of whole bytes in the process image.
fn logical_of(
    run: ImageBits,
    direction: Direction,
    datagrams: &[&FileDatagram],
) -> Option<LogicalAddress> {
    let byte = run.start / 8;
    HEADERS.into_iter().find_map(|header| {
        datagrams.iter().filter(|one| one.serves(direction)).find_map(|datagram| {
            let range = datagram.logical()?;
            let within = byte.checked_sub(datagram.image? + header)?;
            let fits = within + run.len.div_ceil(8) <= range.end - range.start;
            fits.then(|| u32::try_from(range.start + within).ok().map(LogicalAddress)).flatten()
        })
    })
}
