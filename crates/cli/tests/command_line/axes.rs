//! Axes that a program moves through the library, as `linesman run` drives a line: a stepper stage, a
//! drive of CiA 402 and a drive that speaks SoE.

use linesman::prelude::*;
use tempfile::TempDir;

const PLANT: &str = r#"
name = "axes"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "S1"
type = "EL7041"
on = "K1.B"
[[device]]
name = "D1"
type = "CiA402-Drive"
on = "K1.C"
[[device]]
name = "X1"
type = "AX5103-0012"
on = "D1.B"
"#;

/// Controlword of CiA 402: shutdown, switch on, enable operation.
const SWITCH_ON: [u16; 3] = [0x06, 0x07, 0x0F];
/// Statusword under its mask: operation enabled.
const ENABLED: (u16, u16) = (0x6F, 0x27);
const PROFILE_VELOCITY: i8 = 3;
/// Drive on, enable, restart (IEC 61800-7-204, S-0-0134).
const SERCOS_ON: u16 = 0xE000;

#[test]
fn outputs_of_a_program_move_the_axes_and_inputs_tell_it() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("axes.toml");
    std::fs::write(&file, PLANT).unwrap();
    let mut segment = linesman::open(&format!("sim:{}", file.display())).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    let (enable, speed): (Output<bool>, Output<i16>) = (
        plan.output("EL7041/STM Control/Enable").unwrap(),
        plan.output("EL7041/STM Velocity/Velocity").unwrap(),
    );
    let ready: Input<bool> = plan.input("EL7041/STM Status/Ready").unwrap();
    let counter: Input<u16> = plan.input("EL7041/ENC Status compact/Counter value").unwrap();
    let control: Output<u16> = plan.output("CiA402-Drive/Drive outputs/Controlword").unwrap();
    let mode: Output<i8> = plan.output("CiA402-Drive/Drive outputs/Modes of operation").unwrap();
    let target: Output<i32> = plan.output("CiA402-Drive/Drive outputs/Target velocity").unwrap();
    let status: Input<u16> = plan.input("CiA402-Drive/Drive inputs/Statusword").unwrap();
    let place: Input<i32> = plan.input("CiA402-Drive/Drive inputs/Position actual value").unwrap();
    let master: Output<u16> = plan.output("AX5103-0012/MDT/Master control word").unwrap();
    let command: Output<i32> = plan.output("AX5103-0012/MDT/Velocity command value").unwrap();
    let feedback: Input<i32> = plan.input("AX5103-0012/AT/Position feedback 1 value").unwrap();

    let mut cycle = 0_usize;
    // Where each axis was when it was told to move, half way, and in the end.
    let mut seen: Vec<(u16, i32, i32)> = Vec::new();
    let (mut is_ready, mut is_enabled) = (false, false);
    let report = segment
        .run(plan, RunOptions::us(1_000), |io| {
            if !io.is_settled() {
                return Next::Continue;
            }
            cycle += 1;
            io.set(enable, true);
            io.set(mode, PROFILE_VELOCITY);
            io.set(control, SWITCH_ON[(cycle / 100).min(2)]);
            io.set(master, SERCOS_ON);
            let moving = cycle > 500;
            io.set(speed, if moving { 2_000 } else { 0 });
            io.set(target, if moving { 5_000 } else { 0 });
            io.set(command, if moving { 1_000_000 } else { 0 });
            if [500, 1_500, 2_500].contains(&cycle) {
                seen.push((io.get(counter), io.get(place), io.get(feedback)));
                is_ready = io.get(ready);
                is_enabled = io.get(status) & ENABLED.0 == ENABLED.1;
            }
            if cycle < 2_600 { Next::Continue } else { Next::Stop }
        })
        .unwrap();
    assert_eq!(report.counts.working_counter_errors, 0);
    assert!(is_ready && is_enabled, "{is_ready} {is_enabled}");
    let [(a, b, c), (d, e, f), (g, h, i)] = seen[..] else { panic!("{seen:?}") };
    assert!(d.wrapping_sub(a) > 10 && g.wrapping_sub(d) > 10, "the stepper stands: {seen:?}");
    assert!(e - b > 1_000 && h - e > 1_000, "the drive stands: {seen:?}");
    assert!(f - c > 100 && i - f > 100, "the servo stands: {seen:?}");
}
