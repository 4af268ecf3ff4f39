//! The library as a MainDevice finds it.

use linesman_config::profile::DeviceProfile;
use linesman_proto::sii::{Direction, Image};

use super::{LibraryType, build, find, types};
use crate::device::Signals;

#[test]
fn every_type_is_found_once_and_bears_a_sound_image() {
    let mut names: Vec<&str> = types().map(LibraryType::name).collect();
    for name in &names {
        let mut signals = Signals::default();
        let built = build(&name.to_lowercase(), 4_711, &mut signals).unwrap();
        assert_eq!(built.len(), find(name).unwrap().ports().count());
        let mut channels = 0;
        for one in &built {
            let image = Image::parse(&one.sii).unwrap();
            assert_eq!(image.oddities, [], "{name}");
            assert_eq!(image.identity.vendor_id, 2, "{name}");
            assert_eq!(image.identity.serial_number, 4_711, "{name}");
            assert_eq!(image.build().unwrap(), one.sii, "{name}");
            assert!(!one.sii.is_empty());
            channels += one.outputs.len() + one.inputs.len();
        }
        assert_eq!(channels, signals.len(), "{name}: every channel is a signal");
        assert_eq!(DeviceProfile::from_sii(&Image::parse(&built[0].sii).unwrap()).type_name, *name);
    }
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
}

#[test]
fn an_unknown_type_is_told_with_what_there_is_instead() {
    let error = build("EL1009", 0, &mut Signals::default()).unwrap_err().to_string();
    assert!(error.contains("EL1009") && error.contains("EL1008"), "{error}");
    assert!(!error.contains("EK1100"), "{error}");
    let error = build("", 0, &mut Signals::default()).unwrap_err().to_string();
    assert!(error.contains("EK1100"), "{error}");
}

#[test]
fn profiles_of_digital_terminals() {
    // type, direction, start, bytes, control
    let table = [
        ("EL1004", Direction::Inputs, 0x1000, 1, 0x00),
        ("EL1008", Direction::Inputs, 0x1000, 1, 0x00),
        ("EL2004", Direction::Outputs, 0x0F00, 1, 0x44),
        ("EL2008", Direction::Outputs, 0x0F00, 1, 0x44),
        ("EK1101", Direction::Inputs, 0x1000, 2, 0x00),
    ];
    for (name, direction, start, len, control) in table {
        let built = build(name, 1, &mut Signals::default()).unwrap();
        let profile = DeviceProfile::from_sii(&Image::parse(&built[0].sii).unwrap());
        assert!(profile.mailbox.is_none() && profile.device_emulation, "{name}");
        let [manager] = profile.process[..] else { panic!("{name}: {profile:?}") };
        assert_eq!((manager.index, manager.direction), (0, direction), "{name}");
        assert_eq!((manager.start.0, manager.len, manager.control.0), (start, len, control));
    }
}
