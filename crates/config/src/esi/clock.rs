//! Operation modes with distributed clocks: element `Dc` (ETG.2000).

use super::error::EsiError;
use super::xml::Element;

/// A way to run with (or without) distributed clocks.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiOpMode {
    /// Its name, such as `DcSync`.
    pub name: String,
    /// What it does.
    pub description: String,
    /// What is written to 0x0980.
    pub assign_activate: u16,
    /// Cycle of SYNC0 in ns; 0 is the MainDevice's cycle times the factor.
    pub sync0_cycle_ns: u32,
    /// Positive: every n cycles; negative: n times within a cycle.
    pub sync0_cycle_factor: i16,
    /// Shift of SYNC0 in ns.
    pub sync0_shift_ns: i32,
    /// SYNC0 refers to the shift of the inputs instead of that of the outputs (`ShiftTimeSync0` with
    /// `Input="1"`, SYN-08).
    pub input_reference: bool,
    /// Cycle of SYNC1, in cycles of SYNC0.
    pub sync1_cycle_factor: i16,
    /// Shift of SYNC1 in ns.
    pub sync1_shift_ns: i32,
    /// What its SyncManagers carry in this mode; those that are not named carry what they do
    /// otherwise.
    pub sync_managers: Vec<EsiModeSyncManager>,
}

/// A SyncManager in an operation mode.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiModeSyncManager {
    /// Which one.
    pub number: u8,
    /// What is written to subindex 1 of 0x1C32 or 0x1C33, where that is said.
    pub sync_type: Option<u16>,
    /// What is written to subindex 2, in ns.
    pub cycle_time_ns: Option<u32>,
    /// What is written to subindex 3, in ns.
    pub shift_time_ns: Option<i32>,
    /// Its PDOs; none where those of the device stay.
    pub pdos: Vec<EsiModePdo>,
}

/// A PDO in an operation mode.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EsiModePdo {
    /// Index of its mapping object.
    pub index: u16,
    /// How often it is there in each cycle: 1 without oversampling.
    pub times: u16,
}

/// The modes of an element `Dc`.
pub(super) fn op_modes(element: &Element) -> Result<Vec<EsiOpMode>, EsiError> {
    let modes = element.children("OpMode").map(op_mode);
    modes.map(|mode| mode.map_err(|error| error.within("Dc"))).collect()
}

fn op_mode(element: &Element) -> Result<EsiOpMode, EsiError> {
    let factor = |name: &str| match element.child(name) {
        Some(cycle) => cycle.attribute_number("Factor").map(|factor| factor.unwrap_or(0)),
        None => Ok(0),
    };
    Ok(EsiOpMode {
        name: element.child_text("Name").to_owned(),
        description: element.child_text("Desc").to_owned(),
        assign_activate: element.child_number("AssignActivate")?.unwrap_or(0),
        sync0_cycle_ns: element.child_number("CycleTimeSync0")?.unwrap_or(0),
        sync0_cycle_factor: factor("CycleTimeSync0")?,
        sync0_shift_ns: element.child_number("ShiftTimeSync0")?.unwrap_or(0),
        input_reference: match element.child("ShiftTimeSync0") {
            Some(shift) => shift.flag("Input")?,
            None => false,
        },
        sync1_cycle_factor: factor("CycleTimeSync1")?,
        sync1_shift_ns: element.child_number("ShiftTimeSync1")?.unwrap_or(0),
        sync_managers: element.children("Sm").map(sync_manager).collect::<Result<_, _>>()?,
    })
}

fn sync_manager(element: &Element) -> Result<EsiModeSyncManager, EsiError> {
    let pdo = |pdo: &Element| {
        let times = pdo.attribute_number("OSFac")?.unwrap_or(1);
        Ok(EsiModePdo { index: pdo.number()?, times })
    };
    Ok(EsiModeSyncManager {
        number: element.attribute_number("No")?.unwrap_or(0),
        sync_type: element.child_number("SyncType")?,
        cycle_time_ns: element.child_number("CycleTime")?,
        shift_time_ns: element.child_number("ShiftTime")?,
        pdos: element.children("Pdo").map(pdo).collect::<Result<_, _>>()?,
    })
}
