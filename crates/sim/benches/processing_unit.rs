//! Time that a controller takes for a datagram: what a segment of many devices is made of.
//!
//! Time per frame through one processing unit; each frame carries one datagram unless said.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use linesman_proto::address::{DeviceId, LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::PortMap;
use linesman_proto::register::{self as r, FmmuConfig, SmControl, SyncManagerConfig};
use linesman_proto::time::{Instant, Span};
use linesman_sim::controller::{Controller, LocalClock};
use linesman_sim::device::{NoFirmware, Signals};
use linesman_sim::frame::{Damage, WireFrame};
use linesman_sim::hardware::{CountingProfile, Hardware, PortKind, Timing};

const STATION: u16 = 0x1001;
/// A configuration area that is not checked: device emulation, nothing else.
const SII: [u8; 16] = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xA4, 0x88];

fn hardware() -> Hardware {
    Hardware {
        controller_type: 0x11,
        revision: 0,
        build: 0,
        fmmus: 8,
        sync_managers: 8,
        ram_kib: 8,
        features: 0x000C,
        ports: PortMap([PortKind::Mii, PortKind::Mii, PortKind::Absent, PortKind::Absent]),
        counting: CountingProfile {
            forwarded: true,
            remakes_symbol_errors: false,
            counts_when_closed: false,
            counts_missing_start: true,
        },
        timing: Timing {
            forward: Span::ns(130),
            process: Span::ns(150),
            ebus_crossing: Span::ns(20),
            mii_crossing: Span::ns(400),
            ebus_loss_detection: Span::us(2),
            mii_loss_detection: Span::us(15),
            ebus_link_up: Span::us(500),
            mii_link_up: Span::ms(1_500),
        },
    }
}

fn frame(command: Command, address: DatagramAddress, data: &[u8]) -> WireFrame {
    frame_of(1, command, address, data)
}

/// A frame with `count` equal datagrams.
fn frame_of(count: u8, command: Command, address: DatagramAddress, data: &[u8]) -> WireFrame {
    let mut buffer = vec![0; 1_514];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress::default());
    for index in 0..count {
        let slot = builder.push(command, index, address, data.len()).expect("the data fit");
        slot.copy_from_slice(data);
    }
    let len = builder.finish();
    buffer.truncate(len);
    WireFrame { bytes: buffer, damage: Damage::default(), number: 0 }
}

/// A controller with 8 bytes of inputs and 8 bytes of outputs at logical 0x1000 and 0x1008.
fn controller(signals: &mut Signals) -> Controller {
    let clock = LocalClock::default();
    let mut controller =
        Controller::new(DeviceId(0), hardware(), clock, Box::new(NoFirmware), SII.to_vec());
    controller.power_on_before(Instant::ZERO, signals);
    let mut write = |address: RegisterAddress, data: &[u8]| {
        let address = DatagramAddress::Physical(0, address);
        let mut frame = frame(Command::Apwr, address, data);
        let _ = controller.process(Instant::ZERO, &mut frame, signals);
    };
    write(r::STATION_ADDRESS.address, &STATION.to_le_bytes());
    let outputs = SyncManagerConfig::enabled(RegisterAddress(0x1100), 8, SmControl::OUTPUTS);
    let inputs = SyncManagerConfig::enabled(RegisterAddress(0x1180), 8, SmControl(0));
    write(r::SYNC_MANAGER.address, &outputs.to_bytes());
    write(RegisterAddress(0x0808), &inputs.to_bytes());
    let inputs = FmmuConfig::inputs(LogicalAddress(0x1000), 8, RegisterAddress(0x1180));
    let outputs = FmmuConfig::outputs(LogicalAddress(0x1008), 8, RegisterAddress(0x1100));
    write(r::FMMU.address, &inputs.to_bytes());
    write(RegisterAddress(0x0610), &outputs.to_bytes());
    controller
}

fn processing_unit(criterion: &mut Criterion) {
    let physical = DatagramAddress::Physical;
    let logical = |at| DatagramAddress::Logical(LogicalAddress(at));
    let cases = [
        ("BRD AL status", frame(Command::Brd, physical(0, r::AL_STATUS.address), &[0; 2])),
        ("FPRD hit", frame(Command::Fprd, physical(STATION, r::AL_STATUS.address), &[0; 6])),
        ("FPRD miss", frame(Command::Fprd, physical(0x2000, r::AL_STATUS.address), &[0; 6])),
        (
            "51 x FPRD miss",
            frame_of(51, Command::Fprd, physical(0x2000, r::AL_STATUS.address), &[0; 6]),
        ),
        ("LRW mapped", frame(Command::Lrw, logical(0x1000), &[0; 16])),
        ("LRW mapped, 1 KB", frame(Command::Lrw, logical(0x0E00), &[0; 1_024])),
        ("LRW unmapped", frame(Command::Lrw, logical(0x8000), &[0; 1_024])),
        (
            "FRMW system time",
            frame(Command::Frmw, physical(0x2000, r::SYSTEM_TIME.address), &[0; 8]),
        ),
    ];
    let mut signals = Signals::default();
    let mut group = criterion.benchmark_group("processing unit");
    for (name, mut frame) in cases {
        let mut controller = controller(&mut signals);
        let mut now = Instant::ZERO;
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                now += Span::us(250);
                frame.number += 1;
                black_box(controller.process(now, &mut frame, &mut signals))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, processing_unit);
criterion_main!(benches);
