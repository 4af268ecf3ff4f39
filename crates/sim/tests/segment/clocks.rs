//! Distributed clocks as a MainDevice sets them up, through frames alone.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::command::Command;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::time::{DcTime32, Instant, Span};
use linesman_proto::topology::delay::Delays;
use linesman_sim::segment_file::SegmentFile;

use super::rig::{Bench, at, frame};

/// Station address of the first device; one more for each further one.
const STATION: u16 = 0x1001;

/// How much longer a frame takes through the processing unit (S1 9.1.2).
const UNIT: Span = Span::ns(20);

/// A MainDevice that does nothing but clocks.
pub(crate) struct Clocks {
    pub(crate) bench: Bench,
    pub(crate) devices: Vec<DeviceId>,
}

impl Clocks {
    pub(crate) fn of(file: &SegmentFile) -> Self {
        let mut bench = Bench::of(file);
        let devices: Vec<DeviceId> = bench.segment.devices().collect();
        for position in 0..devices.len() as u16 {
            let station = (STATION + position).to_le_bytes();
            let address = at(position.wrapping_neg(), 0x0010);
            assert_eq!(bench.send(Command::Apwr, address, &station).unwrap().1, 1);
        }
        Self { bench, devices }
    }

    pub(crate) fn read<const N: usize>(&mut self, node: usize, ado: u16) -> Option<[u8; N]> {
        let address = at(STATION + node as u16, ado);
        let (data, wkc) = self.bench.send(Command::Fprd, address, &[0; N]).unwrap();
        (wkc == 1).then(|| data.try_into().unwrap())
    }

    pub(crate) fn write(&mut self, node: usize, ado: u16, data: &[u8]) {
        let address = at(STATION + node as u16, ado);
        assert_eq!(self.bench.send(Command::Fpwr, address, data).unwrap().1, 1, "0x{ado:04X}");
    }

    /// Latches the receive times and reads those of each device's open ports.
    pub(crate) fn receive_times(&mut self) -> Vec<PortMap<Option<DcTime32>>> {
        let tree = self.bench.segment.tree().clone();
        self.bench.send(Command::Bwr, at(0, 0x0900), &[0; 4]).unwrap();
        let times = (0..self.devices.len()).map(|node| {
            let bytes: [u8; 16] = self.read(node, 0x0900).unwrap();
            let mut times = PortMap::default();
            for port in tree.open_ports(node) {
                let at = port.index() * 4;
                let raw = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
                times[port] = Some(DcTime32(raw));
            }
            times
        });
        times.collect()
    }

    /// Which devices have a time loop.
    pub(crate) fn clocked(&mut self) -> Vec<usize> {
        (0..self.devices.len()).filter(|node| self.read::<4>(*node, 0x092C).is_some()).collect()
    }

    /// Delays and offsets from one latch, as every MainDevice does it. Gives the reference.
    pub(crate) fn set_up(&mut self) -> usize {
        let tree = self.bench.segment.tree().clone();
        let received = self.receive_times();
        let clocked = self.clocked();
        // Without the longer way through the processing unit each hop would be 10 ns short.
        let delays = Delays::measure(&tree, Path::A, &received, UNIT).unwrap();
        let of = |node: usize| delays.of(node).unwrap().from_reference.as_nanos();
        let reference = clocked[0];
        // The time of the MainDevice at that latch: any will do.
        let now = 850_000_000_000_000_000_u64;
        for node in clocked {
            let delay = of(node) - of(reference);
            let latched = u64::from_le_bytes(self.read(node, 0x0918).unwrap());
            let offset = (now + delay).wrapping_sub(latched);
            self.write(node, 0x0920, &offset.to_le_bytes());
            self.write(node, 0x0928, &(delay as u32).to_le_bytes());
            self.write(node, 0x0930, &0x1000u16.to_le_bytes());
        }
        reference
    }

    /// The reference's time goes to all, `times` times, one `each`.
    pub(crate) fn distribute(&mut self, reference: usize, times: usize, each: Span) {
        let station = at(STATION + reference as u16, 0x0910);
        let bytes = frame(Command::Frmw, station, &[0; 8]);
        for _ in 0..times {
            self.bench.segment.handle_frame(self.bench.now, Path::A, &bytes);
            self.bench.wait(each);
        }
    }

    /// The OR of 0x092C of all, without the sign.
    pub(crate) fn window(&mut self) -> u32 {
        let (data, _) = self.bench.broadcast(0x092C, 4).unwrap();
        u32::from_le_bytes(data.try_into().unwrap()) & 0x7FFF_FFFF
    }

    /// How far the clocks are apart at this moment, seen from outside.
    pub(crate) fn spread(&self, nodes: &[usize]) -> i64 {
        let now: Instant = self.bench.now;
        let time = |node: &usize| {
            let controller = self.bench.segment.controller(self.devices[*node]).unwrap();
            controller.system_time(now)
        };
        let first = time(&nodes[0]);
        // Some have the low half only.
        let off = nodes.iter().map(|node| i64::from(time(node).wrapping_sub(first) as i32));
        off.clone().max().unwrap() - off.min().unwrap()
    }
}

/// A clock without any fault, for times that are to be exact.
const EXACT: &str = "clock_ppm = 0.0\nclock = { ramp_ppm_per_s = 0.0, jitter_ns = 0 }\n";

