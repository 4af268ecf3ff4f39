use super::*;
use crate::register;
use proptest::prelude::*;

fn title(address: u16) -> Option<String> {
    describe(RegisterAddress(address)).map(|found| found.title())
}

// proves: HW-13 partial, HW-08 partial, HW-21 partial
#[test]
fn addresses_have_titles() {
    let table = [
        (0x0000, "ESC type"),
        (0x0130, "AL status"),
        (0x0131, "AL status"),
        (0x0300, "RX error counter, port A"),
        (0x0306, "RX error counter, port D"),
        (0x0307, "RX error counter, port D"),
        (0x030A, "forwarded RX error counter, port C"),
        (0x030C, "processing unit error counter"),
        (0x0313, "lost link counter, port D"),
        (0x0400, "watchdog divider"),
        (0x0600, "FMMU 0"),
        (0x06FF, "FMMU 15"),
        (0x080D, "SyncManager 1"),
        (0x090C, "receive time, port D"),
        (0x0FFF, "user RAM"),
    ];
    for (address, expected) in table {
        assert_eq!(title(address).as_deref(), Some(expected), "{address:#06X}");
    }
}

#[test]
fn reserved_addresses_and_process_ram_have_none() {
    for address in [0x000A, 0x0014, 0x0112, 0x0132, 0x0136, 0x0328, 0x0880, 0x0FFF + 1, 0xFFFF] {
        assert_eq!(title(address), None, "{address:#06X}");
    }
}

#[test]
fn a_byte_inside_a_register_has_its_fields() {
    let fields = |address| {
        let found = describe(RegisterAddress(address)).unwrap();
        found.fields().map(|field| field.name).collect::<Vec<_>>()
    };
    assert_eq!(fields(0x0306), ["invalid frames"]);
    assert_eq!(fields(0x0307), ["physical-layer errors"]);
    assert_eq!(fields(0x060B), ["reads", "writes"]);
    assert_eq!(describe(RegisterAddress(0x0817)).unwrap().start(), RegisterAddress(0x0810));
    assert_eq!(describe(RegisterAddress(0x0817)).unwrap().offset, 7);
}

#[test]
fn names_are_found_however_they_are_written() {
    for name in ["AL status", "al-status", "AL_STATUS", "alstatus", "Al Status"] {
        assert_eq!(by_name(name).unwrap().address, register::AL_STATUS.address, "{name}");
    }
    assert_eq!(by_name("rx-error-counter").unwrap().address.0, 0x0300);
    assert!(by_name("").is_none() && by_name("AL").is_none());
}

// proves: SW-01 partial, ESC-14 partial, HW-13 partial
#[test]
fn summaries_for_a_decoder() {
    let table: [(&Register, &[u8], &str); 17] = [
        (&register::AL_STATUS, &[0x08, 0x00], "OP"),
        (&register::AL_STATUS, &[0x12, 0x00], "PREOP, error"),
        (&register::AL_STATUS, &[0x18], "OP, error"),
        (&register::AL_CONTROL, &[0x11, 0x00], "INIT, error acknowledge"),
        (&register::AL_STATUS_CODE, &[0x1E, 0x00], "0x001E invalid input configuration"),
        (&register::STATION_ADDRESS, &[0xE9, 0x03], "0x03E9"),
        (&register::RX_ERROR_COUNTER, &[0x12, 0x04], "invalid frames 18, physical-layer errors 4"),
        (&register::LOST_LINK_COUNTER, &[3], "3"),
        (&register::WATCHDOG_TIME_PROCESS_DATA, &[0xE8, 0x03], "1000 ticks"),
        (&register::PDI_CONTROL, &[0x05], "SPI slave"),
        (&register::PDI_CONTROL, &[0x60], "unknown (0x60)"),
        (&register::ECAT_EVENT_REQUEST, &[0x24, 0x00], "DL status, SyncManager 1"),
        (&register::ECAT_EVENT_REQUEST, &[0x00, 0x00], "nothing set"),
        (&register::SYSTEM_TIME_DIFFERENCE, &[0x78, 0, 0, 0x80], "-120 ns"),
        (&register::SYSTEM_TIME_DIFFERENCE, &[0x78, 0, 0, 0x00], "120 ns"),
        (&register::SPEED_COUNTER_DIFF, &[0xFE, 0xFF], "-2 counts"),
        (
            &register::DL_STATUS,
            &[0x17],
            "PDI operational, PDI watchdog OK, enhanced link detection, link, port A",
        ),
    ];
    for (register, data, expected) in table {
        assert_eq!(summary(register, data), expected, "{}", register.name);
    }
    assert!(summary(&register::DL_STATUS, &[0x17, 0x56]).starts_with("A carrier, open; B no"));
}

/// Many MainDevices read and write the low half of 64-bit times only.
#[test]
fn the_low_part_of_a_number_is_told_as_such() {
    let low = decode(&register::SYSTEM_TIME, &[0x40, 0x42, 0x0F, 0x00]);
    assert_eq!((low[0].value, low[0].partial), (1_000_000, true));
    assert_eq!(low[0].text, "1000000 ns (low 32 bits)");
    let whole = decode(&register::SYSTEM_TIME, &[0x40, 0x42, 0x0F, 0, 0, 0, 0, 0]);
    assert_eq!((whole[0].text.as_str(), whole[0].partial), ("1000000 ns", false));
    // The sign would be missing.
    assert!(decode(&register::SYSTEM_TIME_OFFSET, &[0xFF; 4]).is_empty());
}

