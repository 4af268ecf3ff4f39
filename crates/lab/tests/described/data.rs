//! The collection of real files.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use linesman_config::esi::Esi;
use linesman_sim::segment_file::{DescriptionFiles, TypeError};

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
pub(crate) struct Collection {
    root: PathBuf,
    known: RefCell<BTreeMap<String, Arc<Esi>>>,
}

impl Collection {
    pub(crate) fn new(root: PathBuf) -> Self {
        Self { root, known: RefCell::default() }
    }
}

impl DescriptionFiles for Collection {
    fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        fs::read(self.root.join(name)).map_err(|error| error.to_string())
    }

    fn descriptions(&self, name: &str) -> Result<Arc<Esi>, TypeError> {
        if let Some(known) = self.known.borrow().get(name) {
            return Ok(Arc::clone(known));
        }
        let bytes = fs::read(self.root.join(name)).expect("a file of the collection");
        let esi = Arc::new(Esi::parse(&bytes).unwrap_or_else(|error| panic!("{name}: {error}")));
        self.known.borrow_mut().insert(name.to_owned(), Arc::clone(&esi));
        Ok(esi)
    }
}
