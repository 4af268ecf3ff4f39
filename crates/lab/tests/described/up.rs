//! One described device, brought up.

use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{DescriptionFiles, SegmentFile};

/// A segment of this type alone, behind a coupler when it is entered from the E-bus.
pub(crate) fn segment(
    type_name: &str,
    files: &dyn DescriptionFiles,
) -> Result<SegmentFile, String> {
    let alone = format!(
        "name = \"alone\"\n[[device]]\nname = \"D\"\ntype = {type_name:?}\non = \"maindevice\"\n"
    );
    let behind = format!(
        "name = \"behind\"\n[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"D\"\ntype = {type_name:?}\non = \"K.B\"\n"
    );
    SegmentFile::parse_with(&alone, files)
        .or_else(|error| SegmentFile::parse_with(&behind, files).map_err(|_| error))
        .map_err(|error| error.to_string())
}

/// Brings a segment to OP by our own MainDevice, and keeps it there for a while.
pub(crate) fn to_op(file: &SegmentFile) -> Result<Lab, String> {
    stay_up(Lab::new(file, LabOptions::default()).map_err(|error| error.to_string())?)
}

/// Waits until all is up, and sees that it stays so.
pub(crate) fn stay_up(mut lab: Lab) -> Result<Lab, String> {
    lab.wait_up(Span::s(20)).map_err(|error| error.to_string())?;
    let until = lab.now() + Span::ms(300);
    lab.run_until(until).map_err(|error| error.to_string())?;
    if !lab.is_up() {
        return Err("it left OP again".to_owned());
    }
    Ok(lab)
}
