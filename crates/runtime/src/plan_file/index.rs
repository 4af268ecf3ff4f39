//! Index of the devices that the files of a folder describe, kept on disk between runs.
//!
//! To find a device among hundreds of files all of them would have to be read. What was seen in a file
//! is believed again as long as the file is the same: length, time of its last change, time at which
//! anything about it was changed last (which nobody can set), number on its file system. Times that are
//! not clearly before the index was written are not believed: a file may change twice within the
//! resolution of its times. An index that is damaged, or of another version, is as none.
//!
//! It lies in `$XDG_CACHE_HOME/linesman` (else `~/.cache/linesman`), one file for each folder, and may be
//! deleted at any time.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use linesman_config::esi::header::EsiHeader;
use linesman_link::whole_file;

/// First line; another version has another.
const VERSION: &str = "linesman device descriptions 1";
/// So much older than the index a file must be, in ns: the coarsest times of file systems are 2 s.
const CLEARLY: i128 = 2_000_000_000;
/// Longest index that is read, in bytes.
const MAX_LEN: u64 = 256 * 1024 * 1024;

/// By what a file is known again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct FileStamp {
    len: u64,
    /// Of its content, in ns since 1970.
    modified: i128,
    /// Of anything about it, in ns since 1970.
    changed: i128,
    number: [u64; 2],
}

impl FileStamp {
    fn of(about: &Metadata) -> Self {
        let ns = |s: i64, ns: i64| i128::from(s) * 1_000_000_000 + i128::from(ns);
        Self {
            len: about.len(),
            modified: ns(about.mtime(), about.mtime_nsec()),
            changed: ns(about.ctime(), about.ctime_nsec()),
            number: [about.dev(), about.ino()],
        }
    }
}

/// What is known of the files of a folder.
#[derive(Default, Debug)]
pub(super) struct Index {
    /// Of which folder: files are known by their way from there.
    folder: PathBuf,
    /// Where it is kept; nowhere without a cache folder.
    place: Option<PathBuf>,
    /// When it was written, in ns since 1970.
    written: i128,
    files: BTreeMap<PathBuf, (FileStamp, Vec<EsiHeader>)>,
    changed: bool,
}

impl Index {
    /// The index of a folder as it was left, empty where there is none.
    pub(super) fn of(folder: &Path) -> Self {
        let place = cache_folder().and_then(|cache| {
            let folder = fs::canonicalize(folder).ok()?;
            let name = crc32fast::hash(folder.as_os_str().as_encoded_bytes());
            Some(cache.join(format!("descriptions-{name:08x}")))
        });
        let none = Self { folder: folder.to_owned(), place: place.clone(), ..Self::default() };
        let Some(place) = place else { return none };
        let Ok(about) = fs::metadata(&place) else { return none };
        if !about.is_file() || about.len() > MAX_LEN {
            return none;
        }
        let Some(files) = fs::read_to_string(&place).ok().and_then(|text| parse(&text)) else {
            return none;
        };
        Self { written: FileStamp::of(&about).modified, files, ..none }
    }

    /// What is known of a file that is still the same.
    pub(super) fn known(&self, path: &Path, about: &Metadata) -> Option<&[EsiHeader]> {
        let (stamp, headers) = self.files.get(self.way(path))?;
        let old = stamp.modified.max(stamp.changed) + CLEARLY <= self.written;
        (old && *stamp == FileStamp::of(about)).then_some(headers.as_slice())
    }

    /// Notes what a file describes; `about` is from before it was read.
    pub(super) fn learn(&mut self, path: &Path, about: &Metadata, headers: &[EsiHeader]) {
        self.changed = true;
        let way = self.way(path).to_owned();
        self.files.insert(way, (FileStamp::of(about), headers.to_vec()));
    }

    fn way<'a>(&self, path: &'a Path) -> &'a Path {
        path.strip_prefix(&self.folder).unwrap_or(path)
    }

    /// Writes it, if something is new or gone. A cache that cannot be written is no harm.
    pub(super) fn save(&mut self, present: &[PathBuf]) {
        let before = self.files.len();
        let present: BTreeSet<&Path> = present.iter().map(|path| self.way(path)).collect();
        self.files.retain(|way, _| present.contains(way.as_path()));
        if !self.changed && self.files.len() == before {
            return;
        }
        let Some((place, folder)) = self.place.as_ref().and_then(|at| Some((at, at.parent()?)))
        else {
            return;
        };
        let text = self.text();
        let _ =
            fs::create_dir_all(folder).and_then(|()| whole_file::replace(place, text.as_bytes()));
    }

    fn text(&self) -> String {
        let mut text = format!("{VERSION}\n");
        for (path, (stamp, headers)) in &self.files {
            let Some(path) = path.to_str().filter(|path| !path.contains(['\n', '\t'])) else {
                continue;
            };
            let FileStamp { len, modified, changed, number: [device, node] } = stamp;
            let count = headers.len();
            let _ =
                writeln!(text, "{len}\t{modified}\t{changed}\t{device}\t{node}\t{count}\t{path}");
            for EsiHeader { vendor_id, type_name, product_code, revision, at } in headers {
                let name = type_name.replace(['\n', '\t', '\r'], " ");
                let _ = writeln!(text, "{vendor_id}\t{product_code}\t{revision}\t{at}\t{name}");
            }
        }
        let sum = crc32fast::hash(text.as_bytes());
        let _ = writeln!(text, "{sum:08x}");
        text
    }
}

