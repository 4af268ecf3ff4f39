//! Codes of emergencies, which a drive shows at 0x603F as well: name, and what to do by class.
//!
//! References: CiA 301, emergency error codes; CiA 402 (IEC 61800-7-201), error codes of drives;
//! ETG.1000.6, emergency, for class 0xA0xx. Manufacturers add codes of their own in every class.

use super::EmergencyClass;

/// All there is to say about the code of an emergency.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EmergencyCode {
    /// The number.
    pub code: u16,
    /// A specification names the number itself; if not, the name is that of its class.
    pub known: bool,
    /// Its name.
    pub name: &'static str,
    /// Source of the name.
    pub reference: &'static str,
}

/// The meaning of an emergency's code. There is an answer for every number: one that no
/// specification names gets that of its class.
#[must_use]
pub fn lookup(code: u16) -> EmergencyCode {
    match ALL.binary_search_by_key(&code, |entry| entry.code) {
        Ok(index) => ALL[index],
        Err(_) => EmergencyCode {
            code,
            known: false,
            name: EmergencyClass::of(code).text(),
            reference: "CiA 301, classes of emergency error codes",
        },
    }
}

impl EmergencyClass {
    /// Steps to take on a code of this class, in order.
    #[must_use]
    pub const fn actions(self) -> &'static [&'static str] {
        match self {
            Self::Reset => &["Nothing: the SubDevice says that an error is gone."],
            Self::Generic => &[DEVICE, MANUAL],
            Self::Current => &[
                "Check the axis or load for what holds it: brake, mechanics, a move that is too fast.",
                "Check motor and motor cable for a short circuit and for earth leakage, unplugged.",
                MANUAL,
            ],
            Self::Voltage => &[
                "Measure the supply at the device under load, also while drives brake.",
                "Check fuses, phases, the contactor of the power supply and the brake resistor.",
                MANUAL,
            ],
            Self::Temperature => &[
                "Check cooling, fans, filters and spacing, and the temperature in the cabinet.",
                "Check whether load or duty cycle of the drive have risen.",
                MANUAL,
            ],
            Self::Hardware => &[
                "Switch the device off and on. If the code comes back, exchange it for a trial.",
                MANUAL,
            ],
            Self::Software => &[
                "Take back what was changed of its settings, then load the defaults (0x1011).",
                "Check the firmware version (0x100A) and update it.",
                MANUAL,
            ],
            Self::Modules => &[
                "Check what is connected to the device: encoder, brake, module, and their cables.",
                MANUAL,
            ],
            Self::Communication => &[
                "Look whether its link or its frames failed at that time: `linesman diagnose WHERE`.",
                "If so, the network is the reason and this code follows.",
                MANUAL,
            ],
            Self::Monitoring => &[
                "Compare what was asked for with what the axis can do: velocity, acceleration, limits, \
                 following error window (0x6065).",
                "Check mechanics, load and the tuning of the controller.",
                MANUAL,
            ],
            Self::External => &[
                "Look at what is wired to the device from outside: enable, safety, limit switches.",
                MANUAL,
            ],
            Self::StateMachine => &[
                "Read the AL status code (0x0134): it says why the change of state failed.",
                MANUAL,
            ],
            Self::AdditionalFunctions => &[DEVICE, MANUAL],
            Self::DeviceSpecific | Self::Unknown => &[MANUAL, DEVICE],
        }
    }
}

const MANUAL: &str = "Look the code up in the manual of the device; its last five bytes are explained \
     there, too.";
const DEVICE: &str =
    "Read its diagnosis history (`linesman history WHERE DEVICE`) and look at its display.";

const CIA_301: &str = "CiA 301, emergency error codes";
const CIA_402: &str = "CiA 402 (IEC 61800-7-201), error codes";
const ETG: &str = "ETG.1000.6, emergency";

const fn named(code: u16, name: &'static str, reference: &'static str) -> EmergencyCode {
    EmergencyCode { code, known: true, name, reference }
}

