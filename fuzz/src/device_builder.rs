//! Devices made from files: SII images and device descriptions.

use std::sync::Arc;

use linesman_config::esi::Esi;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{DescriptionFiles, SegmentFile, TypeError};

/// Devices of one file that are built.
const MOST: usize = 2;
/// A device that is not up by then does not get there.
const PATIENCE: Span = Span::ms(60);
/// How long one that is up is looked at.
const LOOK: Span = Span::ms(6);

/// One file, by whatever name it is asked for, read once.
struct One<'a>(&'a [u8], Option<Arc<Esi>>);

impl DescriptionFiles for One<'_> {
    fn read(&self, _name: &str) -> Result<Vec<u8>, String> {
        Ok(self.0.to_vec())
    }

    fn descriptions(&self, _name: &str) -> Result<Arc<Esi>, TypeError> {
        Ok(self.1.clone().unwrap_or_default())
    }
}

/// Any bytes may be a file. What makes a device can be put into a segment; a MainDevice tries to bring
/// it up, and no counter moves without a cause.
pub fn device_builder(data: &[u8]) {
    let mut types = vec!["sii:F".to_owned()];
    let esi = Esi::parse(data).ok().map(Arc::new);
    if let Some(esi) = &esi {
        types = esi
            .usable()
            .take(MOST)
            .map(|one| format!("esi:F#0x{:08X}@0x{:08X}", one.product_code, one.revision))
            .collect();
    }
    let files = One(data, esi);
    for type_name in types {
        // Alone, or behind a coupler when it is entered from the E-bus.
        for (before, on) in [
            ("", "maindevice"),
            ("[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n", "K.B"),
        ] {
            let text = format!(
                "name = \"fuzz\"\n{before}[[device]]\nname = \"D\"\ntype = \"{type_name}\"\non = \"{on}\"\n"
            );
            if let Ok(file) = SegmentFile::parse_with(&text, &files) {
                bring_up(&file);
                break;
            }
        }
    }
}

fn bring_up(file: &SegmentFile) {
    // What the diagnosis makes of it is the business of another target.
    let options = LabOptions {
        cycle: Span::ms(1),
        project: false,
        probes: false,
        host_counters: false,
        ..LabOptions::default()
    };
    let mut lab = match Lab::new(file, options) {
        Ok(lab) => lab,
        Err(error) => panic!("what was checked can be built: {error}"),
    };
    let up = lab.run_while(PATIENCE, Span::ms(1), |lab| lab.is_up() || lab.failure().is_some());
    if up.expect("nobody gets stuck") {
        let until = lab.now() + LOOK;
        lab.run_until(until).expect("nobody gets stuck");
    }
    let unexplained = lab.audit();
    assert!(unexplained.is_empty(), "{unexplained:?}");
}
