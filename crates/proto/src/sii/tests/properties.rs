//! Any image that can be built is read again as it was, and any bytes are read without harm.

use proptest::collection::vec;
use proptest::prelude::*;

use crate::sii::*;

fn index() -> impl Strategy<Value = StringIndex> {
    any::<u8>().prop_map(StringIndex)
}

fn pairs() -> impl Strategy<Value = MailboxPair> {
    any::<[u16; 4]>().prop_map(MailboxPair::from_words)
}

fn configurations() -> impl Strategy<Value = Configuration> {
    any::<[u8; 14]>().prop_map(|bytes| Configuration::from_bytes(&bytes))
}

fn identities() -> impl Strategy<Value = Identity> {
    // Neither 0 nor all ones, so that no image is blank.
    (1..u32::MAX, any::<[u32; 3]>()).prop_map(|(vendor_id, [product_code, revision, serial])| {
        Identity { vendor_id, product_code, revision, serial_number: serial }
    })
}

fn strings() -> impl Strategy<Value = Category> {
    vec("\\PC{0,60}", 0..20).prop_map(|texts| {
        let mut strings = Strings::new();
        for text in texts {
            strings.push(SiiString::new(&text).unwrap()).unwrap();
        }
        Category::Strings(strings)
    })
}

fn generals() -> impl Strategy<Value = Category> {
    any::<[u8; 32]>().prop_map(|bytes| Category::General(Box::new(General::from_bytes(&bytes))))
}

fn pdos() -> impl Strategy<Value = Vec<Pdo>> {
    let entries = vec(any::<[u8; 8]>().prop_map(PdoEntry::from_bytes), 0..12);
    let pdo = (any::<(u16, u8, u16)>(), prop::option::of(0..0xFFu8), index(), entries);
    vec(
        pdo.prop_map(|((index, synchronization, flags), sync_manager, name, entries)| Pdo {
            index,
            sync_manager,
            synchronization,
            name,
            flags: PdoFlags(flags),
            entries,
        }),
        0..6,
    )
}

fn op_modes() -> impl Strategy<Value = Category> {
    let mode = vec(any::<u8>(), OpMode::LEN)
        .prop_map(|bytes| OpMode::from_bytes(bytes.first_chunk().unwrap()));
    vec(mode, 0..4).prop_map(Category::OpModes)
}

fn raws() -> impl Strategy<Value = Category> {
    let kinds = prop_oneof![Just(0), 1u16..10, Just(20), 42u16..44, 70u16..80, 0x8000..0xFFFFu16];
    (kinds, vec(any::<[u8; 2]>(), 1..20)).prop_map(|(kind, words)| {
        let raw = RawCategory::new(CategoryKind::from_code(kind), words.concat()).unwrap();
        Category::Raw(raw)
    })
}

fn categories() -> impl Strategy<Value = Vec<Category>> {
    let usage = any::<[u8; 2]>().prop_map(|pair| pair.map(FmmuUsage::from_code));
    let managers = vec(any::<[u8; 8]>().prop_map(SyncManager::from_bytes), 0..6);
    vec(
        prop_oneof![
            strings(),
            generals(),
            vec(usage, 0..4).prop_map(|usages| Category::Fmmu(usages.concat())),
            managers.prop_map(Category::SyncManagers),
            pdos().prop_map(Category::TxPdos),
            pdos().prop_map(Category::RxPdos),
            op_modes(),
            raws(),
        ],
        0..8,
    )
}

fn images() -> impl Strategy<Value = Image> {
    let head = (
        configurations(),
        prop_oneof![Just(Checksum::Valid), Just(Checksum::Skipped)],
        identities(),
        any::<[u16; 4]>(),
    );
    let mailboxes = (pairs(), pairs(), any::<u16>().prop_map(Protocols));
    let tail = (vec(any::<u16>(), 33), 0u16..64, any::<u16>(), categories());
    (head, mailboxes, tail).prop_map(|(head, mailboxes, tail)| {
        let (configuration, checksum, identity, legacy_delays) = head;
        let (bootstrap_mailbox, standard_mailbox, protocols) = mailboxes;
        let (vendor_words, size, version, categories) = tail;
        Image {
            configuration,
            checksum,
            identity,
            legacy_delays,
            bootstrap_mailbox,
            standard_mailbox,
            protocols,
            vendor_words: *vendor_words.first_chunk().unwrap(),
            size: Size(size),
            version,
            categories,
            oddities: Vec::new(),
        }
    })
}