/// A line as type, name, attachment and cable.
fn line(devices: &[(&str, &str, &str, f64)]) -> SegmentFile {
    let mut text = "name = \"measured\"\n".to_owned();
    for (kind, name, on, cable_m) in devices {
        text +=
            &format!("[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\n{EXACT}");
        if *cable_m > 0.0 {
            text += &format!("cable_m = {cable_m:.1}\n");
        }
    }
    SegmentFile::parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn delays(file: &SegmentFile) -> (Vec<u64>, Vec<PortMap<Option<DcTime32>>>) {
    let mut clocks = Clocks::of(file);
    let received = clocks.receive_times();
    let tree = clocks.bench.segment.tree().clone();
    let delays = Delays::measure(&tree, Path::A, &received, Span::ZERO).unwrap();
    let all = (0..tree.len()).map(|node| delays.of(node).unwrap().from_reference.as_nanos());
    (all.collect(), received)
}

fn since_entry(received: &PortMap<Option<DcTime32>>, port: Port) -> i32 {
    received[port].unwrap().delta(received[Port::A].unwrap())
}

// proves: ESC-12 partial: the delays of two lines that were measured on real hardware
#[test]
fn measured_delays_come_out_of_the_walk() {
    // Terminals stand in for those of the real line that have the same controllers.
    let first = line(&[
        ("EK1100", "EK1100", "maindevice", 5.0),
        ("EK1122", "EK1122", "EK1100.B", 0.0),
        ("EL1008", "EL9560", "EK1122.C", 0.0),
        ("EK1100", "EK1914", "EK1100.C", 2.0),
        ("EL1008", "EL1008", "EK1914.B", 0.0),
    ]);
    let (found, received) = delays(&first);
    assert_eq!(found, [0, 145, 300, 1_085, 1_240]);
    assert_eq!(since_entry(&received[0], Port::B), 3_374_482 - 3_373_882);
    assert_eq!(since_entry(&received[0], Port::C), 3_375_762 - 3_373_882);
    assert_eq!(since_entry(&received[1], Port::C), 4_116_672 - 4_116_362);
    assert_eq!(since_entry(&received[3], Port::B), 3_884_272 - 3_883_962);

    let second = line(&[
        ("EK1100", "EK1100", "maindevice", 5.0),
        ("EK1122", "EK1122", "EK1100.B", 0.0),
        ("EK1100", "EK1914", "EK1122.D", 7.0),
        ("EL1008", "EL1008", "EK1914.B", 0.0),
        ("EK1101", "EK1101", "EK1122.B", 11.0),
        ("EL1008", "EL9560", "EK1122.C", 0.0),
    ]);
    let (found, received) = delays(&second);
    assert_eq!(found, [0, 145, 665, 820, 2_035, 2_720]);
    assert_eq!(since_entry(&received[0], Port::B), 3_064_460 - 3_061_450);
    for (port, time) in [(Port::D, 3_294_570), (Port::B, 3_295_650), (Port::C, 3_295_940)] {
        assert_eq!(since_entry(&received[1], port), time - 3_293_220, "EK1122 {port}");
    }
}

/// Twenty terminals with a processor behind two couplers, all quartzes as bad as they come.
pub(crate) fn drifting(ramp_ppm_per_s: f64) -> SegmentFile {
    let mut text = "name = \"drifting\"\nseed = 11\n".to_owned();
    let mut on = "maindevice".to_owned();
    for number in 0..22 {
        let coupler = number % 11 == 0;
        let (kind, name) = if coupler {
            ("EK1100", format!("K{number}"))
        } else {
            ([("EL3102"), ("EL4102")][number % 2], format!("T{number}"))
        };
        if number == 11 {
            on = "K0.C".to_owned();
        }
        // From -50 to 50 ppm, neighbours far apart.
        let ppm = (number * 37 % 101) as f64 - 50.0;
        let ramp = if number % 3 == 0 { -ramp_ppm_per_s } else { ramp_ppm_per_s };
        text += &format!(
            "[[device]]\nname = \"{name}\"\ntype = \"{kind}\"\non = \"{on}\"\nclock_ppm = {ppm:.1}\n\
             clock = {{ ramp_ppm_per_s = {ramp:.3}, ramp_s = 600.0, jitter_ns = 5 }}\n"
        );
        on = format!("{name}.B");
    }
    SegmentFile::parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

// proves: DC-01 partial: quartzes of ±50 ppm that warm up, 15,000 frames and then one each millisecond; DC-07 partial
#[test]
fn all_clocks_are_aligned_to_100_ns() {
    let mut clocks = Clocks::of(&drifting(0.05));
    let reference = clocks.set_up();
    let nodes = clocks.clocked();
    assert!(nodes.len() >= 20, "{nodes:?}");
    let unaligned = {
        let mut alone = Clocks::of(&drifting(0.05));
        alone.set_up();
        alone.bench.wait(Span::s(1));
        alone.spread(&nodes)
    };
    assert!(unaligned > 80_000, "without any frame they are {unaligned} ns apart after a second");
    clocks.distribute(reference, 15_000, Span::us(50));
    // The worst is 97 ppm off the reference; three seconds later its start is worked off as well.
    clocks.distribute(reference, 3_000, Span::ms(1));
    let mut worst = (0, 0);
    for _ in 0..20 {
        clocks.distribute(reference, 100, Span::ms(1));
        worst = (worst.0.max(clocks.spread(&nodes)), worst.1.max(clocks.window()));
    }
    assert!(worst.0 <= 100, "{} ns apart", worst.0);
    assert!(worst.1 < 0x80, "0x092C: {:#X}", worst.1);
    clocks.bench.assert_audit();
}

#[test]
fn the_same_seed_gives_the_same_clocks() {
    let run = || {
        let mut clocks = Clocks::of(&drifting(0.05));
        let reference = clocks.set_up();
        clocks.distribute(reference, 500, Span::us(50));
        let shown: Vec<_> = (0..clocks.devices.len())
            .map(|node| (clocks.read::<4>(node, 0x092C), clocks.read::<8>(node, 0x0910)))
            .collect();
        shown
    };
    assert_eq!(run(), run());
}
