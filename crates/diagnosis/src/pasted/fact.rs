//! Facts that a block of text tells.

use linesman_proto::port::{Port, PortMap};

use super::stamp::Stamp;
use crate::main_device::MainDeviceKind;
use crate::observation_file::{ObservedMainDevice, ObservedWorkingCounter, ReadDevice};

/// A stretch of lines of one format.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Which format, for telling several of the same apart.
    pub(super) format: Format,
    /// What it is, in words.
    pub(super) what: String,
    /// How many lines it takes.
    pub(super) lines: usize,
    /// Numbers of lines among them that were not understood.
    pub(super) unused: Vec<usize>,
    /// What it tells.
    pub(super) facts: Vec<Fact>,
    /// Its first line.
    pub(super) from: usize,
    /// Its last line that says something.
    pub(super) to: usize,
    /// The line before it, which may be the command that was typed.
    pub(super) shell: Option<String>,
    /// The MainDevice whose tool has printed it, where the format is of one alone.
    pub(super) kind: Option<MainDeviceKind>,
}

/// A format.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Format {
    IghSlaves,
    IghMaster,
    IghDomains,
    KernelLog,
    SlaveInfo,
    Ethtool,
    Online,
    Frames,
    Messages,
    Registers,
    KickcatCounters,
}

impl Format {
    /// Whether its lines tell of different times.
    pub(super) const fn is_log(self) -> bool {
        match self {
            Self::KernelLog | Self::Messages => true,
            Self::IghSlaves
            | Self::IghMaster
            | Self::IghDomains
            | Self::SlaveInfo
            | Self::Ethtool
            | Self::Online
            | Self::Frames
            | Self::Registers
            | Self::KickcatCounters => false,
        }
    }

    /// The MainDevice whose tools print this alone.
    const fn kind(self) -> Option<MainDeviceKind> {
        match self {
            Self::IghSlaves | Self::IghMaster | Self::IghDomains | Self::KernelLog => {
                Some(MainDeviceKind::Igh)
            }
            Self::SlaveInfo => Some(MainDeviceKind::Soem),
            Self::Online | Self::Frames | Self::Messages => Some(MainDeviceKind::Twincat),
            Self::KickcatCounters => Some(MainDeviceKind::Kickcat),
            Self::Ethtool | Self::Registers => None,
        }
    }
}

impl Block {
    pub(super) const fn new(format: Format) -> Self {
        Self {
            format,
            what: String::new(),
            lines: 0,
            unused: Vec::new(),
            facts: Vec::new(),
            from: 0,
            to: 0,
            shell: None,
            kind: format.kind(),
        }
    }

    /// A further fact, without a time.
    pub(super) fn tell(&mut self, what: FactKind) {
        self.tell_at(None, what);
    }

    pub(super) fn tell_at(&mut self, stamp: Option<Stamp>, what: FactKind) {
        self.facts.push(Fact { stamp, what });
    }
}

/// Something that is told.
#[derive(Clone, Debug)]
pub(super) struct Fact {
    /// When, where a line says so.
    pub(super) stamp: Option<Stamp>,
    /// What.
    pub(super) what: FactKind,
}

/// What is told.
#[derive(Clone, Debug)]
pub(super) enum FactKind {
    /// A SubDevice is there.
    SubDeviceFact(SubDeviceRef, Box<SubDeviceFact>),
    /// What was read of it.
    Read(SubDeviceRef, Box<ReadDevice>),
    /// What the MainDevice, or its card, counted by then.
    Main(Box<ObservedMainDevice>),
    /// What was counted since the last such line.
    Added(Box<ObservedMainDevice>),
    /// A working counter.
    WorkingCounter(Box<ObservedWorkingCounter>, Vec<SubDeviceRef>),
    /// A SubDevice sent an emergency.
    Emergency { whom: SubDeviceRef, code: u16, register: Option<u8>, data: Vec<u8> },
    /// A SubDevice refused a request.
    Abort { whom: SubDeviceRef, index: u16, subindex: u8, code: u32 },
    /// Those from one to another are gone, or there again.
    Interrupted { from: SubDeviceRef, to: SubDeviceRef, is_back: bool },
}

/// Which SubDevice a text means.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum SubDeviceRef {
    /// By its position, from 0.
    Position(u16),
    /// By its name, with its station address where that is given.
    Named(String, Option<u16>),
    /// By an alias and the number of those behind it.
    Alias(u16, u16),
}

/// What a text says of a SubDevice for all time.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct SubDeviceFact {
    pub(super) name: Option<String>,
    pub(super) type_name: Option<String>,
    pub(super) station: Option<u16>,
    pub(super) alias: Option<u16>,
    pub(super) vendor_id: Option<u32>,
    pub(super) product_code: Option<u32>,
    pub(super) revision: Option<u32>,
    pub(super) serial: Option<u32>,
    pub(super) delay_ns: Option<u32>,
    /// Which of its ports are open, where all are told.
    pub(super) open: Option<PortMap<bool>>,
    /// The neighbours behind its ports by position, the one before it included, where they are told.
    pub(super) neighbours: Option<PortMap<Option<u16>>>,
    /// Ports of which the tool counts errors, in its order.
    pub(super) counted: Vec<Port>,
}

impl SubDeviceFact {
    /// Takes over what another text says.
    pub(super) fn merge(&mut self, other: &Self) {
        fn take<T: Clone>(into: &mut Option<T>, from: &Option<T>) {
            if into.is_none() {
                into.clone_from(from);
            }
        }
        take(&mut self.name, &other.name);
        take(&mut self.type_name, &other.type_name);
        take(&mut self.station, &other.station);
        take(&mut self.alias, &other.alias);
        take(&mut self.vendor_id, &other.vendor_id);
        take(&mut self.product_code, &other.product_code);
        take(&mut self.revision, &other.revision);
        take(&mut self.serial, &other.serial);
        take(&mut self.delay_ns, &other.delay_ns);
        take(&mut self.open, &other.open);
        take(&mut self.neighbours, &other.neighbours);
        if self.counted.is_empty() {
            self.counted.clone_from(&other.counted);
        }
    }
}

/// How many lines a block goes on: all that `is_known` takes, over blank ones, and over up to two that it does
/// not, where known ones follow. Gives the count, and the numbers of those that are not known.
pub(super) fn extent(
    lines: &[super::text::Line<'_>],
    mut is_known: impl FnMut(&super::text::Line<'_>) -> bool,
) -> (usize, Vec<usize>) {
    const MOST_UNKNOWN: usize = 2;
    let mut end = 0;
    let mut pending: Vec<usize> = Vec::new();
    let mut unused = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        if line.is_blank() {
            continue;
        }
        if is_known(line) {
            unused.append(&mut pending);
            end = at + 1;
        } else if super::is_prompt(line) || pending.len() >= MOST_UNKNOWN {
            break;
        } else {
            pending.push(line.no);
        }
    }
    (end, unused)
}
