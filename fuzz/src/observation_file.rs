//! Observation files: read and judged.

use linesman_diagnosis::Setup;
use linesman_diagnosis::observation_file::ObservationFile;

/// Any text may be given. What reads is judged, and the answer can be written.
pub fn observation_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(file) = ObservationFile::parse(text) else { return };
    let diagnosis = file.diagnosis(Setup::default());
    serde_json::to_string(&diagnosis).expect("the answer can be written");
}
