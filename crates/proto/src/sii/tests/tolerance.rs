//! Damaged and odd images, one oddity at a time, and images of which nothing can be said.

use crate::sii::*;

/// An image with some of everything, as bytes up to the end marker.
fn sound() -> (Image, Vec<u8>) {
    let mut strings = Strings::new();
    let order = strings.intern("EL9999").unwrap();
    let name = strings.intern("A terminal").unwrap();
    let general = General { order, name, ..General::default() };
    let entry = PdoEntry { index: 0x6000, subindex: 1, name, bits: 3, ..PdoEntry::default() };
    let pdo =
        Pdo { index: 0x1A00, sync_manager: Some(0), entries: vec![entry; 3], ..Pdo::default() };
    let manager = SyncManager { kind: SyncManagerKind::Inputs, ..SyncManager::default() };
    let image = Image {
        identity: Identity { vendor_id: 2, ..Identity::default() },
        categories: vec![
            Category::Strings(strings),
            Category::General(Box::new(general)),
            Category::SyncManagers(vec![manager]),
            Category::TxPdos(vec![pdo]),
        ],
        ..Image::default()
    };
    let mut bytes = image.build().unwrap();
    let used = bytes.iter().rposition(|&byte| byte != 0xFF).unwrap() + 1 + 2;
    bytes.truncate(used);
    (image, bytes)
}

/// Fixed words of a sound image, then this.
fn with_categories(categories: &[u8]) -> Vec<u8> {
    let (_, bytes) = sound();
    [&bytes[..0x80], categories].concat()
}

#[track_caller]
fn oddities(bytes: &[u8]) -> Vec<(u32, OddityKind)> {
    let image = Image::parse(bytes).unwrap();
    image.oddities.iter().map(|oddity| (oddity.at.value(), oddity.kind)).collect()
}

#[test]
fn a_sound_image_has_nothing_odd() {
    let (image, bytes) = sound();
    assert_eq!(Image::parse(&bytes), Ok(image.clone()));
    assert_eq!(image.order(), Some("EL9999"));
    let data = ProcessData { sync_manager: 0, direction: Direction::Inputs, bits: 9, bytes: 2 };
    assert_eq!(image.process_data().collect::<Vec<_>>(), [data]);
    assert_eq!(image.pdo_bits(1, Direction::Inputs), 0);
    assert_eq!(image.pdo_bits(0, Direction::Outputs), 0);
    // The end marker may be the last word of all, without a length behind it.
    assert_eq!(bytes[bytes.len() - 2..], [0xFF, 0xFF]);
}

#[test]
fn nothing_can_be_said_of_short_and_blank_images() {
    let (_, bytes) = sound();
    assert_eq!(Image::parse(&[]), Err(SiiError::TooShort { len: 0 }));
    assert_eq!(Image::parse(&bytes[..31]), Err(SiiError::TooShort { len: 31 }));
    assert_eq!(Image::parse(&[0xFF; 2048]), Err(SiiError::Blank { byte: 0xFF }));
    assert_eq!(Image::parse(&[0x00; 2048]), Err(SiiError::Blank { byte: 0x00 }));
}

#[test]
fn an_image_of_the_identity_alone_is_judged() {
    let (_, bytes) = sound();
    for len in [32, 33, 0x40, 0x7F] {
        let image = Image::parse(&bytes[..len]).unwrap();
        assert_eq!(image.identity.vendor_id, 2);
        let at = (len / 2) as u32;
        assert_eq!(oddities(&bytes[..len]), [(at, OddityKind::HeaderCutOff)], "{len} bytes");
    }
}

#[test]
fn checksums_are_judged() {
    let (_, sound) = sound();
    let computed = sound[0x0E];
    let word = |low, high| {
        let mut bytes = sound.clone();
        bytes[0x0E..0x10].copy_from_slice(&[low, high]);
        bytes
    };
    let wrong = OddityKind::ChecksumWrong { found: u16::from(!computed), computed };
    assert_eq!(oddities(&word(!computed, 0)), [(7, wrong)]);
    assert_eq!(oddities(&word(0xA4, 0x88)), [(7, OddityKind::ChecksumSkipped)]);
    let found = 0x0100 | u16::from(computed);
    assert_eq!(oddities(&word(computed, 1)), [(7, OddityKind::ChecksumHighByte { found })]);
}

