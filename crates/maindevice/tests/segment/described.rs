//! Devices made from a device description: what their makers describe is what a MainDevice meets.

use linesman_config::plan::{ClockSettings, Plan, PlanOptions};
use linesman_maindevice::{Event, Options};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{DescriptionFiles, SegmentFile};

use crate::bench::Bench;
use crate::mailbox::{put, upload};

/// A valve island with mailbox, dictionary and two sorts of inputs that exclude each other; its
/// outputs can be chosen and changed. Its two slots take counters of 16 or 32 bits.
const MAKER: &str = r##"<EtherCATInfo><Vendor><Id>#x815</Id><Name>Maker</Name></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x42" RevisionNo="#x30002">ISLE</Type><Name>Island</Name>
 <Profile><ProfileNo>5001</ProfileNo><Dictionary><DataTypes>
  <DataType><Name>DT8000</Name><BitSize>64</BitSize>
   <SubItem><SubIdx>0</SubIdx><Name>Count</Name><Type>USINT</Type><BitSize>8</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>1</SubIdx><Name>Ramp</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>2</SubIdx><Name>Limit</Name><Type>DINT</Type><BitSize>32</BitSize><Flags><Access WriteRestrictions="PreOP">rw</Access></Flags></SubItem>
  </DataType></DataTypes><Objects>
  <Object><Index>#x1008</Index><Name>Name</Name><Type>STRING(6)</Type><BitSize>48</BitSize><Info><DefaultString>Island</DefaultString></Info></Object>
  <Object><Index>#x8000</Index><Name>Settings</Name><Type>DT8000</Type><BitSize>64</BitSize><Info>
   <SubItem><Name>Count</Name><Info><DefaultValue>2</DefaultValue></Info></SubItem>
   <SubItem><Name>Ramp</Name><Info><DefaultData>E803</DefaultData></Info></SubItem>
   <SubItem><Name>Limit</Name><Info><DefaultValue>-5</DefaultValue></Info></SubItem></Info></Object>
 </Objects></Dictionary></Profile>
 <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
 <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
 <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
 <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
 <Sm StartAddress="#x1180" ControlByte="#x20" Enable="1">Inputs</Sm>
 <RxPdo Sm="2"><Index>#x1600</Index><Name>Valves</Name>
  <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>A</Name><DataType>BOOL</DataType></Entry>
  <Entry><Index>0</Index><BitLen>7</BitLen></Entry>
  <Entry><Index>#x7000</Index><SubIndex>2</SubIndex><BitLen>16</BitLen><Name>B</Name><DataType>INT</DataType></Entry></RxPdo>
 <TxPdo Fixed="1" Sm="3"><Index>#x1A00</Index><Name>Long</Name><Exclude>#x1A01</Exclude>
  <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>40</BitLen><Name>Pressure</Name></Entry></TxPdo>
 <TxPdo Fixed="1"><Index>#x1A01</Index><Name>Short</Name><Exclude>#x1A00</Exclude>
  <Entry><Index>#x6000</Index><SubIndex>2</SubIndex><BitLen>16</BitLen><Name>Pressure</Name><DataType>UINT</DataType></Entry></TxPdo>
 <Mailbox><CoE SdoInfo="1" PdoAssign="1" PdoConfig="1" CompleteAccess="1"/></Mailbox>
 <Eeprom><ByteSize>2048</ByteSize><ConfigData>0500</ConfigData></Eeprom>
 <Slots SlotPdoIncrement="#x10" SlotIndexIncrement="#x100"><Slot MaxInstances="2"><Name>Slot</Name>
  <ModuleIdent>#x10</ModuleIdent><ModuleIdent>#x20</ModuleIdent></Slot></Slots></Device>
</Devices><Modules>
<Module><Type ModuleIdent="#x10">C16</Type><Name>Counter</Name><TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A40</Index><Name>Count</Name>
 <Entry><Index DependOnSlot="1">#x6100</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Count</Name><DataType>UINT</DataType></Entry></TxPdo></Module>
<Module><Type ModuleIdent="#x20">C32</Type><Name>Counter</Name><TxPdo Fixed="1" Sm="3"><Index DependOnSlot="1">#x1A40</Index><Name>Count</Name>
 <Entry><Index DependOnSlot="1">#x6100</Index><SubIndex>1</SubIndex><BitLen>32</BitLen><Name>Count</Name><DataType>UDINT</DataType></Entry></TxPdo></Module>
</Modules></Descriptions></EtherCATInfo>"##;

struct Maker;

impl DescriptionFiles for Maker {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(MAKER.as_bytes().to_vec())
    }
}