#[test]
fn fields_of_a_sync_manager() {
    let data = [0x00, 0x18, 0x00, 0x04, 0x26, 0x30, 0x01, 0x00];
    let readings = decode(&register::SYNC_MANAGER, &data);
    let text = |name: &str| {
        readings.iter().find(|reading| reading.field.name == name).map(|found| found.text.as_str())
    };
    assert_eq!(readings.len(), register::SYNC_MANAGER.fields.len());
    assert_eq!(text("start address"), Some("0x1800"));
    assert_eq!(text("length"), Some("1024 bytes"));
    assert_eq!(text("mode"), Some("mailbox"));
    assert_eq!(text("direction"), Some("MainDevice writes"));
    assert_eq!(text("PDI interrupt"), Some("yes"));
    assert_eq!(text("mailbox full"), Some("no"));
    assert_eq!(text("last buffer"), Some("none"));
    assert_eq!(text("enabled"), Some("yes"));
}

#[test]
fn a_read_across_registers_is_cut_at_their_borders() {
    // How a common MainDevice polls: AL status, two reserved bytes, AL status code.
    let data = [0x12, 0x00, 0xFF, 0xFF, 0x1E, 0x00];
    let found: Vec<(u16, usize, Option<String>)> = pieces(RegisterAddress(0x0130), &data)
        .map(|piece| (piece.address.0, piece.data.len(), piece.summary()))
        .collect();
    assert_eq!(
        found,
        [
            (0x0130, 2, Some("PREOP, error".to_owned())),
            (0x0132, 2, None),
            (0x0134, 2, Some("0x001E invalid input configuration".to_owned())),
        ]
    );
}

#[test]
fn a_read_may_begin_inside_a_register() {
    let found: Vec<Option<String>> =
        pieces(RegisterAddress(0x080D), &[0x08, 0x01]).map(|piece| piece.summary()).collect();
    assert_eq!(found, [Some("mailbox full, last buffer first, enabled".to_owned())]);
    // The high byte of DL status alone.
    let high: Vec<Option<String>> =
        pieces(RegisterAddress(0x0111), &[0x56]).map(|piece| piece.summary()).collect();
    assert!(high[0].as_ref().unwrap().starts_with("A communication, open; B no communication"));
}

#[test]
fn process_ram_is_one_piece_up_to_the_end_of_memory() {
    let data = [0; 32];
    let found: Vec<(u16, usize)> = pieces(RegisterAddress(0x0FFE), &data)
        .map(|piece| (piece.address.0, piece.data.len()))
        .collect();
    assert_eq!(found, [(0x0FFE, 2), (0x1000, 30)]);
    let behind: usize = pieces(RegisterAddress(0xFFF8), &data).map(|piece| piece.data.len()).sum();
    assert_eq!(behind, 8);
}

/// `describe` agrees with a search through the whole table, for every address.
#[test]
fn describe_agrees_with_a_plain_search() {
    for address in 0..=u16::MAX {
        let plain = ALL.iter().find_map(|register| {
            (0..register.count()).find_map(|index| {
                let start = register.at(index).unwrap().0;
                let inside = (start..start + register.len).contains(&address);
                inside.then(|| (register.name, index, address - start))
            })
        });
        let found = describe(RegisterAddress(address))
            .map(|found| (found.register.name, found.index, found.offset));
        assert_eq!(found, plain, "{address:#06X}");
    }
}

proptest! {
    /// Every byte of every read is told exactly once, in order, and nothing panics.
    #[test]
    fn pieces_cover_all_that_exists(
        start: u16,
        data in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        let exists = data.len().min(0x1_0000 - usize::from(start));
        let mut position = usize::from(start);
        for piece in pieces(RegisterAddress(start), &data) {
            prop_assert_eq!(usize::from(piece.address.0), position);
            prop_assert!(!piece.data.is_empty());
            prop_assert_eq!(piece.data, &data[position - usize::from(start)..][..piece.data.len()]);
            let described = describe(piece.address).map(|found| found.title());
            prop_assert_eq!(piece.description.map(|found| found.title()), described);
            let _ = piece.summary();
            position += piece.data.len();
        }
        prop_assert_eq!(position - usize::from(start), exists);
    }

    /// Decoding any bytes of any register works on data of any length.
    #[test]
    fn any_data_can_be_decoded(
        index in 0..ALL.len(),
        offset in 0u16..20,
        data in proptest::collection::vec(any::<u8>(), 0..140),
    ) {
        let register = &ALL[index];
        for reading in decode_at(register, offset, &data) {
            prop_assert!(!reading.text.is_empty());
            if reading.field.width() < 64 {
                prop_assert!(reading.value < 1 << reading.field.width());
            }
        }
        prop_assert!(!summary_at(register, offset, &data).is_empty() || data.is_empty());
    }
}
