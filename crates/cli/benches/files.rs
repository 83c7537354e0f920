//! `ndfmap bake` against OpenImageIO's `maketx --bumpslopes -d half`, whole processes, files included.
//!
//! The measuring is done by a script, which the operating system tells each child's CPU time and peak memory.
//! Skipped, visibly, where the script's Python environment has not been set up (`scripts/test` does that).

use std::path::Path;
use std::process::Command;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let python = root.join(".venv/bin/python");
    if !python.exists() {
        println!("skipped: no Python environment with OpenImageIO; run scripts/test once");
        return Ok(());
    }
    let status = Command::new(python)
        .arg(root.join("tests/interop/bench_maketx.py"))
        .arg(env!("CARGO_BIN_EXE_ndfmap"))
        .args(std::env::var("NDFMAP_BENCH_SIZE"))
        .status()?;
    if status.success() { Ok(()) } else { Err("the measuring script failed".into()) }
}
