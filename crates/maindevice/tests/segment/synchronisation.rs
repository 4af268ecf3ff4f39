//! Outputs and inputs of SubDevices with a clock, with frames alone and with a timer of their own, as our MainDevice sets
//! them up, and the objects that show it (0x1C32, 0x1C33).

use linesman_config::fault::FaultName;
use linesman_config::plan::Plan;
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{DescriptionFiles, FaultEntry, SegmentFile};

use crate::bench::Bench;
use crate::clocks::{plan, start};
use crate::mailbox::{put, upload};

const PLANT: &str = r#"
name = "in step"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL4102"
on = "K1.B"
[[device]]
name = "I1"
type = "EL3102"
on = "O1.B"
"#;
/// The cycle of the plan.
const CYCLE: u64 = 1_000_000;
/// Step in which outputs are watched.
const STEP: Span = Span::us(1);
const OUTPUTS: u16 = 0x1C32;
const INPUTS: u16 = 0x1C33;

/// In OP, with a clock for the SubDevices whose types `clocked` picks.
fn in_op(clocked: impl Fn(&str) -> bool) -> (Bench, Plan) {
    let mut bench = Bench::new(PLANT);
    let plan = plan(&mut bench, clocked);
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(3));
    (bench, plan)
}

fn everybody(kind: &str) -> bool {
    kind.starts_with("EL")
}

/// When the output of O1 takes `count` new values, each given to the MainDevice once the one before is there: offset from
/// the beat of the cycle, in ns.
fn output_times(bench: &mut Bench, plan: &Plan, count: u8) -> Vec<u64> {
    let id = bench.id("O1");
    let range = plan.devices[id.index()].outputs.clone();
    let signal = bench.segment.outputs(id)[0];
    (1..=count)
        .map(|value| {
            bench.device.outputs_mut()[range.clone()][0] = value;
            for _ in 0..20_000 {
                bench.run_for(STEP);
                if bench.segment.signals().value(signal) == i32::from(value) {
                    return bench.now.as_nanos() % CYCLE;
                }
            }
            panic!("the output does not take the value {value}");
        })
        .collect()
}

/// The widest difference between times within a cycle.
fn spread(times: &[u64]) -> u64 {
    let first = times[0];
    let off = times.iter().map(|time| {
        let after = (time + CYCLE - first) % CYCLE;
        if after > CYCLE / 2 { after as i64 - CYCLE as i64 } else { after as i64 }
    });
    let (least, most) = (off.clone().min().unwrap(), off.max().unwrap());
    (most - least) as u64
}

fn number(bench: &mut Bench, name: &str, index: u16, subindex: u8) -> u64 {
    let bytes = upload(bench, name, index, subindex).unwrap();
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

/// The computer sends up to 200 µs late, which SYNC0 at 300 µs behind the beat still bears.
fn frames_come_late(bench: &mut Bench) {
    let jitter = FaultEntry::new(FaultName::HostJitter)
        .with("delays_per_s", 2_000.0)
        .with("delay_us", 200.0);
    bench.segment.inject(bench.now, &jitter).unwrap();
}

// proves: SYN-04
#[test]
fn outputs_with_a_clock_come_with_sync_however_late_the_frames_are() {
    let (mut bench, plan) = in_op(everybody);
    frames_come_late(&mut bench);
    let times = output_times(&mut bench, &plan, 40);
    assert!(spread(&times) <= 3_000, "{} ns: {times:?}", spread(&times));
}

// proves: SYN-03
#[test]
fn outputs_with_frames_alone_come_as_late_as_the_frames() {
    let (mut bench, plan) = in_op(|_| false);
    let even = spread(&output_times(&mut bench, &plan, 40));
    assert!(even <= 3_000, "{even} ns while frames come in time");
    frames_come_late(&mut bench);
    let times = output_times(&mut bench, &plan, 40);
    assert!(spread(&times) >= 100_000, "{} ns: {times:?}", spread(&times));
}

// proves: SYN-02
#[test]
fn outputs_in_free_run_come_with_a_timer_that_frames_do_not_move() {
    let mut bench = Bench::new(PLANT);
    let mut plan = plan(&mut bench, |_| false);
    let write = |subindex: u8, data: &[u8]| StartUpCommand {
        transition: Transition::PRE_OP_TO_SAFE_OP,
        action: StartUpAction::CoeDownload {
            object: ObjectAddress::new(OUTPUTS, subindex),
            complete_access: false,
            data: data.to_vec(),
        },
        comment: "free run".to_owned(),
    };
    let id = bench.id("O1");
    // A period that has nothing to do with the cycle of the frames.
    plan.devices[id.index()].start_up =
        vec![write(1, &[0, 0]), write(2, &1_300_000u32.to_le_bytes())];
    start(&mut bench, plan.clone());
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 1), 0);
    let times = output_times(&mut bench, &plan, 40);
    assert!(spread(&times) >= 500_000, "at any time of the cycle: {times:?}");
}