fn parse(text: &str) -> Option<BTreeMap<PathBuf, (FileStamp, Vec<EsiHeader>)>> {
    let (body, sum) = text.trim_end_matches('\n').rsplit_once('\n')?;
    let body = text.get(..=body.len())?;
    if u32::from_str_radix(sum, 16).ok()? != crc32fast::hash(body.as_bytes()) {
        return None;
    }
    let mut lines = body.lines();
    if lines.next()? != VERSION {
        return None;
    }
    let mut files = BTreeMap::new();
    while let Some(line) = lines.next() {
        let mut parts = line.splitn(7, '\t');
        let stamp = FileStamp {
            len: parts.next()?.parse().ok()?,
            modified: parts.next()?.parse().ok()?,
            changed: parts.next()?.parse().ok()?,
            number: [parts.next()?.parse().ok()?, parts.next()?.parse().ok()?],
        };
        let count: usize = parts.next()?.parse().ok()?;
        let path = PathBuf::from(parts.next()?);
        let mut headers = Vec::new();
        for _ in 0..count {
            let mut parts = lines.next()?.splitn(5, '\t');
            headers.push(EsiHeader {
                vendor_id: parts.next()?.parse().ok()?,
                product_code: parts.next()?.parse().ok()?,
                revision: parts.next()?.parse().ok()?,
                at: parts.next()?.parse().ok()?,
                type_name: parts.next()?.to_owned(),
            });
        }
        files.insert(path, (stamp, headers));
    }
    Some(files)
}

/// Where caches lie, by the XDG base directory rules; `None` where nothing says.
fn cache_folder() -> Option<PathBuf> {
    let folder = |name: &str| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    let cache = folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")))?;
    Some(cache.join("linesman"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    fn header(name: &str) -> EsiHeader {
        EsiHeader { vendor_id: 2, type_name: name.to_owned(), product_code: 7, revision: 1, at: 99 }
    }

    fn age(path: &Path, seconds: u64) {
        let at = SystemTime::now() - Duration::from_secs(seconds);
        fs::File::options().write(true).open(path).unwrap().set_modified(at).unwrap();
    }

    #[test]
    fn what_was_seen_in_a_file_is_believed_only_as_long_as_it_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.xml");
        fs::write(&path, "first").unwrap();
        let place = folder.path().join("cache/descriptions");
        let about = fs::metadata(&path).unwrap();
        let mut index = Index { place: Some(place.clone()), ..Index::default() };
        index.learn(&path, &about, &[header("EL1004")]);
        index.save(std::slice::from_ref(&path));
        let files = parse(&fs::read_to_string(&place).unwrap()).unwrap();
        let later = |written: i128| Index { written, files: files.clone(), ..Index::default() };
        let now = FileStamp::of(&about).changed;
        // Too fresh to be sure, then sure.
        assert_eq!(later(now + CLEARLY - 1).known(&path, &about), None);
        let sure = later(now + CLEARLY);
        assert_eq!(sure.known(&path, &about), Some(&[header("EL1004")][..]));
        // Another content of the same length whose time was set back is another file.
        fs::write(&path, "other").unwrap();
        fs::File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_modified(about.modified().unwrap())
            .unwrap();
        let again = fs::metadata(&path).unwrap();
        assert_eq!(
            (again.len(), again.modified().unwrap()),
            (about.len(), about.modified().unwrap())
        );
        assert_eq!(sure.known(&path, &again), None);
        age(&path, 100);
        assert_eq!(sure.known(&path, &fs::metadata(&path).unwrap()), None);
    }

    #[test]
    fn a_damaged_index_is_as_none() {
        let mut index = Index::default();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.xml");
        fs::write(&path, "x").unwrap();
        index.learn(&path, &fs::metadata(&path).unwrap(), &[header("A"), header("B")]);
        let text = index.text();
        assert_eq!(parse(&text).unwrap().len(), 1);
        for at in 0..text.len() {
            assert!(parse(&text[..at]).is_none() || at + 1 == text.len(), "cut at {at}");
            let mut bytes = text.clone().into_bytes();
            bytes[at] ^= 1;
            let spoiled = String::from_utf8(bytes).ok().and_then(|text| parse(&text));
            assert!(spoiled.is_none() || at + 1 == text.len(), "spoiled at {at}");
        }
        assert!(parse("").is_none());
    }
}
