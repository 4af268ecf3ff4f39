//! A plant of three SubDevices in OP, in step with SYNC0, played by hand.

use linesman_diagnosis::{Diagnosis, Setup};
use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;

use super::script::{Datagram, Script, fprd, fpwr, lrw};

pub const PROCESS: u32 = 0x0100_0000;

/// The time of the reference clock 0x1001, handed round to two more.
pub fn frmw(time: u64) -> Datagram {
    frmw_of(0x1001, time)
}

/// The same of another reference clock.
fn frmw_of(station: u16, time: u64) -> Datagram {
    Datagram {
        command: Command::Frmw,
        address: DatagramAddress::Physical(station, RegisterAddress(0x0910)),
        sent: vec![0; 8],
        back: time.to_le_bytes().to_vec(),
        wkc: 3,
        passed: 0,
        events: 0,
    }
}

/// Three SubDevices in OP, in step with SYNC0; the clocks go with the computer's. A cycle takes 1 ms.
pub struct Plant {
    pub script: Script,
    /// What the reference clock gains in a cycle, in ns.
    pub pace: u64,
    pub time: u64,
    pub next: u64,
    /// The reference clock.
    reference: u16,
}

impl Plant {
    pub fn new(setup: Setup) -> Self {
        Self::led_by(0x1001, setup)
    }

    /// With another reference clock.
    pub fn led_by(reference: u16, setup: Setup) -> Self {
        let mut script = Script::with(setup);
        script.is_live = true;
        script.scan(3);
        for station in 0x1001..=0x1003 {
            script.exchange(&[fpwr(station, 0x0980, &[0, 3])]);
        }
        for state in [4_u8, 8] {
            for station in 0x1001..=0x1003 {
                script.exchange(&[fpwr(station, 0x0120, &[state, 0])]);
                script.exchange(&[fprd(station, 0x0130, &[state, 0, 0, 0, 0, 0])]);
            }
        }
        let next = script.now;
        let mut plant = Self { script, pace: 1_000_000, time: 7_000_000_000, next, reference };
        plant.cycles(600);
        plant
    }

    pub fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            let datagrams = self.next_cycle();
            self.script.exchange(&datagrams);
        }
    }

    /// The frame of the next cycle; whatever was read meanwhile, that begins in its time.
    fn next_cycle(&mut self) -> [Datagram; 2] {
        self.time = self.time.wrapping_add(self.pace);
        self.next += 1_000_000;
        assert!(self.script.now <= self.next);
        self.script.now = self.next;
        [lrw(PROCESS, 2, 2), frmw_of(self.reference, self.time)]
    }

    /// So many cycles whose frames come back later than usual by so many µs.
    pub fn late_cycles(&mut self, late_us: &[u64]) {
        for us in late_us {
            let datagrams = self.next_cycle();
            self.script.send(&datagrams);
            self.script.now += us * 1_000;
            self.script.give_back(&datagrams);
            self.script.index = self.script.index.wrapping_add(2);
        }
    }

    /// So many cycles whose frames do not come back.
    pub fn lost_cycles(&mut self, count: usize) {
        for _ in 0..count {
            let datagrams = self.next_cycle();
            self.script.vanish(&datagrams);
        }
    }

    /// A register is read between two cycles.
    pub fn read(&mut self, station: u16, register: u16, data: &[u8]) {
        self.script.exchange(&[fprd(station, register, data)]);
    }

    /// The clock of a SubDevice is ahead by so many ns.
    pub fn ahead(&mut self, station: u16, ns: u32) {
        self.read(station, 0x092C, &(ns | 1 << 31).to_le_bytes());
    }

    pub fn left_op(&mut self, station: u16, code: u8) {
        self.read(station, 0x0130, &[0x14, 0, 0, 0, code, 0]);
        self.cycles(5);
    }

    pub fn report(&mut self) -> Diagnosis {
        self.script.finish();
        self.script.engine.diagnosis()
    }
}

pub fn plant() -> Plant {
    Plant::new(Setup::default())
}

/// The codes of all findings that follow from no other one.
pub fn codes(report: &Diagnosis) -> Vec<&str> {
    report.findings.iter().map(|finding| finding.code.as_str()).collect()
}
