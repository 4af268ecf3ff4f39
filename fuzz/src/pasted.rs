//! Pasted texts: decoded, read and judged.

use linesman_diagnosis::Setup;
use linesman_diagnosis::pasted::{self, Pasted};

/// Any bytes may be given. What is understood is judged, the answer can be written, and each line is counted at most
/// once.
pub fn pasted(data: &[u8]) {
    let text = pasted::decode(data);
    let Ok(Pasted { file, understood }) = pasted::read(&text) else { return };
    let lines = text.split('\n').count();
    let mut last = 0;
    for block in &understood.blocks {
        assert!(
            last < block.from && block.from <= block.to && block.to <= lines,
            "{block:?} of {lines}"
        );
        last = block.to;
    }
    assert!(understood.ignored_count <= lines, "{} of {lines}", understood.ignored_count);
    assert!(file.project().tree().is_ok(), "the wiring fits together");
    let diagnosis = file.diagnosis(Setup::default());
    serde_json::to_string(&diagnosis).expect("the answer can be written");
}
