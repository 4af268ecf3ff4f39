//! Files that are there as a whole or not at all.
//!
//! Reference: open(2) `O_TMPFILE`, linkat(2), renameat2(2). A new file has no name while it is written:
//! when the disk is full, or the program ends meanwhile, nothing stays. File systems without such files
//! (FAT) get one beside it, which is renamed.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::os::fd::AsRawFd as _;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, RenameFlags, linkat, openat, renameat_with};
use rustix::io::Errno;

/// Writes a file that is not there yet.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`] when it is there, and whatever the system refuses; then there is
/// no file.
pub fn create(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match nameless(path)? {
        Some(mut file) => {
            file.write_all(bytes)?;
            file.sync_data()?;
            let itself = format!("/proc/self/fd/{}", file.as_raw_fd());
            match linkat(CWD, itself, CWD, path, AtFlags::SYMLINK_FOLLOW) {
                // Where /proc is not to be had.
                Err(Errno::NOENT) => create_beside(path, bytes),
                result => Ok(result?),
            }
        }
        None => create_beside(path, bytes),
    }
}

/// Writes a file in place of the one that is there, which stays as it is until the new one is whole.
///
/// # Errors
/// Whatever the system refuses; then the old one is still there.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let beside = Beside::write(path, bytes)?;
    if let Ok(old) = fs::metadata(path) {
        fs::set_permissions(&beside.0, old.permissions())?;
    }
    fs::rename(&beside.0, path)
}

/// A file without a name in the folder of `path`; `None` where the file system has none.
fn nameless(path: &Path) -> io::Result<Option<File>> {
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    match openat(CWD, folder(path), flags, Mode::from_raw_mode(0o666)) {
        Ok(file) => Ok(Some(File::from(file))),
        Err(Errno::OPNOTSUPP | Errno::ISDIR | Errno::INVAL) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn create_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let beside = Beside::write(path, bytes)?;
    match renameat_with(CWD, &beside.0, CWD, path, RenameFlags::NOREPLACE) {
        Err(Errno::INVAL | Errno::NOSYS) if !path.exists() => fs::rename(&beside.0, path),
        result => Ok(result?),
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A file beside the one that is meant; gone when it was not renamed.
struct Beside(PathBuf);

impl Beside {
    fn write(path: &Path, bytes: &[u8]) -> io::Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let beside = folder(path).join(format!(".{name}.{}.part", std::process::id()));
        let mut file = File::create(&beside)?;
        let beside = Self(beside);
        file.write_all(bytes)?;
        file.sync_data()?;
        Ok(beside)
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        // After it was renamed there is nothing of that name.
        let _ = fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| {
            entry.unwrap().file_name().to_string_lossy().into_owned()
        };
        fs::read_dir(folder).unwrap().map(name).collect()
    }

    #[test]
    fn a_file_is_written_once_and_replaced_as_a_whole() {
        type Write = fn(&Path, &[u8]) -> io::Result<()>;
        for write in [create as Write, create_beside] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("page.html");
            write(&path, b"first").unwrap();
            let again = write(&path, b"second").unwrap_err();
            assert_eq!(again.kind(), io::ErrorKind::AlreadyExists);
            assert_eq!(fs::read(&path).unwrap(), b"first");
            replace(&path, b"third").unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"third");
            assert_eq!(names(folder.path()), ["page.html"]);
        }
        assert!(create(Path::new("/nowhere/at/all"), b"").is_err());
    }

    #[test]
    fn a_file_that_cannot_be_written_to_its_end_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        let beside = Beside::write(&path, b"half").unwrap();
        assert_eq!(names(folder.path()).len(), 1);
        drop(beside);
        assert!(names(folder.path()).is_empty());
    }
}