/// All codes that the specifications name, in order of their numbers.
pub const ALL: &[EmergencyCode] = &[
    named(0x0000, "error reset, or no error", CIA_301),
    named(0x1000, "generic error", CIA_301),
    named(0x2000, "current", CIA_301),
    named(0x2100, "current at the input side", CIA_301),
    named(0x2110, "short circuit or earth leakage at the input", CIA_402),
    named(0x2120, "earth leakage at the input", CIA_402),
    named(0x2121, "earth leakage at the input, phase L1", CIA_402),
    named(0x2122, "earth leakage at the input, phase L2", CIA_402),
    named(0x2123, "earth leakage at the input, phase L3", CIA_402),
    named(0x2130, "short circuit at the input", CIA_402),
    named(0x2131, "short circuit at the input, phases L1 and L2", CIA_402),
    named(0x2132, "short circuit at the input, phases L2 and L3", CIA_402),
    named(0x2133, "short circuit at the input, phases L3 and L1", CIA_402),
    named(0x2200, "current inside the device", CIA_301),
    named(0x2211, "current inside the device, no. 1", CIA_402),
    named(0x2212, "current inside the device, no. 2", CIA_402),
    named(0x2213, "overcurrent in the ramp function", CIA_402),
    named(0x2214, "overcurrent in the sequence", CIA_402),
    named(0x2220, "continuous overcurrent inside the device", CIA_402),
    named(0x2221, "continuous overcurrent inside the device, no. 1", CIA_402),
    named(0x2222, "continuous overcurrent inside the device, no. 2", CIA_402),
    named(0x2230, "short circuit or earth leakage inside the device", CIA_402),
    named(0x2240, "earth leakage inside the device", CIA_402),
    named(0x2250, "short circuit inside the device", CIA_402),
    named(0x2300, "current at the output side", CIA_301),
    named(0x2310, "continuous overcurrent at the output", CIA_402),
    named(0x2311, "continuous overcurrent at the output, no. 1", CIA_402),
    named(0x2312, "continuous overcurrent at the output, no. 2", CIA_402),
    named(0x2320, "short circuit or earth leakage at the motor", CIA_402),
    named(0x2330, "earth leakage at the motor", CIA_402),
    named(0x2331, "earth leakage at the motor, phase U", CIA_402),
    named(0x2332, "earth leakage at the motor, phase V", CIA_402),
    named(0x2333, "earth leakage at the motor, phase W", CIA_402),
    named(0x2340, "short circuit at the motor", CIA_402),
    named(0x2341, "short circuit at the motor, phases U and V", CIA_402),
    named(0x2342, "short circuit at the motor, phases V and W", CIA_402),
    named(0x2343, "short circuit at the motor, phases W and U", CIA_402),
    named(0x2350, "load level fault (I2t, thermal state)", CIA_402),
    named(0x2351, "load level warning (I2t, thermal state)", CIA_402),
    named(0x3000, "voltage", CIA_301),
    named(0x3100, "mains voltage", CIA_301),
    named(0x3110, "mains overvoltage", CIA_402),
    named(0x3111, "mains overvoltage, phase L1", CIA_402),
    named(0x3112, "mains overvoltage, phase L2", CIA_402),
    named(0x3113, "mains overvoltage, phase L3", CIA_402),
    named(0x3120, "mains undervoltage", CIA_402),
    named(0x3121, "mains undervoltage, phase L1", CIA_402),
    named(0x3122, "mains undervoltage, phase L2", CIA_402),
    named(0x3123, "mains undervoltage, phase L3", CIA_402),
    named(0x3130, "phase failure", CIA_402),
    named(0x3131, "phase failure, L1", CIA_402),
    named(0x3132, "phase failure, L2", CIA_402),
    named(0x3133, "phase failure, L3", CIA_402),
    named(0x3134, "wrong order of phases", CIA_402),
    named(0x3140, "mains frequency", CIA_402),
    named(0x3141, "mains frequency too high", CIA_402),
    named(0x3142, "mains frequency too low", CIA_402),
    named(0x3200, "voltage inside the device", CIA_301),
    named(0x3210, "DC link overvoltage", CIA_402),
    named(0x3211, "DC link overvoltage, no. 1", CIA_402),
    named(0x3212, "DC link overvoltage, no. 2", CIA_402),
    named(0x3220, "DC link undervoltage", CIA_402),
    named(0x3221, "DC link undervoltage, no. 1", CIA_402),
    named(0x3222, "DC link undervoltage, no. 2", CIA_402),
    named(0x3230, "load error", CIA_402),
    named(0x3300, "output voltage", CIA_301),
    named(0x3310, "output overvoltage", CIA_402),
    named(0x3311, "output overvoltage, phase U", CIA_402),
    named(0x3312, "output overvoltage, phase V", CIA_402),
    named(0x3313, "output overvoltage, phase W", CIA_402),
    named(0x3320, "armature circuit", CIA_402),
    named(0x3321, "armature circuit interrupted", CIA_402),
    named(0x3330, "field circuit", CIA_402),
    named(0x3331, "field circuit interrupted", CIA_402),
    named(0x4000, "temperature", CIA_301),
    named(0x4100, "ambient temperature", CIA_301),
    named(0x4110, "ambient temperature too high", CIA_402),
    named(0x4120, "ambient temperature too low", CIA_402),
    named(0x4130, "temperature of the supply air", CIA_402),
    named(0x4140, "temperature of the air outlet", CIA_402),
    named(0x4200, "temperature of the device", CIA_301),
    named(0x4210, "temperature of the device too high", CIA_402),
    named(0x4220, "temperature of the device too low", CIA_402),
    named(0x4300, "temperature of the drive", CIA_402),
    named(0x4310, "temperature of the drive too high", CIA_402),
    named(0x4320, "temperature of the drive too low", CIA_402),
    named(0x4400, "temperature of the supply", CIA_402),
    named(0x4410, "temperature of the supply too high", CIA_402),
    named(0x4420, "temperature of the supply too low", CIA_402),
    named(0x5000, "hardware of the device", CIA_301),
    named(0x5100, "supply of the electronics", CIA_402),
    named(0x5110, "low-voltage supply of the electronics", CIA_402),
    named(0x5111, "supply of the electronics, +-15 V", CIA_402),
    named(0x5112, "supply of the electronics, +24 V", CIA_402),
    named(0x5113, "supply of the electronics, +5 V", CIA_402),
    named(0x5120, "supply of the intermediate circuit", CIA_402),
    named(0x5200, "control hardware", CIA_402),
    named(0x5210, "measurement circuit", CIA_402),
    named(0x5220, "computing circuit", CIA_402),
    named(0x5300, "operating unit", CIA_402),
    named(0x5400, "power section", CIA_402),
    named(0x5410, "output stages", CIA_402),
    named(0x5420, "chopper", CIA_402),
    named(0x5430, "input stages", CIA_402),
    named(0x5440, "contacts", CIA_402),
    named(0x5450, "fuses", CIA_402),
    named(0x5500, "memory", CIA_402),
    named(0x5510, "RAM", CIA_402),
    named(0x5520, "ROM", CIA_402),
    named(0x5530, "EEPROM", CIA_402),
    named(0x6000, "software of the device", CIA_301),
    named(0x6010, "software reset (watchdog of the processor)", CIA_402),
    named(0x6100, "internal software", CIA_301),
    named(0x6200, "user software", CIA_301),
    named(0x6300, "data set", CIA_301),
    named(0x6310, "loss of parameters", CIA_402),
    named(0x6320, "parameter error", CIA_402),
    named(0x7000, "additional modules", CIA_301),
    named(0x7100, "power module", CIA_402),
    named(0x7110, "brake chopper", CIA_402),
    named(0x7111, "failure of the brake chopper", CIA_402),
    named(0x7112, "overcurrent of the brake chopper", CIA_402),
    named(0x7113, "protective circuit of the brake chopper", CIA_402),
    named(0x7120, "motor", CIA_402),
    named(0x7121, "motor blocked", CIA_402),
    named(0x7122, "motor error, or wrong commutation", CIA_402),
    named(0x7123, "motor tilted", CIA_402),
    named(0x7200, "measurement circuit", CIA_402),
    named(0x7300, "sensor", CIA_402),
    named(0x7301, "tacho fault", CIA_402),
    named(0x7302, "tacho with wrong polarity", CIA_402),
    named(0x7303, "resolver 1 fault", CIA_402),
    named(0x7304, "resolver 2 fault", CIA_402),
    named(0x7305, "incremental encoder 1 fault", CIA_402),
    named(0x7306, "incremental encoder 2 fault", CIA_402),
    named(0x7307, "incremental encoder 3 fault", CIA_402),
    named(0x7310, "speed", CIA_402),
    named(0x7320, "position", CIA_402),
    named(0x7400, "computing circuit", CIA_402),
    named(0x7500, "communication", CIA_402),
    named(0x7510, "serial interface no. 1", CIA_402),
    named(0x7520, "serial interface no. 2", CIA_402),
    named(0x7600, "data memory", CIA_402),
    named(0x8000, "monitoring", CIA_301),
    named(0x8100, "communication", CIA_301),
    named(0x8110, "CAN overrun: messages were lost", CIA_301),
    named(0x8120, "CAN in error-passive mode", CIA_301),
    named(0x8130, "life guard or heartbeat error", CIA_301),
    named(0x8140, "recovered from bus off", CIA_301),
    named(0x8150, "collision of CAN identifiers", CIA_301),
    named(0x8200, "protocol error", CIA_301),
    named(0x8210, "PDO not processed because of its length", CIA_301),
    named(0x8220, "PDO longer than expected", CIA_301),
    named(0x8230, "multiplexed PDO not processed, destination not there", CIA_301),
    named(0x8240, "unexpected length of SYNC data", CIA_301),
    named(0x8250, "RxPDO did not come in time", CIA_301),
    named(0x8300, "torque control", CIA_402),
    named(0x8311, "torque too high", CIA_402),
    named(0x8312, "difficult start-up", CIA_402),
    named(0x8313, "torque at standstill", CIA_402),
    named(0x8321, "torque too low", CIA_402),
    named(0x8331, "torque fault", CIA_402),
    named(0x8400, "velocity control", CIA_402),
    named(0x8500, "position control", CIA_402),
    named(0x8600, "positioning", CIA_402),
    named(0x8611, "following error", CIA_402),
    named(0x8612, "reference limit", CIA_402),
    named(0x8700, "synchronisation control: the drive is out of step", CIA_402),
    named(0x8800, "winding control", CIA_402),
    named(0x8900, "process data monitoring", CIA_402),
    named(0x8A00, "control monitoring", CIA_402),
    named(0x9000, "external error", CIA_301),
    named(0xA000, "change from PREOP to SAFEOP failed", ETG),
    named(0xA001, "change from SAFEOP to OP failed", ETG),
    named(0xF000, "additional functions", CIA_301),
    named(0xF001, "deceleration", CIA_402),
    named(0xF002, "sub-synchronous run", CIA_402),
    named(0xF003, "stroke operation", CIA_402),
    named(0xF004, "control", CIA_402),
    named(0xFF00, "device specific", CIA_301),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_in_order_and_named() {
        assert!(ALL.is_sorted_by(|a, b| a.code < b.code), "out of order, or twice");
        for entry in ALL {
            assert!(!entry.name.is_empty() && !entry.name.ends_with('.'), "0x{:04X}", entry.code);
        }
        assert_eq!(lookup(0x8611).name, "following error");
        assert_eq!(lookup(0x3210).name, "DC link overvoltage");
        let own = lookup(0x8613);
        assert_eq!((own.known, own.name), (false, "monitoring"));
    }

    #[test]
    fn every_number_has_something_to_do() {
        for code in 0..=u16::MAX {
            let actions = EmergencyClass::of(code).actions();
            assert!(!actions.is_empty() && actions.iter().all(|action| action.ends_with('.')));
        }
    }
}
