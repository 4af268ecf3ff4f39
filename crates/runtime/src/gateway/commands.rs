//! Objects of the MainDevice that are written: the command that detects SubDevices (0xF002), and the one that lets counts
//! begin at 0 (0xF200).
//!
//! Reference: ETG.1510; facts 2.1 and PyETG1510 for their entries, ETG.1020 (command objects) for the status. What is
//! there is known all the time, by the frames of the cycle: a detection reads nothing anew, and is done at once. Counts
//! begin at 0 for the clients of the gateway only; those of the MainDevice go on.

use linesman_proto::mailbox::coe::information::Access;
use linesman_proto::mailbox::coe::{DataType, ObjectIndex};
use linesman_sim::device::dictionary::{Dictionary, Entry, Object, READ_ONLY, READ_WRITE};

use super::objects::record;
use crate::online::report::{OnlineDevice, OnlineReport};

const DETECT: u16 = 0xF002;
const CONTROL: u16 = 0xF200;
/// Entry of [`CONTROL`]: counts begin at 0.
const RESET: u8 = 16;
/// Bytes of a command.
const REQUEST_LEN: usize = 2;
/// Bytes of what comes of it: the status, an unused byte, the number of SubDevices that are there.
const RESPONSE_LEN: usize = 6;
/// Status of a command: done without an error, and there is a response.
const DONE: u8 = 1;

/// Objects that clients have written, with the result. It is the same for all clients, as in any object dictionary.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct ObjectCommands {
    /// The last command; none was given before the first.
    request: Option<[u8; REQUEST_LEN]>,
    response: [u8; RESPONSE_LEN],
    /// Counts of the line when they were last told to begin at 0.
    base: Option<CountBase>,
}

/// Counts as they were.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
struct CountBase {
    cyclic_lost: u64,
    queued_lost: u64,
    devices: Vec<DeviceBase>,
}

#[derive(Clone, PartialEq, Eq, Debug, Default)]
struct DeviceBase {
    no: u32,
    invalid_frames: Vec<u64>,
    absences: u64,
    abnormal_changes: u64,
}

impl ObjectCommands {
    /// Does what a client has written, if it has; the line is as this report says.
    pub(super) fn follow(&mut self, dictionary: &mut Dictionary, report: &OnlineReport) -> bool {
        let Some(written) = dictionary.take_written() else { return false };
        let entry = |index, subindex| {
            dictionary.object(ObjectIndex(index)).and_then(|object| object.entry(subindex))
        };
        match written.index.0 {
            DETECT => {
                let request = entry(DETECT, 1).and_then(|entry| entry.value.first_chunk());
                self.request = request.copied();
                self.response = [DONE, 0, 0, 0, 0, 0];
                let [low, high, ..] = report.present.to_le_bytes();
                (self.response[2], self.response[3]) = (low, high);
            }
            CONTROL if entry(CONTROL, RESET).is_some_and(|entry| entry.as_number() != 0) => {
                self.base = Some(CountBase::of(report));
            }
            _ => {}
        }
        true
    }

    /// The line with counts as the clients of the gateway see them.
    pub(super) fn counted_from_base(&self, mut report: OnlineReport) -> OnlineReport {
        let Some(base) = &self.base else { return report };
        // Counts of the MainDevice may have been cleared since: they begin at 0 by themselves then.
        let since = |count: &mut u64, base: u64| *count = count.checked_sub(base).unwrap_or(*count);
        since(&mut report.cyclic.lost, base.cyclic_lost);
        since(&mut report.queued.lost, base.queued_lost);
        for device in &mut report.devices {
            let Some(base) = base.devices.iter().find(|base| base.no == device.no) else {
                continue;
            };
            for (port, base) in device.ports.iter_mut().zip(&base.invalid_frames) {
                port.invalid_frames.iter_mut().for_each(|count| since(&mut count.total, *base));
            }
            since(&mut device.presence_changes, base.absences);
            since(&mut device.abnormal_changes, base.abnormal_changes);
        }
        report
    }

    /// The objects, as they are read now.
    pub(super) fn objects(&self) -> [Object; 2] {
        let number = |subindex, name, access: Access, value: u8| {
            Entry::number(subindex, name, DataType::USINT, 8, access, value.into())
        };
        let status = if self.request.is_some() { DONE } else { 0 };
        let request = self.request.unwrap_or_default();
        [
            record(
                DETECT,
                "Detect modules command",
                vec![
                    bytes(1, "Scan command request", READ_WRITE, &request),
                    number(2, "Scan command status", READ_ONLY, status),
                    bytes(3, "Scan command response", READ_ONLY, &self.response),
                ],
            ),
            record(
                CONTROL,
                "Diagnosis interface control",
                vec![Entry {
                    data_type: DataType::BOOL,
                    ..number(RESET, "Reset diagnosis info", READ_WRITE, 0)
                }],
            ),
        ]
    }
}

impl CountBase {
    fn of(report: &OnlineReport) -> Self {
        Self {
            cyclic_lost: report.cyclic.lost,
            queued_lost: report.queued.lost,
            devices: report.devices.iter().map(DeviceBase::of).collect(),
        }
    }
}

