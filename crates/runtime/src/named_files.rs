//! Files that another file names.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use linesman_sim::segment_file::DescriptionFiles;

/// Longest device description that is read, in bytes; the largest of vendors have 50 MB.
pub const MAX_DESCRIPTION: u64 = 128 * 1024 * 1024;

/// The bytes of a file, of which there must be no more than `most`: what has no end, such as a device, is not
/// read for ever.
///
/// # Errors
/// When it cannot be read, or is longer.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let len = fs::File::open(path)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if len as u64 > most {
        let what = format!("it has more than {most} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// Files that a segment file or a story names, relative to where that is, or under the directory of
/// device data: `$LINESMAN_DATA/esi/drive.xml`.
#[derive(Clone, Copy, Debug)]
pub struct NamedFiles<'a>(&'a Path);

impl<'a> NamedFiles<'a> {
    /// Those that the file at `path` names.
    #[must_use]
    pub fn of(path: &'a Path) -> Self {
        Self(path.parent().unwrap_or(Path::new("")))
    }

    fn path(&self, name: &str) -> Result<PathBuf, String> {
        let Some(rest) = name.strip_prefix("$LINESMAN_DATA/") else {
            return Ok(self.0.join(name));
        };
        let data = std::env::var_os("LINESMAN_DATA")
            .ok_or_else(|| format!("{name}: set LINESMAN_DATA to the directory of device data"))?;
        Ok(PathBuf::from(data).join(rest))
    }
}

impl DescriptionFiles for NamedFiles<'_> {
    fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        let path = self.path(name)?;
        let place = path.display();
        let refuse = |error: std::io::Error| {
            format!(
                "reading {place}: {error}; the path is relative to that of the file that names it"
            )
        };
        let about = fs::metadata(&path).map_err(refuse)?;
        if !about.is_file() {
            return Err(format!("{place} is no file"));
        }
        if about.len() > MAX_DESCRIPTION {
            let len = about.len();
            return Err(format!("{place}: {len} bytes, expected at most {MAX_DESCRIPTION}"));
        }
        fs::read(&path).map_err(refuse)
    }
}
