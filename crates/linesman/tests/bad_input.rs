//! What cannot be used: a clear message, exit status 2, never a panic.

mod support;

use std::fs;
use std::path::PathBuf;

use support::{Run, assert_valid, linesman};
use tempfile::TempDir;

/// Files of one test.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(TempDir::new().expect("a temporary directory"))
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("a file can be written");
        path
    }
}

/// Fails unless the run said why nothing could be judged, with all of `words`, and gave advice.
#[track_caller]
fn refused(run: &Run, words: &[&str]) {
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
    assert!(run.stderr.contains("\ndo: "), "there is no advice: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "`{word}` is missing: {}", run.stderr);
    }
}

#[test]
fn a_segment_file_that_is_none() {
    let files = Files::new();
    let sim = |path: PathBuf| {
        linesman(["sim".as_ref(), path.as_os_str(), "--on".as_ref(), "nope0".as_ref()])
    };
    let rows: [(&str, &[u8], &[&str]); 5] = [
        ("unknown.toml", b"name = \"x\"\nsped = 3\n", &["unknown.toml", "sped"]),
        ("syntax.toml", b"name = \n", &["syntax.toml", "1"]),
        ("binary.toml", &[0xFF, 0xFE, 0, 1, 2, 3, 4, 5, 6, 7], &["byte 0", "UTF-8"]),
        (
            "type.toml",
            b"[[device]]\nname = \"K1\"\ntype = \"EK9\"\non = \"maindevice\"\n",
            &["K1", "EK9"],
        ),
        (
            "place.toml",
            b"[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"K7.B\"\n",
            &["K1", "K7"],
        ),
    ];
    for (name, bytes, words) in rows {
        let run = sim(files.write(name, bytes));
        assert_eq!(run.status, 2, "{name}: {}", run.all());
        for word in words {
            assert!(run.stderr.contains(word), "{name}, `{word}`: {}", run.stderr);
        }
    }
    refused(&sim(files.0.path().join("missing.toml")), &["missing.toml", "No such file"]);
}

#[test]
fn an_interface_that_does_not_exist() {
    let files = Files::new();
    let plant = "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n";
    let plant = files.write("plant.toml", plant);
    let run = linesman(["sim".as_ref(), plant.as_os_str(), "--on".as_ref(), "nope0".as_ref()]);
    refused(&run, &["nope0", "there are:", "lo", "linesman interfaces"]);
    let run = linesman(["sim".as_ref(), plant.as_os_str(), "--on".as_ref(), "a+b+c".as_ref()]);
    refused(&run, &["a+b+c"]);
}

#[test]
fn a_refusal_is_json_when_json_was_asked_for() {
    let run = linesman(["interfaces", "--json", "--nonsense"]);
    assert_eq!(run.status, 2);
    assert_valid(&run.json(), "error");
}
