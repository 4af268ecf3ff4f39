//! Operation modes with distributed clocks, switched on in the registers as a MainDevice does it.

use linesman_config::esi::{EsiDevice, EsiOpMode};
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_maindevice::{Event, ProbeRequest, Target};
use linesman_proto::address::{RegisterAddress, StationAddress};
use linesman_proto::time::Span;
use linesman_sim::segment_file::SegmentFile;

/// Cycle of the process data.
const CYCLE: Span = Span::ms(1);

/// Those of its modes that use the clock.
pub(crate) fn modes(device: &EsiDevice) -> impl Iterator<Item = &EsiOpMode> {
    device.op_modes.iter().filter(|mode| mode.assign_activate != 0)
}

/// Cycle times of SYNC0 and SYNC1 in ns (ETG.2000: a factor of n is n cycles, of -n a part of one; 0
/// is the time that stands there).
fn cycle_times(mode: &EsiOpMode) -> (u32, u32) {
    let cycle = CYCLE.as_nanos() as u32;
    let sync0 = match mode.sync0_cycle_factor {
        0 if mode.sync0_cycle_ns > 0 => mode.sync0_cycle_ns,
        0 => cycle,
        parts if parts < 0 => cycle / u32::from(parts.unsigned_abs()),
        times => cycle * times.unsigned_abs() as u32,
    };
    // SYNC1 comes once in each cycle; its register counts from the SYNC0 before (S2 2.9).
    (sync0, cycle.saturating_sub(sync0))
}

/// Brings the last device of a segment to OP with a mode on.
pub(crate) fn to_op(file: &SegmentFile, mode: &EsiOpMode) -> Result<Lab, String> {
    let options = LabOptions { cycle: CYCLE, ..LabOptions::default() };
    let mut lab = Lab::new(file, options).map_err(|error| error.to_string())?;
    let scanned = lab.run_while(Span::s(5), Span::us(100), |lab| lab.plan().is_some());
    if !scanned.map_err(|error| error.to_string())? {
        return Err("the scan does not end".to_owned());
    }
    switch_on(&mut lab, mode)?;
    crate::up::stay_up(lab)
}

/// Switches a mode on in the last device.
pub(crate) fn switch_on(lab: &mut Lab, mode: &EsiOpMode) -> Result<(), String> {
    let (sync0, sync1) = cycle_times(mode);
    let station = lab.plan().expect("a plan").devices.last().expect("a device").station;
    let now = access(lab, station, 0x0910, 8, None)?;
    let now = u64::from_le_bytes(now.try_into().map_err(|_| "no system time")?);
    // What is asked beside the cycle goes right behind its frame; the signal must not fall upon the frames.
    let start = now + Span::ms(3).as_nanos() + CYCLE.as_nanos() * 3 / 10;
    let [cyclic, activation] = mode.assign_activate.to_le_bytes();
    for (register, data) in [
        (0x0990, start.to_le_bytes().to_vec()),
        (0x09A0, sync0.to_le_bytes().to_vec()),
        (0x09A4, sync1.to_le_bytes().to_vec()),
        (0x0980, vec![cyclic, activation]),
    ] {
        access(lab, station, register, data.len() as u16, Some(data))?;
    }
    // Bits 4 to 7 are no part of every controller.
    let on = access(lab, station, 0x0981, 1, None)?;
    if on[0] & 0x07 != activation & 0x07 {
        return Err(format!("0x0981 reads 0x{:02X} after 0x{activation:02X}", on[0]));
    }
    Ok(())
}

/// One access to a register of a SubDevice, beside all else. Right after the scan it may not have its
/// address yet.
pub(crate) fn access(
    lab: &mut Lab,
    station: StationAddress,
    register: u16,
    len: u16,
    write: Option<Vec<u8>>,
) -> Result<Vec<u8>, String> {
    let mut result = Err(String::new());
    for _ in 0..400 {
        result = access_once(lab, station, register, len, write.clone());
        if result.is_ok() {
            break;
        }
        let until = lab.now() + Span::us(200);
        lab.run_until(until).map_err(|error| error.to_string())?;
    }
    result
}

fn access_once(
    lab: &mut Lab,
    station: StationAddress,
    register: u16,
    len: u16,
    write: Option<Vec<u8>>,
) -> Result<Vec<u8>, String> {
    let before = lab.events().len();
    let request = ProbeRequest {
        target: Target::Station(station),
        register: RegisterAddress(register),
        len,
        write,
    };
    let now = lab.now();
    lab.main_mut().probe(now, request.clone());
    let answer = |lab: &Lab| {
        lab.events().iter().skip(before).find_map(|(_, event)| {
            let Event::Probed { request: about, result } = event else { return None };
            (*about == request).then(|| result.clone())
        })
    };
    lab.run_while(Span::ms(50), Span::us(50), |lab| answer(lab).is_some())
        .map_err(|error| error.to_string())?;
    match answer(lab) {
        Some(Ok(reply)) if reply.answered() => Ok(reply.data.into_vec()),
        other => Err(format!("register 0x{register:04X}: {other:?}")),
    }
}