fn bench(more: &str) -> Bench {
    let text = format!(
        "name = \"isle\"\n[[device]]\nname = \"V\"\ntype = \"esi:m.xml#ISLE\"\non = \"maindevice\"\n{more}"
    );
    let file = SegmentFile::parse_with(&text, &Maker).expect("a segment file");
    Bench::of(&file, Options::default())
}

#[test]
fn values_go_both_ways_as_the_description_lays_them_out() {
    let mut bench = bench("slots = [\"C16\", \"0x20\"]\n");
    let plan = bench.start(AlState::Op);
    let id = bench.id("V");
    let device = &plan.devices[0];
    assert_eq!((device.outputs.len(), device.inputs.len()), (3, 5 + 2 + 4));
    let signals = bench.segment.inputs(id).to_vec();
    // Pressure has 40 bits and so two signals; the one that is not assigned has one, too.
    assert_eq!((bench.segment.outputs(id).len(), signals.len()), (2, 5));
    for (signal, value) in signals.iter().zip([0x1122_3344, 0x55, 0x6677, 0x0BAD, -2]) {
        bench.segment.signals_mut().set(*signal, value);
    }
    let outputs = device.outputs.clone();
    bench.device.outputs_mut()[outputs].copy_from_slice(&[0x81, 0xFE, 0xFF]);
    bench.run_for(Span::ms(20));
    let inputs = bench.device.inputs()[device.inputs.clone()].to_vec();
    assert_eq!(inputs, [0x44, 0x33, 0x22, 0x11, 0x55, 0xAD, 0x0B, 0xFE, 0xFF, 0xFF, 0xFF]);
    let driven: Vec<i32> =
        bench.segment.outputs(id).iter().map(|one| bench.segment.signals().value(*one)).collect();
    assert_eq!(driven, [1, 0xFFFE]);
    assert_eq!(upload(&mut bench, "V", 0xF050, 2).unwrap(), [0x20, 0, 0, 0]);
    assert_eq!(upload(&mut bench, "V", 0x6200, 1).unwrap(), [0xFE, 0xFF, 0xFF, 0xFF]);
}

#[test]
fn the_dictionary_is_the_described_one_and_what_follows_from_it() {
    let mut bench = bench("");
    bench.start(AlState::PreOp);
    assert_eq!(upload(&mut bench, "V", 0x1008, 0).unwrap(), b"Island");
    assert_eq!(upload(&mut bench, "V", 0x1018, 3).unwrap(), [2, 0, 3, 0]);
    assert_eq!(upload(&mut bench, "V", 0x8000, 1).unwrap(), [0xE8, 3]);
    assert_eq!(upload(&mut bench, "V", 0x8000, 2).unwrap(), (-5i32).to_le_bytes());
    assert_eq!(upload(&mut bench, "V", 0x1C13, 1).unwrap(), [0x00, 0x1A]);
    assert_eq!(upload(&mut bench, "V", 0x1600, 3).unwrap(), [16, 2, 0x00, 0x70]);
    assert_eq!(put(&mut bench, "V", 0x8000, 2, &[1, 0, 0, 0]), Ok(()));
    assert_eq!(upload(&mut bench, "V", 0x8000, 2).unwrap(), [1, 0, 0, 0]);
    // A fixed PDO stays as it is, the other takes another order.
    assert!(put(&mut bench, "V", 0x1A00, 0, &[0]).is_err());
    assert_eq!(put(&mut bench, "V", 0x1600, 0, &[0]), Ok(()));
    assert_eq!(put(&mut bench, "V", 0x1600, 1, &[16, 2, 0x00, 0x70]), Ok(()));
    assert_eq!(put(&mut bench, "V", 0x1600, 0, &[1]), Ok(()));
}

#[test]
fn pdos_that_exclude_each_other_are_refused() {
    let mut bench = bench("");
    bench.start(AlState::PreOp);
    assert_eq!(put(&mut bench, "V", 0x1C13, 0, &[0]), Ok(()));
    assert_eq!(put(&mut bench, "V", 0x1C13, 1, &[0x00, 0x1A]), Ok(()));
    assert_eq!(put(&mut bench, "V", 0x1C13, 2, &[0x01, 0x1A]), Ok(()));
    assert_eq!(put(&mut bench, "V", 0x1C13, 0, &[2]), Ok(()));
    let inventory = bench.scan();
    let tree = inventory.tree().clone();
    let planned = inventory.planned(AlState::SafeOp);
    let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
    bench.device.start(bench.now, plan);
    let refused = |event: &Event| matches!(event, Event::Refused { code, .. } if code.0 == 0x0024);
    assert!(bench.run_until(Span::s(5), refused), "{}: {:#?}", bench.state("V"), bench.events);
}

