//! UASTC by our packer and by others, on the same texels in the same run: time, error and bytes.
//!
//! `cargo run --release -p ndfmap-maps --features basis --example encoders -- write FOLDER NAME=PICTURE...`
//! writes the texels of each picture (`NAME.rgba` and its size in `NAME.json`); `... -- table FOLDER` packs
//! them, reads what others made of them (`NAME.ENCODER.ktx2`, and its seconds in `NAME.ENCODER.json`), and
//! prints a table. `tests/engines/run --encoders MAPS` does both.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use ndfmap_core::grid::{Grid, Size};
use ndfmap_maps::attribute::{Transfer, attribute_of_image};
use ndfmap_maps::formats::ktx2::{Texture, TextureEncoding, Transcoded, transcode};
use ndfmap_maps::formats::{read_file, read_image};
use serde_json::{Value, json};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["write", folder, wanted @ ..] => wanted.iter().try_for_each(|spec| write(Path::new(folder), spec)),
        ["table", folder] => table(Path::new(folder)),
        _ => Err("write FOLDER NAME=PICTURE..., or table FOLDER".into()),
    }
}

/// Writes the texels of a picture, opaque.
fn write(folder: &Path, spec: &str) -> Result<(), Box<dyn Error>> {
    let (name, path) = spec.split_once('=').ok_or("a map is NAME=PICTURE")?;
    let image = read_image(path.as_ref(), &read_file(path.as_ref())?)?;
    let values = attribute_of_image(path.as_ref(), &image, Transfer::Linear)?.values;
    let size = values.size();
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let texels = values.texels().iter().map(|t| {
        let [r, g, b] = [0, 1, 2].map(|c| byte(t[if image.channels < 3 { 0 } else { c }]));
        [r, g, b, 255]
    });
    std::fs::write(folder.join(format!("{name}.rgba")), texels.flatten().collect::<Vec<u8>>())?;
    let told = json!({ "name": name, "width": size.width, "height": size.height });
    Ok(std::fs::write(folder.join(format!("{name}.json")), told.to_string())?)
}

/// Mean squared error of red, green and blue, in 1/255.
fn error(got: &Grid<[u8; 4]>, due: &Grid<[u8; 4]>) -> f64 {
    let square = |(got, due): (&[u8; 4], &[u8; 4])| -> f64 {
        (0..3).map(|c| f64::from(got[c].abs_diff(due[c])).powi(2)).sum()
    };
    got.texels().iter().zip(due.texels()).map(square).sum::<f64>() / (3 * due.texels().len()) as f64
}

fn table(folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut files: Vec<_> = std::fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    files.sort_by_key(std::fs::DirEntry::path);
    println!(
        "| map | encoder | seconds | of ours | rms as ASTC | rms as BC7 | rms as ETC | bytes with Zstandard 3 |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for file in
        files.iter().map(std::fs::DirEntry::path).filter(|f| f.extension().is_some_and(|e| e == "rgba"))
    {
        let told: Value = serde_json::from_slice(&std::fs::read(file.with_extension("json"))?)?;
        let side = |key: &str| told[key].as_u64().and_then(|v| usize::try_from(v).ok()).ok_or("no size");
        let size = Size { width: side("width")?, height: side("height")? };
        let texels = std::fs::read(&file)?.as_chunks::<4>().0.to_vec();
        let level = Grid::from_vec(size, texels).ok_or("another size")?;
        let row = |encoder: &str, (seconds, ours): (f64, f64), ktx2: &[u8]| -> Result<(), Box<dyn Error>> {
            let rms = |blocks| -> Result<f64, Box<dyn Error>> {
                Ok(error(&transcode(&file, ktx2, &[size], blocks)?[0], &level).sqrt())
            };
            let (astc, bc7, etc) = (rms(Transcoded::Astc)?, rms(Transcoded::Bc7)?, rms(Transcoded::Etc)?);
            let name = &told["name"].as_str().unwrap_or_default();
            // All by one compressor, beside some hundred bytes of header.
            let bytes = zstd_bytes(ktx2)?;
            println!(
                "| {name} | {encoder} | {seconds:.2} | {:.1} | {astc:.2} | {bc7:.2} | {etc:.2} | {bytes} |",
                seconds / ours
            );
            Ok(())
        };
        let texture = Texture { levels: vec![level.clone()], importance: [1.0; 3] };
        let start = Instant::now();
        let ktx2 = texture.to_ktx2(&file, TextureEncoding::Uastc, None)?;
        let ours = start.elapsed().as_secs_f64();
        row("ours", (ours, ours), &ktx2)?;
        for other in files.iter().map(std::fs::DirEntry::path) {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned() + ".";
            let Some(name) = other.file_name().map(|n| n.to_string_lossy().into_owned()) else { continue };
            let Some(encoder) = name.strip_prefix(&stem).and_then(|n| n.strip_suffix(".ktx2")) else {
                continue;
            };
            let seconds: Value = serde_json::from_slice(&std::fs::read(other.with_extension("json"))?)?;
            let seconds = seconds["seconds"].as_f64().ok_or("no seconds")?;
            row(encoder, (seconds, ours), &std::fs::read(&other)?)?;
        }
    }
    Ok(())
}

fn zstd_bytes(bytes: &[u8]) -> Result<usize, Box<dyn Error>> {
    Ok(zstd::bulk::compress(bytes, 3)?.len())
}