impl DeviceBase {
    fn of(device: &OnlineDevice) -> Self {
        let invalid = device.ports.iter().map(|port| port.invalid_frames);
        Self {
            no: device.no,
            invalid_frames: invalid.map(|count| count.map_or(0, |count| count.total)).collect(),
            // Being there counts as a change, too: the first one stays.
            absences: device.presence_changes.saturating_sub(1),
            abnormal_changes: device.abnormal_changes,
        }
    }
}

fn bytes(subindex: u8, name: &str, access: Access, value: &[u8]) -> Entry {
    let bits = u16::try_from(value.len() * 8).unwrap_or(u16::MAX);
    Entry {
        subindex,
        data_type: DataType::OCTET_STRING,
        bits,
        access,
        value: value.to_vec(),
        ..Entry::text(name, "")
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::abort_code::SdoAbortCode;
    use linesman_proto::mailbox::coe::ObjectAddress;
    use linesman_proto::state::AlState;

    use super::*;
    use crate::gateway::objects::dictionary;
    use crate::online::report::{Count, OnlinePort};

    fn report(lost: u64, invalid: u64) -> OnlineReport {
        let count = Some(Count { register: 0, total: invalid });
        let port = OnlinePort { invalid_frames: count, ..OnlinePort::default() };
        let device = |no| OnlineDevice {
            no,
            ports: vec![port.clone()],
            presence_changes: 1 + invalid,
            abnormal_changes: invalid,
            ..OnlineDevice::default()
        };
        let mut report = OnlineReport { present: 0x0203, ..OnlineReport::default() };
        report.devices = vec![device(1), device(2)];
        report.cyclic.lost = lost;
        report
    }

    fn read(dictionary: &Dictionary, index: u16, subindex: u8) -> Vec<u8> {
        dictionary.upload(ObjectAddress::new(index, subindex), AlState::Op).unwrap()
    }

    #[test]
    fn detection_is_done_at_once_and_tells_how_many_are_there() {
        let mut commands = ObjectCommands::default();
        let mut objects = dictionary(&report(0, 0), &commands);
        assert_eq!(read(&objects, DETECT, 2), [0], "no command was given");
        // As PyETG1510 has the object: 2 bytes, 1 byte, 6 bytes.
        let whole = objects.upload_all(ObjectAddress::new(DETECT, 0), AlState::Op).unwrap();
        assert_eq!(whole.len(), 2 + 2 + 1 + 6);
        objects.download(ObjectAddress::new(DETECT, 1), &[1, 0], AlState::Op).unwrap();
        assert!(commands.follow(&mut objects, &report(0, 0)));
        assert!(!commands.follow(&mut objects, &report(0, 0)), "once");
        let objects = dictionary(&report(0, 0), &commands);
        assert_eq!(read(&objects, DETECT, 1), [1, 0]);
        assert_eq!(read(&objects, DETECT, 2), [DONE]);
        assert_eq!(read(&objects, DETECT, 3), [DONE, 0, 0x03, 0x02, 0, 0]);
    }

    #[test]
    fn counts_begin_at_0_and_nothing_else_can_be_written() {
        let mut commands = ObjectCommands::default();
        let now = report(7, 300);
        let mut objects = dictionary(&now, &commands);
        assert_eq!(read(&objects, 0xA000, 10), 300_u32.to_le_bytes());
        objects.download(ObjectAddress::new(CONTROL, RESET), &[0], AlState::Op).unwrap();
        commands.follow(&mut objects, &now);
        let objects_after = |commands: &ObjectCommands, report| {
            dictionary(&commands.counted_from_base(report), commands)
        };
        let objects = objects_after(&commands, report(7, 300));
        assert_eq!(read(&objects, 0xA000, 10), 300_u32.to_le_bytes(), "0 resets nothing");
        let mut objects = objects_after(&commands, report(7, 300));
        objects.download(ObjectAddress::new(CONTROL, RESET), &[1], AlState::Op).unwrap();
        commands.follow(&mut objects, &now);
        let objects = objects_after(&commands, report(9, 305));
        assert_eq!(read(&objects, 0xF120, 1), 2_u32.to_le_bytes());
        assert_eq!(read(&objects, 0xA001, 10), 5_u32.to_le_bytes());
        assert_eq!(read(&objects, 0xA001, 15), 5_u32.to_le_bytes());
        assert_eq!(read(&objects, 0xA001, 16), 5_u32.to_le_bytes());
        assert_eq!(read(&objects, CONTROL, RESET), [0], "it is a command, not a setting");
        // The MainDevice's own counts were cleared meanwhile.
        let mut objects = objects_after(&commands, report(1, 2));
        assert_eq!(read(&objects, 0xA001, 10), 2_u32.to_le_bytes());
        for (index, subindex) in [(0xF120, 1), (0xF020, 0), (0x8000, 1), (0x1C00, 1), (DETECT, 3)] {
            let object = ObjectAddress::new(index, subindex);
            let refused = objects.download(object, &[1, 0, 0, 0], AlState::Op);
            assert_eq!(refused, Err(SdoAbortCode::READ_ONLY), "{object}");
        }
    }
}
