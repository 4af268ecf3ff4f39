//! Drive of CiA 402 that is enabled and follows a sine, in step with the distributed clocks, and is stopped when its
//! data are not to be trusted.
//!
//! `cargo run --example drive -- eth0` with a drive of your own, or without a place for a virtual segment.

use linesman::prelude::*;
use linesman::{Application, DeviceHandle, InputsOf, OutputsOf};

/// Statusword under its mask, and the controlword that leads on from there (CiA 402, 8.1).
const WAY: [(u16, u16, u16); 4] = [
    (0x4F, 0x40, 0x06), // switch on disabled: shutdown
    (0x6F, 0x21, 0x07), // ready to switch on: switch on
    (0x6F, 0x23, 0x0F), // switched on: enable operation
    (0x6F, 0x27, 0x0F), // operation enabled: stay
];
const ENABLED: u16 = 0x27;
const FAULT_RESET: u16 = 0x80;
const PROFILE_VELOCITY: i8 = 3;

// region: drive
linesman::inputs! {
    struct Feedback {
        status: u16 = "Drive inputs/Statusword",
        position: i32 = "Drive inputs/Position actual value",
    }
}

linesman::outputs! {
    #[derive(Default)]
    struct Command {
        control: u16 = "Drive outputs/Controlword",
        mode: i8 = "Drive outputs/Modes of operation",
        velocity: i32 = "Drive outputs/Target velocity",
    }
}

struct Axis {
    device: DeviceHandle,
    feedback: InputsOf<Feedback>,
    command: OutputsOf<Command>,
    cycle: u32,
    positions: Vec<i32>, // with room from the start: the cycle does not allocate
}

impl Application for Axis {
    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        if self.cycle == 0 && !io.is_settled() {
            return Next::Continue;
        }
        self.cycle += 1;
        if !io.quality(self.device).valid {
            io.write(self.command, Command::default());
            return Next::Stop;
        }
        let Feedback { status, position } = io.read(self.feedback);
        let step = WAY.iter().find(|(mask, state, _)| status & mask == *state);
        let control = step.map_or(FAULT_RESET, |(.., control)| *control);
        let sine = (f64::from(self.cycle) * 0.002).sin() * 10_000.0;
        let velocity = if status & 0x6F == ENABLED { sine as i32 } else { 0 };
        io.write(self.command, Command { control, mode: PROFILE_VELOCITY, velocity });
        if self.cycle.is_multiple_of(100) && self.positions.len() < self.positions.capacity() {
            self.positions.push(position);
        }
        if self.cycle < 3_000 { Next::Continue } else { Next::Stop }
    }
}

/// Turns the drive to and fro; gives its position every 100 cycles.
pub fn turn(segment: &mut Segment) -> Result<Vec<i32>, linesman::Error> {
    let plan = segment.scan()?.plan()?;
    let mut axis = Axis {
        device: plan.device("CiA402-Drive")?,
        feedback: plan.inputs("CiA402-Drive")?,
        command: plan.outputs("CiA402-Drive")?,
        cycle: 0,
        positions: Vec::with_capacity(30),
    };
    segment.run_application(plan, RunOptions::us(1_000).dc(), &mut axis)?;
    Ok(axis.positions)
}
// endregion

/// Turns the drive on the place that is given, or a virtual one.
pub fn main() -> Result<(), linesman::Error> {
    let mut segment = match std::env::args().nth(1) {
        Some(place) => linesman::open(&place)?,
        None => {
            Segment::simulated(&SegmentFile::in_a_row("axis", 1, &[("Drive", "CiA402-Drive")]))?
        }
    };
    println!("positions: {:?}", turn(&mut segment)?);
    Ok(())
}