#[test]
fn another_module_than_planned_is_named_and_not_taken_further() {
    let mut bench = bench("slots = [\"C16\", \"0x20\"]\n");
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    planned[0].settings.modules = vec![0x10, 0x10];
    let build = |planned: &[_]| {
        Plan::build(planned, inventory.tree().clone(), &PlanOptions::default()).expect("a plan")
    };
    bench.device.start(bench.now, build(&planned));
    let wrong = |event: &Event| matches!(event, Event::WrongModule { slot: 2, .. });
    assert!(bench.run_until(Span::s(5), wrong), "{:#?}", bench.events);
    let (_, event) = bench.events.last().unwrap();
    let lines = event.state_lines(|_| "V".to_owned());
    assert_eq!(lines[0], "V: state change aborted (requested SAFEOP, back to PREOP)");
    assert!(
        lines[1].starts_with("V: slot 2: module 0x00000020 is there, module 0x00000010 is planned"),
        "{lines:?}"
    );
    bench.run_for(Span::s(1));
    assert_eq!(bench.state("V"), "PREOP");
    planned[0].settings.modules = vec![0x10, 0x20];
    bench.device.start(bench.now, build(&planned));
    assert!(bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached)));
    // A slot that the SubDevice does not list is empty.
    planned[0].settings.modules = vec![0x10, 0x20, 0x20];
    bench.device.start(bench.now, build(&planned));
    let missing = |event: &Event| matches!(event, Event::WrongModule { slot: 3, found: 0, .. });
    assert!(bench.run_until(Span::s(5), missing), "{:#?}", bench.events);
}

/// A drive whose description has neither limits nor windows.
const DRIVE: &str = r##"<EtherCATInfo><Vendor><Id>#x815</Id></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x402" RevisionNo="1">AXIS</Type><Name>Axis</Name>
 <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
 <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
 <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
 <Sm StartAddress="#x1180" ControlByte="#x20" Enable="1">Inputs</Sm>
 <RxPdo Fixed="1" Sm="2"><Index>#x1600</Index><Name>Out</Name>
  <Entry><Index>#x6040</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Controlword</Name><DataType>UINT</DataType></Entry>
  <Entry><Index>#x607A</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Target</Name><DataType>DINT</DataType></Entry></RxPdo>
 <TxPdo Fixed="1" Sm="3"><Index>#x1A00</Index><Name>In</Name>
  <Entry><Index>#x6041</Index><SubIndex>0</SubIndex><BitLen>16</BitLen><Name>Statusword</Name><DataType>UINT</DataType></Entry>
  <Entry><Index>#x6064</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Position</Name><DataType>DINT</DataType></Entry></TxPdo>
 <Mailbox><CoE/></Mailbox><Eeprom><ByteSize>2048</ByteSize><ConfigData>0500</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

struct DriveMaker;

impl DescriptionFiles for DriveMaker {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(DRIVE.as_bytes().to_vec())
    }
}

#[test]
fn a_described_drive_moves() {
    let text =
        "name = \"axis\"\n[[device]]\nname = \"X\"\ntype = \"esi:d.xml\"\non = \"maindevice\"\n";
    let file = SegmentFile::parse_with(text, &DriveMaker).expect("a segment file");
    let mut bench = Bench::of(&file, Options::default());
    let plan = bench.start(AlState::Op);
    let (outputs, inputs) = (plan.devices[0].outputs.clone(), plan.devices[0].inputs.clone());
    let statusword = |bench: &Bench| {
        let inputs = &bench.device.inputs()[inputs.clone()];
        u16::from_le_bytes([inputs[0], inputs[1]])
    };
    for (controlword, state) in [(0x0006_u16, 0x21), (0x0007, 0x23), (0x000F, 0x27)] {
        bench.device.outputs_mut()[outputs.clone()][..2]
            .copy_from_slice(&controlword.to_le_bytes());
        bench.run_for(Span::ms(20));
        assert_eq!(statusword(&bench) & 0x6F, state, "controlword 0x{controlword:04X}");
    }
    // Cyclic synchronous position is what it does unless told.
    for step in 1..=200_i32 {
        let target = (step * 50).to_le_bytes();
        bench.device.outputs_mut()[outputs.clone()][2..].copy_from_slice(&target);
        bench.run_for(Span::ms(1));
    }
    bench.run_for(Span::ms(50));
    let position = &bench.device.inputs()[inputs.clone()][2..6];
    let position = i32::from_le_bytes([position[0], position[1], position[2], position[3]]);
    assert!((position - 10_000).abs() <= 100, "{position}");
    assert_eq!(statusword(&bench) & 0x6F, 0x27);
}

