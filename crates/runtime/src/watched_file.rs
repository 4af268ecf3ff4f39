//! File that is being written, or socket that is listened on: whether its path still leads to it.
//!
//! What is written to a file that somebody has removed is lost without an error.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// A path, and what it led to at first.
#[derive(Clone, Debug)]
pub(crate) struct WatchedFile {
    path: PathBuf,
    was: Option<(u64, u64)>,
}

impl WatchedFile {
    /// What is at the path now.
    pub(crate) fn at(path: &Path) -> Self {
        Self { path: path.to_owned(), was: identity(path) }
    }

    /// Says that the path leads nowhere any more, or to another file.
    ///
    /// # Errors
    /// Then.
    pub(crate) fn check(&self) -> io::Result<()> {
        if self.was.is_some() && identity(&self.path) != self.was {
            let what = "it was removed or replaced meanwhile";
            return Err(io::Error::new(io::ErrorKind::NotFound, what));
        }
        Ok(())
    }

    /// The path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

fn identity(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().map(|found| (found.dev(), found.ino()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_removed_or_replaced_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("log"), folder.path().join("other"));
        fs::write(&path, "one").unwrap();
        fs::write(&other, "two").unwrap();
        let kept = WatchedFile::at(&path);
        fs::write(&path, "more").unwrap();
        assert!(kept.check().is_ok());
        fs::rename(&other, &path).unwrap();
        assert!(kept.check().is_err());
        fs::remove_file(&path).unwrap();
        let error = kept.check().unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
