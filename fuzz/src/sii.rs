//! SII images: read whole, read piece by piece, built again.

use linesman_proto::sii::{Direction, Image, Reader};

/// Any bytes may be an image. Asking for it piece by piece, as over the wire, ends; and what we
/// build from an image is read as that image.
pub fn sii(data: &[u8]) {
    let mut reader = Reader::new();
    let mut asked = 0;
    while let Some(words) = reader.needs() {
        asked += 1;
        assert!(asked < 0x10000, "the reader never has enough");
        let start = words.start.byte();
        let end = words.end.byte();
        assert!(start < end, "the reader asks for nothing");
        let Some(piece) = data.get(start..end.min(data.len())) else { break };
        if piece.len() < 2 {
            break;
        }
        // Four or eight bytes at a time is what controllers hand out.
        reader.supply(&piece[..piece.len().min(8)]);
    }
    let _ = reader.finish();

    let Ok(image) = Image::parse(data) else { return };
    let _ = (image.name(), image.order(), image.group(), image.mailbox(), image.ebus_current_ma());
    let _ = image.op_modes().count() + image.process_data().count();
    for direction in [Direction::Inputs, Direction::Outputs] {
        for pdo in image.pdos(direction) {
            let _ = pdo.bits();
        }
    }
    let Ok(built) = image.build() else { return };
    let again = Image::parse(&built).expect("what we build is an image");
    assert_eq!(again.identity, image.identity);
    assert_eq!(again.configuration, image.configuration);
    // What was odd is gone by now (a row of empty headers is taken for filling only when it is
    // whole, which cutting off the last of them may have hidden). From here on nothing changes.
    let built = again.build().expect("it was built before");
    let again = Image::parse(&built).expect("what we build is an image");
    assert_eq!(again.build().expect("it was built before"), built);
}
