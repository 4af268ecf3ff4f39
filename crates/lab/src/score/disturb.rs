//! Disturbances of a healthy line that are no fault: whatever the diagnosis makes of them is a
//! false alarm.

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::HostEvent;
use linesman_proto::address::{DeviceId, Path, RegisterAddress};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::seed::Stream;
use linesman_sim::segment_file::FaultEntry;

use crate::lab::{Lab, LabError};

/// Jitter that nobody needs to mind, as a share of the cycle; the bar is at 20 % (SYN-31).
pub(super) const JITTER: (f64, f64) = (0.005, 0.1);
/// How much later than usual a device may answer its mailbox, in ms.
const SLOW_MS: (f64, f64) = (1.0, 80.0);
/// How long a line may take to be where it was after an order.
const BACK: Span = Span::s(8);

/// Something that happens on a healthy line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Disturbance {
    /// Frames leave a little late.
    Jitter,
    /// A device takes its time to answer, and is asked.
    SlowDevice,
    /// A tool reads error counters, states and delays, out of turn.
    ReadingTool,
    /// A person orders a device to PREOP and back.
    StateByOrder,
    /// A person orders all devices to SAFEOP and back.
    StopByOrder,
    /// The application moves its outputs.
    Outputs,
    /// The application is ended, and started anew by the same plan.
    StopAndStart,
    /// The second socket of the computer, which this line does not use, has no link, has one, has none.
    UnusedCard,
}

use Disturbance::{
    Jitter, Outputs, ReadingTool, SlowDevice, StateByOrder, StopAndStart, StopByOrder, UnusedCard,
};

const ALL: [Disturbance; 8] =
    [Jitter, SlowDevice, ReadingTool, StateByOrder, StopByOrder, Outputs, StopAndStart, UnusedCard];

/// Does some of it, one after the other, in an order drawn by chance.
///
/// # Errors
/// [`LabError::Stuck`]; what cannot be done on this line is left out.
pub fn disturb(lab: &mut Lab, cycle: Span, stream: &mut Stream) -> Result<(), LabError> {
    for _ in 0..stream.between(1, 4) {
        let Some(disturbance) = stream.pick(&ALL).copied() else { continue };
        let devices: Vec<DeviceId> = lab.segment().devices().collect();
        let Some(device) = stream.pick(&devices).copied() else { continue };
        once(lab, disturbance, device, cycle, stream)?;
        lab.run_until(lab.now() + Span::us(stream.between(50_000, 400_000)))?;
    }
    Ok(())
}

fn once(
    lab: &mut Lab,
    disturbance: Disturbance,
    device: DeviceId,
    cycle: Span,
    stream: &mut Stream,
) -> Result<(), LabError> {
    let lasts = Span::us(stream.between(300_000, 900_000));
    match disturbance {
        Jitter => {
            let share = stream.log_uniform(JITTER.0, JITTER.1);
            let late_us = (cycle.as_nanos() as f64 / 1e3 * share).max(0.2);
            let entry = FaultEntry::new(FaultName::LateFrames)
                .at("maindevice")
                .with("late_us", (late_us * 10.0).round() / 10.0);
            let Ok(id) = lab.inject(&entry) else { return Ok(()) };
            lab.run_until(lab.now() + lasts)?;
            lab.heal(id);
        }
        SlowDevice => {
            let name = lab.segment().name(device).to_owned();
            let by_ms = stream.log_uniform(SLOW_MS.0, SLOW_MS.1).round();
            let entry = FaultEntry::new(FaultName::MailboxSlow).device(name).with("by_ms", by_ms);
            // Without a mailbox there is nothing that could be slow.
            let Ok(id) = lab.inject(&entry) else { return Ok(()) };
            for _ in 0..3 {
                lab.read_object(device, ObjectAddress::new(0x1018, 1))?;
            }
            lab.heal(id);
        }
        ReadingTool => {
            for _ in 0..20 {
                let table = [(0x0300, 20), (0x0110, 2), (0x0130, 6), (0x092C, 4), (0x0000, 8)];
                let Some((register, len)) = stream.pick(&table).copied() else { continue };
                // Who is of no plan has no address to be read at.
                let _ = lab.read_register(device, RegisterAddress(register), len);
                lab.run_until(lab.now() + Span::us(stream.between(100, 20_000)))?;
            }
        }
        StateByOrder => order(lab, Some(device), AlState::PreOp, lasts)?,
        StopByOrder => order(lab, None, AlState::SafeOp, lasts)?,
        StopAndStart => {
            let Some(plan) = lab.plan().cloned() else { return Ok(()) };
            let down = if stream.chance(0.5) { AlState::Init } else { AlState::PreOp };
            lab.stop_main(down);
            lab.run_until(lab.now() + lasts * 2)?;
            lab.start_main(plan);
            lab.run_while(BACK, Span::ms(20), Lab::is_up)?;
        }
        // In a ring the second card is in use.
        UnusedCard if lab.tree().closes_at().is_some() => {}
        UnusedCard => {
            for has_link in [false, true, false] {
                lab.observe_host(Path::B, HostEvent::Carrier(has_link));
                lab.run_until(lab.now() + lasts)?;
            }
        }
        Outputs => {
            for _ in 0..40 {
                lab.change_outputs(|byte| *byte = stream.below(256) as u8);
                lab.run_until(lab.now() + cycle)?;
            }
        }
    }
    Ok(())
}

/// To a state and back to OP.
fn order(
    lab: &mut Lab,
    device: Option<DeviceId>,
    state: AlState,
    lasts: Span,
) -> Result<(), LabError> {
    let device = device.map(|device| lab.in_plan(device));
    lab.request_state(device, state);
    lab.run_until(lab.now() + lasts)?;
    lab.request_state(device, AlState::Op);
    lab.run_while(BACK, Span::ms(20), Lab::is_up)?;
    Ok(())
}
