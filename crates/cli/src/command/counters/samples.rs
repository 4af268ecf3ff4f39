//! Counters of all SubDevices, read again and again.

use linesman_maindevice::service::Service;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{ClearGroup, ErrorCounter, ErrorCounters, table};
use linesman_proto::time::Span;

use crate::command::service::{ServiceError, ServiceLine};
use crate::failure::Failure;

/// What one SubDevice's counters read at one time.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// When, since the beginning.
    pub(crate) at: Span,
    /// Whose.
    pub(crate) id: DeviceId,
    /// What they read; `None` when it did not answer.
    pub(crate) counters: Option<ErrorCounters>,
}

/// All readings, oldest first.
#[derive(Clone, Default, Debug)]
pub(crate) struct Samples {
    pub(crate) all: Vec<Sample>,
    /// Frames that were sent to try the line out.
    pub(crate) sent: u64,
    /// Frames of those that nobody answered.
    pub(crate) lost: u64,
    /// Whether the counters were cleared at the beginning.
    pub(crate) cleared: bool,
}

impl Samples {
    /// Clears all error counters of all SubDevices.
    pub(crate) fn clear(&mut self, session: &mut ServiceLine) -> Result<(), ServiceError> {
        let ids: Vec<DeviceId> = session.devices().iter().map(|known| known.id).collect();
        for id in ids {
            for group in ClearGroup::ALL {
                let (address, data) = (group.address(), vec![0]);
                match session.ask(id, Service::WriteRegister { address, data }) {
                    // Not every controller has every counter.
                    Ok(_) | Err(ServiceError::Refused(_)) => {}
                    Err(ServiceError::Failed(failure)) if group == ClearGroup::Rx => {
                        return Err(ServiceError::Failed(failure));
                    }
                    Err(ServiceError::Failed(_)) => {}
                }
            }
        }
        self.cleared = true;
        Ok(())
    }

    /// Reads the counters of all SubDevices.
    pub(crate) fn read(&mut self, session: &mut ServiceLine, at: Span) -> Result<(), Failure> {
        let ids: Vec<DeviceId> = session.devices().iter().map(|known| known.id).collect();
        for id in ids {
            let len = ErrorCounters::LEN as u16;
            let data = session.try_read(id, ErrorCounters::START, len)?;
            let counters = data.map(|data| ErrorCounters::from_bytes(&data, ErrorCounters::START));
            // For the diagnosis, which sees the frames: links, and the state with its code.
            for (register, len) in [(table::DL_STATUS, 2), (table::AL_STATUS, 6)] {
                session.try_read(id, register.address, len)?;
            }
            self.all.push(Sample { at, id, counters });
        }
        Ok(())
    }

    /// The latest reading of a SubDevice that answered.
    pub(crate) fn latest(&self, id: DeviceId) -> Option<&ErrorCounters> {
        self.of(id).last()
    }

    /// By how much a counter rose from the first reading to the last, through its overflow-free way.
    pub(crate) fn rise(&self, id: DeviceId, counter: ErrorCounter) -> u64 {
        let values: Vec<u8> = self.of(id).filter_map(|counters| counters.value(counter)).collect();
        let steps = values.windows(2).map(|pair| match pair {
            [before, after] if after >= before => u64::from(after - before),
            // Somebody cleared it in between.
            [_, after] => u64::from(*after),
            _ => 0,
        });
        steps.sum()
    }

    fn of(&self, id: DeviceId) -> impl Iterator<Item = &ErrorCounters> {
        let of = self.all.iter().filter(move |sample| sample.id == id);
        of.filter_map(|sample| sample.counters.as_ref())
    }

    /// All readings as a table for other programs: one row for each counter of each reading.
    pub(crate) fn csv(&self, session: &ServiceLine) -> String {
        let mut text = "time_s,no,name,register,port,counter,value\n".to_owned();
        for sample in &self.all {
            let Some(counters) = &sample.counters else { continue };
            let known = session.known(sample.id);
            let name = known.map_or("", |known| known.name.as_deref().unwrap_or(&known.type_name));
            for (counter, value) in counters.iter() {
                let port = counter.port().map_or_else(String::new, |port| port.to_string());
                let seconds = sample.at.as_nanos() as f64 / 1e9;
                let RegisterAddress(address) = counter.address();
                text.push_str(&format!(
                    "{seconds:.3},{},\"{}\",0x{address:04X},{port},{},{value}\n",
                    sample.id.no(),
                    name.replace('"', "\"\""),
                    counter.name()
                ));
            }
        }
        text
    }
}

/// What one port has counted, for reports.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PortReport {
    /// A to D.
    port: char,
    /// Frames with a wrong check sequence, 0x0300 and on; `null` when the SubDevice did not answer.
    frames: Option<u8>,
    /// Symbols that are none, 0x0301 and on.
    symbols: Option<u8>,
    /// Frames that were marked as bad before, 0x0308 and on; 0 where they are not counted.
    forwarded: Option<u8>,
    /// Lost links, 0x0310 and on.
    lost_links: Option<u8>,
    /// By how much these four rose while they were watched.
    rises: [u64; 4],
}

impl PortReport {
    /// A port's counters.
    pub(crate) fn of(samples: &Samples, id: DeviceId, port: Port) -> Self {
        let kinds = [
            ErrorCounter::InvalidFrame(port),
            ErrorCounter::PhysicalLayer(port),
            ErrorCounter::Forwarded(port),
            ErrorCounter::LostLink(port),
        ];
        let latest = samples.latest(id);
        let [frames, symbols, forwarded, lost_links] =
            kinds.map(|kind| latest.and_then(|counters| counters.value(kind)));
        let rises = kinds.map(|kind| samples.rise(id, kind));
        Self { port: port.letter(), frames, symbols, forwarded, lost_links, rises }
    }

    /// A cell of a table: `4/18 fwd 2 lnk 1 (+5)`; `.` for nothing.
    pub(crate) fn cell(&self) -> String {
        let number =
            |value: Option<u8>| value.map_or_else(|| "--".to_owned(), |one| one.to_string());
        let all = [self.frames, self.symbols, self.forwarded, self.lost_links];
        if all.iter().all(|value| *value == Some(0)) && self.rises.iter().all(|rise| *rise == 0) {
            return ".".to_owned();
        }
        let mut text = format!("{}/{}", number(self.frames), number(self.symbols));
        for (name, value) in [("fwd", self.forwarded), ("lnk", self.lost_links)] {
            if value != Some(0) {
                text.push_str(&format!(" {name} {}", number(value)));
            }
        }
        let rise: u64 = self.rises.iter().sum();
        if rise > 0 {
            text.push_str(&format!(" (+{rise})"));
        }
        text
    }

    /// Whether anything rose.
    pub(crate) fn rose(&self) -> bool {
        self.rises.iter().any(|rise| *rise > 0)
    }
}
