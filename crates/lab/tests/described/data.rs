//! The collection of real files.

use std::fs;
use std::path::PathBuf;

use linesman_sim::segment_file::DescriptionFiles;

/// Where the collection is; `None`, and a word about it, when it is not there.
pub(crate) fn root() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = PathBuf::from(std::env::var("LINESMAN_DATA").unwrap_or_else(|_| beside.to_owned()));
    if !root.is_dir() {
        eprintln!("SKIPPED: no real data in {} (set LINESMAN_DATA)", root.display());
        return None;
    }
    Some(root)
}

/// All files of a folder with this ending, in order, relative to the collection.
pub(crate) fn files(folder: &str, ending: &str) -> Option<Vec<String>> {
    let root = root()?;
    let entries = fs::read_dir(root.join(folder)).expect("the folder can be read");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(ending))
        .map(|name| format!("{folder}/{name}"))
        .collect();
    names.sort();
    assert!(!names.is_empty(), "{folder} has no *{ending}");
    Some(names)
}

/// Files of the collection.
pub(crate) struct Collection(pub(crate) PathBuf);

impl DescriptionFiles for Collection {
    fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        fs::read(self.0.join(name)).map_err(|error| error.to_string())
    }
}
