//! Runs the program as a user would.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]
#![allow(dead_code, reason = "every test file is a crate of its own and uses its own part of this one")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The folder of real maps beside the checkout; a test without it is skipped.
pub(crate) fn data() -> Option<PathBuf> {
    let folder = root().join("../shared/data");
    if folder.exists() {
        return Some(folder);
    }
    skipped("the data folder is not beside this checkout", "NDFMAP_REQUIRE_DATA");
    None
}

/// Says that the test is skipped: on stderr, and in the file that `NDFMAP_SKIPPED` names, which
/// `scripts/test` counts. It fails where the variable `insist` is set.
pub(crate) fn skipped(reason: &str, insist: &str) {
    assert!(std::env::var_os(insist).is_none(), "{reason}, and {insist} is set");
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    eprintln!("SKIPPED {name}: {reason}");
    if let Some(list) = std::env::var_os("NDFMAP_SKIPPED") {
        let mut list = std::fs::OpenOptions::new().append(true).create(true).open(list).unwrap();
        std::io::Write::write_all(&mut list, format!("{name}: {reason}\n").as_bytes()).unwrap();
    }
}

/// Runs `ndfmap` with these words.
pub(crate) fn ndfmap<S: AsRef<std::ffi::OsStr>>(words: &[S]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ndfmap")).args(words).output().unwrap()
}

/// Runs it, expects success, and reads its JSON.
pub(crate) fn json<S: AsRef<std::ffi::OsStr>>(words: &[S]) -> serde_json::Value {
    let output = ndfmap(words);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Runs it: status, stdout and stderr.
pub(crate) fn outcome(words: &[&str]) -> (i32, String, String) {
    let output = ndfmap(words);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

/// A path as a word of a command line.
pub(crate) fn text(path: &Path) -> String {
    path.display().to_string()
}
