//! Normal maps of a folder, for the examples that measure over many.

use std::path::{Path, PathBuf};

use ndfmap::maps::formats::{is_picture, read_file, read_image};
use ndfmap::maps::source::{Convention, PictureKind, SourceMap, SourceOptions, identify, source_of_image};

/// Pictures of a folder, by name.
pub(crate) fn pictures(folder: &str) -> std::io::Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| is_picture(file));
    files.sort();
    Ok(files)
}

/// Normal map of a file; `None` for a picture that is none.
pub(crate) fn normal_map(path: &Path) -> Result<Option<SourceMap>, Box<dyn std::error::Error>> {
    let image = read_image(path, &read_file(path)?)?;
    if identify(path, &image).kind != PictureKind::Normal {
        return Ok(None);
    }
    // A map that does not tell where green points has the same errors either way.
    let auto = source_of_image(path, image.clone(), String::new(), &SourceOptions::default());
    let up = SourceOptions { convention: Some(Convention::OpenGl), ..SourceOptions::default() };
    Ok(Some(auto.or_else(|_| source_of_image(path, image, String::new(), &up))?))
}

/// Median of numbers, of which there is one.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
}
