//! Devices made from files: SII images and device descriptions.

use linesman_config::esi::Esi;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::{DescriptionFiles, SegmentFile};

/// Devices of one file that are built.
const MOST: usize = 2;

/// One file, by whatever name it is asked for.
struct One<'a>(&'a [u8]);

impl DescriptionFiles for One<'_> {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(self.0.to_vec())
    }
}

/// Any bytes may be a file. What makes a device can be put into a segment; a MainDevice tries to bring
/// it up, and no counter moves without a cause.
pub fn device_builder(data: &[u8]) {
    let mut types = vec!["sii:F".to_owned()];
    if let Ok(esi) = Esi::parse(data) {
        types = esi
            .usable()
            .take(MOST)
            .map(|one| format!("esi:F#0x{:08X}@0x{:08X}", one.product_code, one.revision))
            .collect();
    }
    for type_name in types {
        for (before, on) in [
            ("", "maindevice"),
            ("[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n", "K.B"),
        ] {
            let text = format!(
                "name = \"fuzz\"\n{before}[[device]]\nname = \"D\"\ntype = \"{type_name}\"\non = \"{on}\"\n"
            );
            if let Ok(file) = SegmentFile::parse_with(&text, &One(data)) {
                bring_up(&file);
            }
        }
    }
}

fn bring_up(file: &SegmentFile) {
    let mut lab = match Lab::new(file, LabOptions::default()) {
        Ok(lab) => lab,
        Err(error) => panic!("what was checked can be built: {error}"),
    };
    lab.run_until(Instant::ZERO + Span::ms(200)).expect("nobody gets stuck");
    let unexplained = lab.audit();
    assert!(unexplained.is_empty(), "{unexplained:?}");
}
