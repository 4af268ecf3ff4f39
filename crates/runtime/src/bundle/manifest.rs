//! Manifest of a bundle: what it holds, what set it off, and what is not in it.

use linesman_config::plan::{PlannedCounter, PlannedExchange};
use linesman_diagnosis::InputKind;
use linesman_diagnosis::report::{Diagnosis, FindingReport, Number, PlaceReport, Severity};
use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::command::Command;
use linesman_proto::register::FmmuConfig;
use serde::{Deserialize, Serialize};

/// The schema of a manifest.
pub const SCHEMA: &str = "linesman.bundle/1";

/// `manifest.json` of a bundle.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `linesman.bundle/1`.
    pub schema: String,
    /// Name and version of the program that has written it.
    pub tool: String,
    /// Where the frames were seen.
    pub source: String,
    /// When the run began, RFC 3339; `null` in virtual time.
    pub start: Option<String>,
    /// The same in ns since 1970: times of the run are those of `frames.pcapng` less this.
    pub start_unix_ns: Number,
    /// The clock behind the times.
    pub clock: String,
    /// The end of the bundle, in ns since the start of the run: up to here the diagnosis had seen all that it judged.
    pub end_ns: Number,
    /// Whether the run had ended then.
    pub has_ended: bool,
    /// How evidence came in.
    pub input: InputKind,
    /// Whether counters of the host's cards were reported.
    pub host_counters: bool,
    /// Whether the diagnosis could have registers read.
    pub probes: bool,
    /// Whether it could have written what restores itself.
    pub active: bool,
    /// The findings for which the bundle was written.
    pub triggers: Vec<Trigger>,
    /// Errors and warnings of the diagnosis when it was written: the diagnosis of the bundle is held against them.
    pub findings: Vec<BundleFinding>,
    /// The stretches of the run that `frames.pcapng` holds, in order.
    pub stretches: Vec<FrameStretch>,
    /// What is not in the bundle though the diagnosis has seen it, in words.
    pub left_out: Vec<String>,
    /// The working counters and FMMUs that were planned.
    #[serde(default)]
    pub exchange: BundleExchange,
    /// What was replaced; `null` where nothing was.
    #[serde(default)]
    pub anonymised: Option<Anonymised>,
}

/// A finding for which a bundle was written.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Trigger {
    /// Its id in the diagnosis.
    pub id: String,
    /// Its code, place and cause.
    pub finding: BundleFinding,
    /// When it was certain, in ns since the start of the run.
    pub at_ns: Number,
}

/// A finding by what must be the same when it is found again.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BundleFinding {
    /// The code of its rule.
    pub code: String,
    /// Where.
    pub place: PlaceReport,
    /// Why: a fault name.
    pub cause: String,
}

impl BundleFinding {
    /// Of a finding.
    #[must_use]
    pub fn of(finding: &FindingReport) -> Self {
        let (code, place) = (finding.code.clone(), finding.place.clone());
        Self { code, place, cause: finding.cause.to_string() }
    }
}

/// A stretch of a run.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FrameStretch {
    /// The time of its first frame, in ns since the start of the run.
    pub from_ns: Number,
    /// That of its last frame.
    pub to_ns: Number,
    /// Its frames.
    pub frames: Number,
    /// Frames before it that are not in the bundle.
    pub left_out_before: Number,
}

/// Process data that were planned.
#[derive(Clone, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BundleExchange {
    /// The logical datagrams.
    pub datagrams: Vec<PlannedDatagram>,
    /// The FMMUs.
    pub fmmus: Vec<PlannedFmmu>,
}

/// A logical datagram of the plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PlannedDatagram {
    /// The number of its command: 10 LRD, 11 LWR, 12 LRW.
    pub command: u8,
    /// Its first logical address.
    pub start: u32,
    /// Its length in bytes.
    pub len: u16,
    /// The working counter while all SubDevices are in OP.
    pub working_counter: u16,
}

/// An FMMU of the plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PlannedFmmu {
    /// The SubDevice, from 1.
    pub no: u32,
    /// The FMMU in it, from 0.
    pub fmmu: u8,
    /// Its registers, 0x0600 to 0x060F.
    pub registers: [u8; FmmuConfig::LEN],
}

impl BundleExchange {
    /// Of what an engine was told.
    #[must_use]
    pub fn of(planned: &PlannedExchange) -> Self {
        let datagrams = planned.counters.iter().map(|counter| PlannedDatagram {
            command: counter.command.code(),
            start: counter.start.0,
            len: counter.len,
            working_counter: counter.working_counter,
        });
        let fmmus = planned.fmmus.iter().map(|(device, fmmu, config)| PlannedFmmu {
            no: device.no(),
            fmmu: *fmmu,
            registers: config.to_bytes(),
        });
        Self { datagrams: datagrams.collect(), fmmus: fmmus.collect() }
    }

    /// What an engine is told. What is no command or no SubDevice is left out.
    #[must_use]
    pub fn planned(&self) -> PlannedExchange {
        let counters = self.datagrams.iter().filter_map(|one| {
            let command = Command::from_code(one.command)?;
            let (start, len) = (LogicalAddress(one.start), one.len);
            Some(PlannedCounter { command, start, len, working_counter: one.working_counter })
        });
        let fmmus = self.fmmus.iter().filter_map(|one| {
            Some((DeviceId::from_no(one.no)?, one.fmmu, FmmuConfig::from_bytes(one.registers)))
        });
        PlannedExchange { counters: counters.collect(), fmmus: fmmus.collect() }
    }
}

/// Counts of what was replaced.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Anonymised {
    /// Names in the project.
    pub names: Number,
    /// Different serial numbers.
    pub serial_numbers: Number,
    /// Different addresses of network cards.
    pub mac_addresses: Number,
    /// Datagrams whose process data became zeros.
    pub process_data: Number,
    /// Mailbox messages whose contents became zeros: parameters, files, Ethernet over EtherCAT.
    pub mailbox_messages: Number,
    /// Frames without EtherCAT whose contents became zeros.
    pub foreign_frames: Number,
}

/// Errors and warnings of a diagnosis, consequences too.
#[must_use]
pub fn findings(diagnosis: &Diagnosis) -> Vec<BundleFinding> {
    fn add(found: &[FindingReport], all: &mut Vec<BundleFinding>) {
        for finding in found {
            if finding.severity > Severity::Info {
                all.push(BundleFinding::of(finding));
            }
            add(&finding.consequences, all);
        }
    }
    let mut all = Vec::new();
    add(&diagnosis.findings, &mut all);
    all
}

/// Findings that are in one list alone: of the first, then of the second.
#[must_use]
pub fn differences<'a>(
    first: &'a [BundleFinding],
    second: &'a [BundleFinding],
) -> (Vec<&'a BundleFinding>, Vec<&'a BundleFinding>) {
    let mut rest: Vec<&BundleFinding> = second.iter().collect();
    let mut missing = Vec::new();
    for finding in first {
        match rest.iter().position(|other| *other == finding) {
            Some(at) => {
                rest.remove(at);
            }
            None => missing.push(finding),
        }
    }
    (missing, rest)
}