/// An output that works in step with SYNC0 and knows how fast it can: 0x1C32:05 is 250 µs.
const STEADY: &str = r##"<EtherCATInfo><Vendor><Id>#x815</Id></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x43" RevisionNo="1">STEADY</Type><Name>Steady</Name>
 <Profile><ProfileNo>5001</ProfileNo><Dictionary><DataTypes>
  <DataType><Name>DT1C32</Name><BitSize>144</BitSize>
   <SubItem><SubIdx>0</SubIdx><Name>Count</Name><Type>USINT</Type><BitSize>8</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>1</SubIdx><Name>Mode</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>2</SubIdx><Name>Cycle</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>rw</Access></Flags></SubItem>
   <SubItem><SubIdx>3</SubIdx><Name>Shift</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>4</SubIdx><Name>Modes</Name><Type>UINT</Type><BitSize>16</BitSize><Flags><Access>ro</Access></Flags></SubItem>
   <SubItem><SubIdx>5</SubIdx><Name>Least</Name><Type>UDINT</Type><BitSize>32</BitSize><Flags><Access>ro</Access></Flags></SubItem>
  </DataType></DataTypes><Objects>
  <Object><Index>#x1C32</Index><Name>Sync</Name><Type>DT1C32</Type><BitSize>144</BitSize><Info>
   <SubItem><Name>Count</Name><Info><DefaultValue>5</DefaultValue></Info></SubItem>
   <SubItem><Name>Mode</Name><Info><DefaultValue>2</DefaultValue></Info></SubItem>
   <SubItem><Name>Cycle</Name><Info><DefaultValue>0</DefaultValue></Info></SubItem>
   <SubItem><Name>Shift</Name><Info><DefaultValue>0</DefaultValue></Info></SubItem>
   <SubItem><Name>Modes</Name><Info><DefaultValue>7</DefaultValue></Info></SubItem>
   <SubItem><Name>Least</Name><Info><DefaultValue>250000</DefaultValue></Info></SubItem></Info></Object>
 </Objects></Dictionary></Profile>
 <Fmmu>Outputs</Fmmu>
 <Sm DefaultSize="128" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
 <Sm DefaultSize="128" StartAddress="#x1080" ControlByte="#x22" Enable="1">MBoxIn</Sm>
 <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
 <RxPdo Fixed="1" Sm="2"><Index>#x1600</Index><Name>Out</Name>
  <Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Value</Name><DataType>INT</DataType></Entry></RxPdo>
 <Mailbox><CoE SdoInfo="1"/></Mailbox>
 <Dc><OpMode><Name>DC</Name><AssignActivate>#x300</AssignActivate></OpMode></Dc>
 <Eeprom><ByteSize>2048</ByteSize><ConfigData>0500</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

struct Steady;

impl DescriptionFiles for Steady {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(STEADY.as_bytes().to_vec())
    }
}

// S0 L536-542.
// proves: SYN-25 partial: where the SubDevice says it; one that measures its times refuses by itself
#[test]
fn a_cycle_shorter_than_a_subdevice_can_bear_is_refused_with_a_slower_task_as_advice() {
    let text = "[[device]]\nname = \"S\"\ntype = \"esi:s.xml#STEADY\"\non = \"maindevice\"\n";
    let file = SegmentFile::parse_with(text, &Steady).expect("a segment file");
    let mut bench = Bench::of(&file, Options::default());
    let inventory = bench.scan();
    let start = |bench: &mut Bench, cycle: Span| {
        let mut planned = inventory.planned(AlState::Op);
        planned[0].settings.clock = Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle: cycle,
            ..ClockSettings::default()
        });
        let tree = inventory.tree().clone();
        let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
        bench.events.clear();
        bench.device.start(bench.now, plan);
    };
    let guarded = |event: &Event| matches!(event, Event::CycleTooShort { .. });
    start(&mut bench, Span::us(125));
    assert!(bench.run_until(Span::s(5), guarded), "{:#?}", bench.events);
    let (_, event) = bench.events.iter().find(|(_, event)| guarded(event)).unwrap();
    let lines = event.state_lines(|_| "S".to_owned());
    assert_eq!(lines[0], "S: state change aborted (requested SAFEOP, back to PREOP)");
    for words in ["0x1C32:05", "slower task", "cycle_us = 250"] {
        assert!(lines[1].contains(words), "{words}: {lines:?}");
    }
    bench.run_for(Span::ms(500));
    assert_eq!(bench.state("S"), "PREOP", "it is not taken further");
    // Just as short as it can bear.
    start(&mut bench, Span::us(250));
    bench.run_for(Span::s(3));
    assert!(!bench.events.iter().any(|(_, event)| guarded(event)), "{:#?}", bench.events);
    assert_ne!(bench.state("S"), "PREOP", "it goes on: {:#?}", bench.events);
}
