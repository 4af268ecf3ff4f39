//! `linesman capture wireshark-profile`: colouring rules and filter buttons for Wireshark.

use std::fs;
use std::path::PathBuf;

use linesman_capture::wireshark;

use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The directory of the profile, such as ~/.config/wireshark/profiles/EtherCAT; made where it is missing
    #[arg(value_name = "DIR")]
    directory: PathBuf,
}

/// Does what was asked.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let directory = &arguments.directory;
    let name = directory.display();
    let all = [
        ("colorfilters", wireshark::colour_rules()),
        ("dfilter_buttons", wireshark::filter_buttons()),
    ];
    fs::create_dir_all(directory).map_err(|error| {
        let reason = format!("{name}: making the directory of the profile: {error}");
        Failure::new(reason, "name a directory that you may write to")
    })?;
    for (file, _) in &all {
        files::refuse_to_overwrite(&directory.join(file))?;
    }
    for (file, text) in &all {
        files::write_new(&directory.join(file), "the profile", text)?;
    }
    let profile = directory.file_name().unwrap_or_default().to_string_lossy();
    output.line(&format!(
        "{name}: colorfilters, dfilter_buttons written. Beneath the profiles of Wireshark \
         (Help > About > Folders) it is chosen by `wireshark -C {profile}`"
    ));
    Ok(Status::Good)
}