// proves: SYN-20, SYN-23
#[test]
fn outputs_and_inputs_move_by_the_shift_that_their_object_shows() {
    let (mut bench, plan) = in_op(everybody);
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 3), 0);
    let before = output_times(&mut bench, &plan, 4);
    assert_eq!(put(&mut bench, "O1", OUTPUTS, 3, &200_000u32.to_le_bytes()), Ok(()));
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 3), 200_000);
    bench.run_for(Span::ms(10));
    let after = output_times(&mut bench, &plan, 4);
    let moved = (after[3] + CYCLE - before[3]) % CYCLE;
    assert!(moved.abs_diff(200_000) <= 3_000, "outputs moved by {moved} ns");

    let before = latch_time(&mut bench, &plan);
    assert_eq!(put(&mut bench, "I1", INPUTS, 3, &150_000u32.to_le_bytes()), Ok(()));
    bench.run_for(Span::ms(10));
    let after = latch_time(&mut bench, &plan);
    let moved = (after + CYCLE - before) % CYCLE;
    assert!(moved.abs_diff(150_000) <= 12_000, "inputs moved by {moved} ns");
}

/// When I1 takes its input in a cycle, in ns after the beat, to 10 µs: what is there up to then comes with the next frame, and
/// what comes later with the one after it.
fn latch_time(bench: &mut Bench, plan: &Plan) -> u64 {
    let id = bench.id("I1");
    let range = plan.devices[id.index()].inputs.clone();
    let signal = bench.segment.inputs(id)[0];
    // Far apart, as the device measures with some noise, and no byte of its other inputs.
    let mut value = 60;
    // How many frames fetch the old value first: one more from the latch on.
    let mut late = |offset: u64| {
        value = 160 - value;
        let into = bench.now.as_nanos() % CYCLE;
        bench.run_for(Span::ns((CYCLE + offset - into) % CYCLE));
        bench.segment.signals_mut().set(signal, value);
        let low = value.to_le_bytes()[0];
        let mut waited = 0;
        while !bench.device.inputs()[range.clone()].contains(&low) {
            bench.run_for(Span::us(10));
            waited += 10_000;
            assert!(waited < 10 * CYCLE, "the input does not come");
        }
        waited + offset
    };
    let arrivals: Vec<(u64, u64)> =
        (0..CYCLE / 10_000).map(|step| step * 10_000).map(|at| (at, late(at))).collect();
    let turn = arrivals.windows(2).find(|pair| pair[1].1 > pair[0].1 + CYCLE / 2);
    turn.unwrap_or_else(|| panic!("no latch within a cycle: {arrivals:?}"))[1].0
}

// proves: SYN-21 (S)
#[test]
fn objects_show_mode_cycle_and_what_is_supported_of_each_subdevice() {
    let (mut bench, _) = in_op(|kind| kind == "EL4102");
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 1), 2, "with SYNC0");
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 2), CYCLE);
    assert_eq!(number(&mut bench, "O1", OUTPUTS, 0x0A), CYCLE);
    assert_ne!(number(&mut bench, "O1", OUTPUTS, 4) & 0x4007, 0);
    for counter in [0x0B, 0x0C, 0x0D, 0x20] {
        assert_eq!(number(&mut bench, "O1", OUTPUTS, counter), 0, "{counter:#04X}");
    }
    // The other keeps step with the frames: of its inputs, as it has no outputs.
    assert_eq!(number(&mut bench, "I1", INPUTS, 1), 1);
}

/// A device whose maker describes what it needs for its work.
const MAKER: &str = r##"<EtherCATInfo><Vendor><Id>#x815</Id><Name>Maker</Name></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x43" RevisionNo="#x10000">ELM</Type><Name>Measures</Name>
 <Profile><ProfileNo>5001</ProfileNo><Dictionary><DataTypes>
  <DataType><Name>DT1C32</Name><BitSize>256</BitSize>
   <SubItem><SubIdx>0</SubIdx><Name>Count</Name><Type>USINT</Type><BitSize>8</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>1</SubIdx><Name>Mode</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>2</SubIdx><Name>Cycle</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>3</SubIdx><Name>Shift</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>4</SubIdx><Name>Supported</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>5</SubIdx><Name>Minimum cycle</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>6</SubIdx><Name>Calc and copy</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>8</SubIdx><Name>Command</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>9</SubIdx><Name>Delay</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>ro</Access></Flags></SubItem>
  </DataType></DataTypes><Objects>
  <Object><Index>#x1C32</Index><Name>SM output parameter</Name><Type>DT1C32</Type><BitSize>256</BitSize><Info>
   <SubItem><Name>Count</Name><Info><DefaultValue>9</DefaultValue></Info></SubItem>
   <SubItem><Name>Mode</Name><Info><DefaultValue>1</DefaultValue></Info></SubItem>
   <SubItem><Name>Supported</Name><Info><DefaultValue>#x4007</DefaultValue></Info></SubItem>
   <SubItem><Name>Minimum cycle</Name><Info><DefaultValue>155600</DefaultValue></Info></SubItem>
   <SubItem><Name>Calc and copy</Name><Info><DefaultValue>35600</DefaultValue></Info></SubItem></Info></Object>
 </Objects></Dictionary></Profile>
 <Fmmu>Outputs</Fmmu>
 <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
 <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
 <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
 <RxPdo Fixed="1" Sm="2"><Index>#x1600</Index><Name>Value</Name>
  <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>V</Name><DataType>INT</DataType></Entry></RxPdo>
 <Mailbox><CoE SdoInfo="1"/></Mailbox>
 <Dc><OpMode><Name>DC</Name><AssignActivate>#x0300</AssignActivate></OpMode></Dc>
 <Eeprom><ByteSize>2048</ByteSize><ConfigData>0500</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