#[test]
fn an_image_without_its_end_is_read_as_far_as_it_goes() {
    let (image, bytes) = sound();
    let end = bytes.len() - 2;
    let at = (end / 2) as u32;
    assert_eq!(oddities(&bytes[..end]), [(at, OddityKind::NoEndMarker)]);
    // Cut within the PDO, whose data begin at the last category's header plus two words.
    let start = at - 16;
    let cut = &bytes[..end - 10];
    let cut_off =
        OddityKind::CategoryCutOff { kind: CategoryKind::TxPdos, announced: 16, found: 11 };
    let left = OddityKind::TrailingBytes { kind: CategoryKind::TxPdos, left: 6 };
    let pdo_cut = OddityKind::PdoCutOff { index: 0x1A00, announced: 3, found: 1 };
    assert_eq!(oddities(cut), [(start, cut_off), (start, pdo_cut), (start + 8, left)]);
    let parsed = Image::parse(cut).unwrap();
    assert_eq!(parsed.pdo_bits(0, Direction::Inputs), 3);
    assert_eq!(parsed.categories[..3], image.categories[..3]);
}

#[test]
fn zeros_in_place_of_the_end_marker_are_no_categories() {
    let (image, bytes) = sound();
    let end = bytes.len() - 2;
    let zeros = [&bytes[..end], &[0; 400]].concat();
    assert_eq!(oddities(&zeros), [((end / 2) as u32, OddityKind::EmptyHeaders)]);
    assert_eq!(Image::parse(&zeros).unwrap().categories, image.categories);
    // Seven empty headers may stand between categories, and are kept; the eighth is one too many.
    let empty = |headers| [&bytes[..end], [0; 4].repeat(headers).as_slice(), &[0xFF; 2]].concat();
    assert_eq!(oddities(&empty(7)), []);
    assert_eq!(Image::parse(&empty(7)).unwrap().categories.len(), image.categories.len() + 7);
    assert_eq!(oddities(&empty(8)), [((end / 2) as u32, OddityKind::EmptyHeaders)]);
}

#[test]
fn a_size_word_too_small_is_said() {
    let (mut image, bytes) = sound();
    image.size = Size(0);
    let built = image.build().unwrap();
    assert_eq!(built, [&bytes[..0x7C], &[0, 0], &bytes[0x7E..]].concat());
    let used = bytes.len() - 2;
    assert_eq!(oddities(&built), [(0x3E, OddityKind::BeyondSize { used, size: 128 })]);
}

#[test]
fn records_that_do_not_fill_their_category_are_said() {
    let sync_managers = [&[41, 0, 5, 0], [0; 10].as_slice(), &[0xFF, 0xFF]].concat();
    let left = OddityKind::TrailingBytes { kind: CategoryKind::SyncManagers, left: 2 };
    assert_eq!(oddities(&with_categories(&sync_managers)), [(0x46, left)]);
    let general = [&[30, 0, 8, 0], [0; 16].as_slice(), &[0xFF, 0xFF]].concat();
    let short = OddityKind::GeneralShort { len: 16 };
    assert_eq!(oddities(&with_categories(&general)), [(0x42, short)]);
    let long = [&[30, 0, 18, 0], [0; 36].as_slice(), &[0xFF, 0xFF]].concat();
    let left = OddityKind::TrailingBytes { kind: CategoryKind::General, left: 4 };
    assert_eq!(oddities(&with_categories(&long)), [(0x52, left)]);
}