/// An image without what was odd about its bytes.
fn meaning(mut image: Image) -> Image {
    image.oddities.clear();
    image
}

/// Bytes that look like an image as far as chance allows, cut anywhere.
fn near_images() -> impl Strategy<Value = Vec<u8>> {
    let kinds =
        prop_oneof![Just(0u16), Just(10), Just(30), 40u16..44, 50u16..52, Just(60), any::<u16>()];
    let lens = prop_oneof![9 => 0u16..20, 1 => any::<u16>()];
    let category = (kinds, lens, vec(any::<u8>(), 0..40)).prop_map(|(kind, len, data)| {
        [kind.to_le_bytes().as_slice(), &len.to_le_bytes(), &data].concat()
    });
    (vec(any::<u8>(), 128), vec(category, 0..6), 0usize..400).prop_map(|(head, rest, cut)| {
        let mut bytes = [head, rest.concat()].concat();
        bytes.truncate(cut.max(bytes.len().saturating_sub(cut)));
        bytes
    })
}

proptest! {
    #[test]
    fn what_is_built_is_read_again(image in images()) {
        let built = image.build().unwrap();
        prop_assert!(built.len() >= image.size.bytes());
        let parsed = Image::parse(&built).unwrap();
        for oddity in &parsed.oddities {
            // Chance makes texts that are not there and two Generals, but no broken layout.
            let expected = matches!(
                oddity.kind,
                OddityKind::StringMissing { .. }
                    | OddityKind::Repeated { .. }
                    | OddityKind::ChecksumSkipped
                    | OddityKind::BeyondSize { .. }
            );
            prop_assert!(expected, "{oddity}");
        }
        prop_assert_eq!(meaning(parsed), image);
    }

    #[test]
    fn hostile_bytes_are_read_or_refused(bytes in near_images()) {
        let Ok(image) = Image::parse(&bytes) else { return Ok(()) };
        // What could be understood is understood again.
        let built = image.build().unwrap();
        let again = Image::parse(&built).unwrap();
        prop_assert_eq!(meaning(again), meaning(image));
    }

    #[test]
    fn reading_word_by_word_finds_the_same_image(image in images(), chunk in 1usize..5) {
        let mut image = image;
        image.size = Size::for_bytes(image.build().unwrap().len());
        let built = image.build().unwrap();
        let mut reader = Reader::new();
        while let Some(words) = reader.needs() {
            let at = words.start.byte();
            prop_assert_eq!(at, reader.bytes().len());
            let end = (at + 2 * chunk).min(built.len());
            prop_assert!(at < end, "word {} is asked for, behind the end", words.start);
            reader.supply(&built[at..end]);
        }
        prop_assert!(reader.bytes().len() <= built.len());
        prop_assert_eq!(meaning(reader.finish().unwrap()), image);
    }

    #[test]
    fn reading_garbage_comes_to_an_end(bytes in near_images(), limit in 0u32..300) {
        let mut reader = Reader::with_limit(WordAddress(limit));
        let mut commands = 0;
        while let Some(words) = reader.needs() {
            prop_assert!(words.start < words.end && words.end.value() <= limit);
            let at = words.start.byte();
            // Behind its end this EEPROM begins again, as real ones do.
            let chunk: Vec<u8> = bytes.iter().copied().cycle().skip(at).take(4).collect();
            if chunk.is_empty() {
                break;
            }
            reader.supply(&chunk);
            commands += 1;
            prop_assert!(commands <= limit);
        }
        // Nothing but the content decides whether there is an image.
        let _ = reader.finish();
    }
}