struct Maker;

impl DescriptionFiles for Maker {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(MAKER.as_bytes().to_vec())
    }
}

// proves: SYN-24
#[test]
fn subdevice_measures_its_own_times_when_told_to() {
    let text = "name = \"measures\"\n[[device]]\nname = \"V\"\ntype = \"esi:m.xml#ELM\"\non = \"maindevice\"\n";
    let file = SegmentFile::parse_with(text, &Maker).expect("a segment file");
    let mut bench = Bench::of(&file, linesman_maindevice::Options::default());
    let plan = plan(&mut bench, |_| true);
    start(&mut bench, plan);
    assert_ne!(number(&mut bench, "V", OUTPUTS, 4) & 0x4000, 0, "it can measure");
    assert_eq!(number(&mut bench, "V", OUTPUTS, 5), 0, "not known before");
    assert_eq!(put(&mut bench, "V", OUTPUTS, 8, &[1, 0]), Ok(()));
    bench.run_for(Span::ms(50));
    assert_eq!(number(&mut bench, "V", OUTPUTS, 8), 0, "done");
    let (cycle, copy) = (number(&mut bench, "V", OUTPUTS, 5), number(&mut bench, "V", OUTPUTS, 6));
    assert_eq!((cycle, copy), (155_600, 35_600));
}

/// Four alike behind a coupler.
const FOUR: &str = r#"
name = "four"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL4102"
on = "K1.B"
[[device]]
name = "O2"
type = "EL4102"
on = "O1.B"
[[device]]
name = "O3"
type = "EL4102"
on = "O2.B"
[[device]]
name = "O4"
type = "EL4102"
on = "O3.B"
"#;

// proves: SYN-01 (S)
#[test]
fn each_of_four_alike_keeps_step_as_was_chosen_for_it() {
    let mut bench = Bench::new(FOUR);
    let mut plan = plan(&mut bench, |kind| kind == "EL4102");
    let mode = |mode: u8| StartUpCommand {
        transition: Transition::PRE_OP_TO_SAFE_OP,
        action: StartUpAction::CoeDownload {
            object: ObjectAddress::new(OUTPUTS, 1),
            complete_access: false,
            data: vec![mode, 0],
        },
        comment: "how it keeps step".to_owned(),
    };
    // With SYNC1, 50 µs behind SYNC0, with SYNC0, with the frames, in free run.
    for (no, chosen) in [(1_usize, 3), (2, 2), (3, 1), (4, 0)] {
        let device = &mut plan.devices[no];
        device.start_up = vec![mode(chosen)];
        match (chosen, &mut device.settings.clock) {
            (3, Some(clock)) => {
                clock.assign_activate = 0x0700;
                clock.sync1_cycle = Span::us(50);
            }
            (2, _) => {}
            (_, clock) => *clock = None,
        }
    }
    start(&mut bench, plan.clone());
    bench.run_for(Span::s(3));
    for (name, expected) in [("O1", 3), ("O2", 2), ("O3", 1), ("O4", 0)] {
        assert_eq!(number(&mut bench, name, OUTPUTS, 1), expected, "{name}");
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    let mut times = |name: &str| -> Vec<u64> {
        let id = bench.id(name);
        let range = plan.devices[id.index()].outputs.clone();
        let signal = bench.segment.outputs(id)[0];
        let mut when = |value: u8| {
            bench.device.outputs_mut()[range.clone()][0] = value;
            for _ in 0..20_000 {
                bench.run_for(STEP);
                if bench.segment.signals().value(signal) == i32::from(value) {
                    return bench.now.as_nanos() % CYCLE;
                }
            }
            panic!("the output of {name} does not take the value {value}");
        };
        (1..=10).map(&mut when).collect()
    };
    let (by_sync1, by_sync0, by_frames) = (times("O1"), times("O2"), times("O3"));
    let apart = |later: u64, earlier: u64| (later + CYCLE - earlier) % CYCLE;
    assert!(apart(by_sync1[9], by_sync0[9]).abs_diff(50_000) <= 3_000, "{by_sync1:?} {by_sync0:?}");
    // The shift of the network and its own, 300 µs each, behind the frame.
    let behind = apart(by_sync0[9], by_frames[9]);
    assert!(behind.abs_diff(600_000) <= 20_000, "{by_sync0:?} {by_frames:?}");
}
