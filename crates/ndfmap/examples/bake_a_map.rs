//! Bakes a map into a file: `cargo run --release -p ndfmap --example bake_a_map [MAP [FILE.ktx2]]`.

use ndfmap::BakeJob;
use ndfmap::core::ndf::Vmf;
use ndfmap::maps::WriteOptions;
use ndfmap::maps::source::{SourceOptions, read_source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let source = words.next().unwrap_or_else(|| "builtin:foil".to_owned());
    let output = words.next().unwrap_or_else(|| "foil.ktx2".to_owned());
    let map = read_source(source.as_ref(), &SourceOptions::default())?;
    let report = BakeJob::new(&map, Vmf::new(4)?).save(output.as_ref(), &WriteOptions::default())?;
    println!("{output}: {} levels of {}, {} bytes", report.levels, report.method, report.bytes);
    Ok(())
}
