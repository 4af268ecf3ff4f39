//! Register writes of any kind: a device stays a device.

use linesman_proto::time::Span;
use proptest::prelude::*;

use super::Device;

const TYPES: [&str; 7] = ["EK1101", "EL2008", "EL2014", "EL3102", "EL4102", "EL7041", "EP2308"];

/// What a bad MainDevice, or a bad supply, may do.
#[derive(Clone, Debug)]
enum Deed {
    Write {
        at: u16,
        data: Vec<u8>,
    },
    AlControl(u8),
    SetUp,
    /// The way to OP, as far as it leads.
    Climb,
    Exchange(Vec<u8>),
    Wait(u64),
    Restart,
}

fn deed() -> impl Strategy<Value = Deed> {
    let bytes = |most| proptest::collection::vec(any::<u8>(), 1..most);
    let near_registers =
        prop_oneof![0x0120u16..0x0122, 0x0400u16..0x0450, 0x0600u16..0x0640, 0x0800u16..0x0820];
    prop_oneof![
        4 => prop::sample::select(vec![1u8, 2, 4, 8, 0x11, 0x12, 0x14, 0x18, 3, 5])
            .prop_map(Deed::AlControl),
        2 => Just(Deed::SetUp),
        3 => Just(Deed::Climb),
        3 => bytes(4).prop_map(Deed::Exchange),
        2 => (near_registers, bytes(9)).prop_map(|(at, data)| Deed::Write { at, data }),
        1 => (0x0F00u16..0x1400, bytes(64)).prop_map(|(at, data)| Deed::Write { at, data }),
        3 => (1u64..200_000).prop_map(Deed::Wait),
        1 => Just(Deed::Restart),
    ]
}

fn act(device: &mut Device, deed: &Deed) {
    match deed {
        Deed::Write { at, data } => {
            device.bench.write(*at, data);
        }
        Deed::AlControl(value) => {
            device.bench.write(0x0120, &[*value, 0]);
        }
        Deed::SetUp => {
            for manager in 0..4 {
                device.bench.write(0x0806 + 8 * manager, &[0]);
            }
            device.set_up_mailbox();
            device.set_up_process_data();
        }
        Deed::Climb => {
            act(device, &Deed::AlControl(0x11));
            act(device, &Deed::Wait(2_000));
            act(device, &Deed::SetUp);
            for state in [2, 4, 8] {
                act(device, &Deed::AlControl(state));
                act(device, &Deed::Wait(40_000));
                act(device, &Deed::Exchange(vec![0x55, 0x2A, 0x55]));
            }
        }
        Deed::Exchange(outputs) => {
            let len = device.profile.process_len(linesman_proto::sii::Direction::Outputs);
            device.exchange(&outputs[..outputs.len().min(len)]);
        }
        Deed::Wait(us) => device.bench.wait(Span::us(*us)),
        Deed::Restart => {
            let now = device.bench.now;
            device.bench.controller.power_off(now);
            device.bench.wait(Span::us(1));
            let now = device.bench.now;
            device.bench.controller.power_on(now);
            device.bench.wait(Span::ms(200));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]
    #[test]
    fn its_states_and_outputs_stay_sound(
        name in prop::sample::select(TYPES.to_vec()),
        deeds in proptest::collection::vec(deed(), 1..60),
    ) {
        let mut device = Device::of(name);
        let position = name == "EL7041";
        for deed in &deeds {
            act(&mut device, deed);
            let status = device.bench.controller.al_status();
            let code = device.bench.controller.al_code();
            let operational = status.value() & 0x0F == 8;
            if !device.profile.device_emulation {
                prop_assert!([1, 2, 3, 4, 8].contains(&(status.value() & 0x0F)), "{status}");
                prop_assert_eq!(status.error(), code.value() != 0, "{} {:?}", status, code);
            }
            if !operational && !position {
                for signal in &device.built.outputs {
                    prop_assert_eq!(device.bench.signals.value(*signal), 0, "{}", status);
                }
            }
        }
        // A restart mends everything.
        act(&mut device, &Deed::Restart);
        device.bring_up();
        device.exchange_some();
    }
}
