//! Events that a MainDevice reports to its user.

use linesman_config::identity::Mismatch;
use linesman_config::inventory::Inventory;
use linesman_config::plan::IdentificationCheck;
use linesman_config::start_up::StartUpCommand;
use linesman_proto::address::{DeviceId, Position, StationAddress, StationAlias, WorkingCounter};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::coe::{Emergency, ObjectAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{AlStatus, DlStatus, ErrorCounters};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Span;

use crate::exchange::{ExchangeError, Reply};
use crate::mailbox::{FileProgress, MailboxFailure};
use crate::main_device::ProbeRequest;
use crate::procedure::{ClockError, ReadOnlyScan, ReadOnlyScanError, ScanError};
use crate::service::{ServiceAnswer, ServiceFailure, ServiceTicket};
use crate::supervisor::{GroupPlace, StartUpError};

mod text;

/// Something that happened. Events come in the order in which it did.
#[derive(Clone, Debug)]
pub enum Event {
    /// [`MainDevice::read_only_scan`](crate::MainDevice::read_only_scan) is done.
    ReadOnlyScanned(Box<ReadOnlyScan>),
    /// It could not be done.
    ReadOnlyScanFailed(ReadOnlyScanError),
    /// [`MainDevice::scan`](crate::MainDevice::scan) is done.
    Scanned(Box<Inventory>),
    /// It could not be done.
    ScanFailed(ScanError),
    /// A SubDevice is in another state, or shows another error, than before.
    DeviceState {
        /// Whose.
        id: DeviceId,
        /// State and error bit.
        status: AlStatus,
        /// Why, when it reports an error.
        code: AlStatusCode,
    },
    /// A SubDevice has reached its target.
    TargetReached {
        /// Which.
        id: DeviceId,
        /// The target.
        state: AlState,
    },
    /// All SubDevices of the plan have reached their targets.
    AllReached,
    /// A SubDevice refused a step. It will be tried again later.
    Refused {
        /// Which.
        id: DeviceId,
        /// Where the step began; `None` when its state was not known.
        from: Option<AlState>,
        /// The state it was asked to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
        /// Its reason.
        code: AlStatusCode,
    },
    /// A SubDevice did not complete a step in time. It will be tried again later.
    StepTimedOut {
        /// Which.
        id: DeviceId,
        /// Where the step began; `None` when its state was not known.
        from: Option<AlState>,
        /// The state it was asked to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
    },
    /// A SubDevice did not take a start-up command. It will be tried again later.
    StartUpFailed {
        /// Which.
        id: DeviceId,
        /// The state it was to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
        /// What it was told.
        command: Box<StartUpCommand>,
        /// What it answered.
        error: Box<StartUpError>,
    },
    /// A slot of a SubDevice holds another module than planned, so that it is not taken further. It will be
    /// looked at again later.
    WrongModule {
        /// Which SubDevice.
        id: DeviceId,
        /// The state it was to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
        /// The slot, from 1.
        slot: u8,
        /// The planned module; 0: none.
        expected: u32,
        /// The one that is there; 0: none.
        found: u32,
    },
    /// A SubDevice cannot work as fast as its SyncSignals are planned to come, so that it is not taken
    /// further. It will be asked again later.
    CycleTooShort {
        /// Which SubDevice.
        id: DeviceId,
        /// The state it was to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
        /// The planned cycle of SYNC0.
        cycle: Span,
        /// The shortest that it says it can bear.
        shortest: Span,
        /// Where it says so.
        object: ObjectAddress,
    },
    /// A SubDevice does not say which modules it has, so that it is not taken further. It will be asked
    /// again later.
    ModulesUnread {
        /// Which SubDevice.
        id: DeviceId,
        /// The state it was to enter.
        to: AlState,
        /// The state it is in.
        status: AlStatus,
        /// What failed.
        error: Box<StartUpError>,
    },
    /// Clocks were set, and follow this one.
    ClocksSet {
        /// Station address of the reference clock.
        reference: StationAddress,
    },
    /// The clock of one SubDevice was set.
    ClockSet {
        /// Which one.
        id: DeviceId,
        /// True if it counts 64 bits, false if 32.
        is_wide: bool,
    },
    /// They could not be set. Those SubDevices that need them are tried again later.
    ClocksNotSet {
        /// Why.
        error: ClockError,
    },
    /// The clock of a SubDevice does not follow the reference clock, so that it is not taken further.
    /// It will be tried again later.
    ClockOff {
        /// Which.
        id: DeviceId,
        /// The state it was to enter.
        to: AlState,
        /// How far it is off (0x092C).
        difference: Span,
        /// How far it may be.
        limit: Span,
        /// How long it was waited for.
        patience: Span,
    },
    /// How far the clock of a SubDevice with SyncSignals is off the reference clock (0x092C). Told when it
    /// leaves the window, when it is well within it again, and now and then in between.
    ClockDifference {
        /// Which.
        id: DeviceId,
        /// How far it is off, in whichever direction.
        difference: Span,
        /// How far it may be.
        window: Span,
        /// It has left the window, and is not well within it again.
        apart: bool,
    },
    /// How far the time of the network, that of the reference clock, is ahead of the host's: of
    /// [`Options::clock_epoch`](crate::Options::clock_epoch) and what has passed since. Told now and then.
    NetworkTime {
        /// Whose clock is the reference.
        id: DeviceId,
        /// By how many ns; negative: it is behind.
        ahead_ns: i64,
    },
    /// A SubDevice has left the state in which it was, on its own.
    AbnormalState {
        /// Which.
        id: DeviceId,
        /// Where it was.
        from: AlState,
        /// Where it is.
        status: AlStatus,
        /// Why, when it reports an error.
        code: AlStatusCode,
    },
    /// A SubDevice that the plan wants was not found on the line, or does not answer any more.
    DeviceLost {
        /// Which.
        id: DeviceId,
    },
    /// It answers again.
    DeviceBack {
        /// Which.
        id: DeviceId,
        /// It had lost its station address: it was without power.
        restarted: bool,
    },
    /// A SubDevice has said who it is, and it is the one that is planned.
    Identified {
        /// Which.
        id: DeviceId,
        /// Who it is; where the rule allows it, of another revision than planned.
        found: Identity,
    },
    /// Where a SubDevice of the plan should be there is another. It is left alone; told once.
    WrongDevice {
        /// Which one is planned.
        id: DeviceId,
        /// In what they differ.
        mismatch: Mismatch,
        /// Who is planned.
        expected: Identity,
        /// Who is there.
        found: Identity,
    },
    /// Several answer to the alias by which one of the plan is to be found: none of them is taken. Told once.
    AliasShared {
        /// Which one is planned.
        id: DeviceId,
        /// The alias.
        alias: StationAlias,
        /// How many answer to it.
        count: u16,
    },
    /// A SubDevice of the right type tells another number than the planned one, or none. Where the number is
    /// compulsory it is kept in INIT. Told once.
    WrongIdentification {
        /// Which one is planned.
        id: DeviceId,
        /// What it must tell.
        check: IdentificationCheck,
        /// What it tells; `None`: it tells none.
        found: Option<u32>,
        /// Whose number that is, if it is that of another planned SubDevice: they may be exchanged.
        belongs_to: Option<DeviceId>,
    },
    /// Several tell the number of the first SubDevice of a group: no newcomer among them is taken. Told once.
    IdentificationShared {
        /// The first SubDevice of the group.
        id: DeviceId,
        /// The number.
        check: IdentificationCheck,
        /// How many tell it.
        count: u16,
    },
    /// A hot connect group was plugged in, and all of it are at their targets.
    GroupJoined {
        /// Index of the group in the plan.
        group: usize,
        /// The port that it hangs at; `None` where that is not known.
        place: Option<GroupPlace>,
    },
    /// A hot connect group does not answer any more.
    GroupLeft {
        /// Index of the group in the plan.
        group: usize,
    },
    /// A hot connect group was plugged in at a port where it may not be. It is kept in INIT. Told once.
    GroupMisplaced {
        /// Index of the group in the plan.
        group: usize,
        /// The port; `None` where that is not known.
        place: Option<GroupPlace>,
    },
    /// A SubDevice that the plan does not have. It is left alone.
    UnplannedDevice {
        /// Where it was seen.
        position: Position,
        /// Who it is.
        found: Identity,
    },
    /// How many SubDevices answer a broadcast has changed.
    Responding {
        /// Before.
        before: WorkingCounter,
        /// Now.
        now: WorkingCounter,
    },
    /// With two cards: frames go round the ring, or do so no longer. Told when it is first known, and
    /// when it changes.
    Ring {
        /// Whether what card A sends arrives at card B.
        intact: bool,
    },
    /// A SubDevice's error counters have changed, or were read for the first time.
    Counters {
        /// Whose.
        id: DeviceId,
        /// As they stand.
        counters: ErrorCounters,
    },
    /// A SubDevice's error counters were read and cleared in one go, because that was asked for.
    CountersCleared {
        /// Whose.
        id: DeviceId,
        /// What stood there.
        counters: ErrorCounters,
    },
    /// A SubDevice's ports have changed, or were read for the first time.
    Links {
        /// Whose.
        id: DeviceId,
        /// As they stand.
        status: DlStatus,
    },
    /// A port whose link is back was ordered to open: the section behind it is prepared.
    PortOpened {
        /// Whose.
        id: DeviceId,
        /// Which.
        port: Port,
    },
    /// A cyclic datagram came back with another working counter than expected. Told when it begins
    /// and when the number changes; [`Event::WorkingCounterGood`] ends it.
    WorkingCounter {
        /// Index of the task in the plan.
        task: usize,
        /// Index of the frame.
        frame: usize,
        /// Index of the datagram.
        datagram: usize,
        /// What it should have been.
        expected: WorkingCounter,
        /// What it was.
        received: WorkingCounter,
    },
    /// It comes back as expected again.
    WorkingCounterGood {
        /// Index of the task in the plan.
        task: usize,
        /// Index of the frame.
        frame: usize,
        /// Index of the datagram.
        datagram: usize,
    },
    /// Cyclic frames do not come back. Told when it begins; [`Event::CyclicFramesBack`] ends it.
    CyclicFramesLost {
        /// Index of the task in the plan.
        task: usize,
    },
    /// They come back again.
    CyclicFramesBack {
        /// Index of the task in the plan.
        task: usize,
        /// How many were lost.
        lost: u64,
    },
    /// The application was late more often than allowed: outputs of a task are withheld, inputs go
    /// on. [`Event::OutputsResumed`] ends it.
    OutputsWithheld {
        /// Index of the task in the plan.
        task: usize,
    },
    /// The application gives outputs again.
    OutputsResumed {
        /// Index of the task in the plan.
        task: usize,
    },
    /// The line has lost its last link, and the plan has its outputs withheld until the network is reset.
    OutputsLocked,
    /// The network is being reset: outputs that were locked are sent again.
    ResetBegun,
    /// A SubDevice reports an error on its own account.
    Emergency {
        /// Which.
        id: DeviceId,
        /// What it says.
        emergency: Emergency,
    },
    /// The transfer of a file has come so far; told ten times a second at most.
    FileProgress {
        /// Whose.
        id: DeviceId,
        /// Bytes that are through, and what keeps the SubDevice busy.
        progress: FileProgress,
    },
    /// A mailbox message that nobody had asked for.
    Mailbox {
        /// Whose.
        id: DeviceId,
        /// Its protocol.
        kind: MailboxType,
        /// What follows the mailbox header.
        data: Vec<u8>,
    },
    /// An upload is done.
    SdoUploaded {
        /// From whom.
        id: DeviceId,
        /// What.
        object: ObjectAddress,
        /// The data.
        result: Result<Vec<u8>, MailboxFailure>,
    },
    /// A download is done.
    SdoDownloaded {
        /// To whom.
        id: DeviceId,
        /// What.
        object: ObjectAddress,
        /// Whether it was taken.
        result: Result<(), MailboxFailure>,
    },
    /// [`MainDevice::serve`](crate::MainDevice::serve) is done.
    Served {
        /// Which service.
        ticket: ServiceTicket,
        /// For whom.
        id: DeviceId,
        /// What it gives.
        result: Box<Result<ServiceAnswer, ServiceFailure>>,
    },
    /// A probe is done.
    Probed {
        /// What was asked.
        request: ProbeRequest,
        /// What came back.
        result: Result<Reply, ExchangeError>,
    },
    /// [`MainDevice::stop`](crate::MainDevice::stop) is done.
    Stopped,
}