#[test]
fn texts_that_are_not_there_are_said() {
    let cut = [10, 0, 2, 0, 3, 2, b'A', b'B', 0xFF, 0xFF];
    let kind = OddityKind::StringsCutOff { announced: 3, found: 1 };
    assert_eq!(oddities(&with_categories(&cut)), [(0x42, kind)]);
    let left = [10, 0, 3, 0, 1, 1, b'A', 0, 0, 0, 0xFF, 0xFF];
    let kind = OddityKind::TrailingBytes { kind: CategoryKind::Strings, left: 3 };
    assert_eq!(oddities(&with_categories(&left)), [(0x43, kind)]);
    // General asks for text 1 as group and for text 9 as group once more; there are none at all.
    let mut general = [0; 32];
    general[0] = 1;
    general[14] = 9;
    let bytes = [&[30, 0, 16, 0], general.as_slice(), &[0xFF, 0xFF]].concat();
    let missing = |index| OddityKind::StringMissing { index: StringIndex(index), count: 0 };
    assert_eq!(oddities(&with_categories(&bytes)), [(0x42, missing(1)), (0x49, missing(9))]);
    assert_eq!(Image::parse(&with_categories(&bytes)).unwrap().group(), None);
    // The second operation mode has a description that is not there, the first has neither.
    let mut modes = [0; 48];
    modes[24 + 19] = 4;
    let bytes = [&[60, 0, 24, 0], modes.as_slice(), &[0xFF, 0xFF]].concat();
    assert_eq!(oddities(&with_categories(&bytes)), [(0x42 + 12 + 9, missing(4))]);
}

#[test]
fn the_first_of_two_counts() {
    let two = [10, 0, 1, 0, 0, 0xFF, 10, 0, 1, 0, 0, 0xFF, 0xFF, 0xFF];
    let kind = OddityKind::Repeated { kind: CategoryKind::Strings };
    assert_eq!(oddities(&with_categories(&two)), [(0x43, kind)]);
}

#[test]
fn oddities_say_where_and_what() {
    let (_, bytes) = sound();
    let image = Image::parse(&bytes[..bytes.len() - 12]).unwrap();
    assert_eq!(
        image.oddities[0].to_string(),
        "SII word 0x0066: TxPDO (50) announces 16 words, 11 are left"
    );
    assert!(SiiError::Blank { byte: 0xFF }.to_string().contains("are all 0xFFFF"));
}

#[test]
fn what_does_not_fit_is_not_built() {
    let entries = vec![PdoEntry::default(); 256];
    let pdo = Pdo { index: 0x1A00, entries, ..Pdo::default() };
    let image = Image { categories: vec![Category::TxPdos(vec![pdo])], ..Image::default() };
    let error = BuildError::TooManyEntries { index: 0x1A00, entries: 256 };
    assert_eq!(image.build(), Err(error));
    let modes = Category::OpModes(vec![OpMode::default(); 6000]);
    let image = Image { categories: vec![modes], ..Image::default() };
    let error = BuildError::CategoryTooLong { kind: CategoryKind::OpModes, words: 72_000 };
    assert_eq!(image.build(), Err(error));
}

#[test]
fn a_reader_stops_where_the_size_word_says_unless_it_says_nothing() {
    let read = |size: u16| {
        let (_, mut bytes) = sound();
        bytes[0x7C..0x7E].copy_from_slice(&size.to_le_bytes());
        // A category of 1000 words that runs over the end of a 2 Kbit EEPROM.
        bytes.splice(0x80..0x80, [3, 0, 0xE8, 3]);
        bytes.resize(0x2_0000, 0);
        let mut reader = Reader::new();
        while let Some(words) = reader.needs() {
            let at = words.start.byte();
            reader.supply(&bytes[at..at + 8]);
        }
        reader.bytes().len()
    };
    assert_eq!(read(0x0001), 256);
    // Eight empty headers behind the category, and what a chunk brings beyond them.
    for size in [0x0000, 0xFFFF, 0x00FF] {
        assert_eq!(read(size), (0x84 + 2000 + 8 * 4usize).next_multiple_of(8), "0x{size:04X}");
    }
}

#[test]
fn an_interrupted_reading_gives_what_there_is() {
    let (_, bytes) = sound();
    let mut reader = Reader::new();
    reader.supply(&bytes[..0x90]);
    let needs = reader.needs().unwrap();
    assert_eq!(needs.start, WordAddress(0x48));
    let image = reader.clone().finish().unwrap();
    assert_eq!(image.identity.vendor_id, 2);
    assert!(matches!(image.oddities[0].kind, OddityKind::CategoryCutOff { .. }));
    assert_eq!(Reader::default().finish(), Err(SiiError::TooShort { len: 0 }));
}
