//! SII images of real devices.

use linesman_proto::sii::{Direction, Image};

use crate::data::{Collection, files, root};
use crate::up::{segment, to_op};

#[test]
fn every_image_of_the_collection_becomes_a_device_that_goes_to_op() {
    let (Some(root), Some(mut names)) = (root(), files("sii", ".bin")) else { return };
    names.extend(files("sii/pairs", ".bin").unwrap_or_default());
    let collection = Collection::new(root.clone());
    let mut failed = Vec::new();
    for name in &names {
        let result = segment(&format!("sii:{name}"), &collection).and_then(|file| to_op(&file));
        let lab = match result {
            Ok(lab) => lab,
            Err(reason) => {
                failed.push(format!("{name}: {reason}"));
                continue;
            }
        };
        let image = Image::parse(&std::fs::read(root.join(name)).unwrap()).unwrap();
        let found = lab.inventory().unwrap().devices.last().unwrap().clone();
        let identity = found.identity.unwrap();
        assert_eq!(
            (identity.vendor_id, identity.product_code, identity.revision),
            (image.identity.vendor_id, image.identity.product_code, image.identity.revision),
            "{name}"
        );
        for direction in [Direction::Outputs, Direction::Inputs] {
            let bytes: u32 = image
                .process_data()
                .filter(|data| data.direction == direction)
                .map(|data| data.bytes)
                .sum();
            if image.pdos(direction).next().is_some() {
                assert_eq!(found.profile.process_len(direction) as u32, bytes, "{name}");
            }
        }
    }
    println!("{} images, {} in OP", names.len(), names.len() - failed.len());
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
