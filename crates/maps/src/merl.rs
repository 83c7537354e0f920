//! Measured reflectance in the format of the MERL database (Matusik et al. 2003).
//!
//! Three 32-bit counts, 90 × 90 × 180, then as many 64-bit floats for red, for green and for blue, all
//! little-endian. Bins of the half angle (finer towards the peak), of the difference angle, and of the turn
//! of the difference, the last the fastest. Each channel has a factor that scales its values; negative values
//! were never measured.

use std::path::Path;

use ndfmap_core::brdf::measured::BINS;
use ndfmap_core::brdf::{Measured, MeasuredTable};

use crate::MapError;
use crate::formats::read_file;

/// Bins of the turn, over 180 degrees.
const TURNS: usize = 180;

const VALUES: usize = BINS * BINS * TURNS;
const HEADER: usize = 12;
const SIZE: usize = HEADER + 3 * 8 * VALUES;

/// Factors of stored values, one a channel.
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Reads and factors a file; also returns the number of values, over all channels, that are negative or not
/// finite.
///
/// # Errors
/// [`MapError`] for a file that cannot be read, or is no such table.
pub fn read_merl(path: &Path) -> Result<(Measured, usize), MapError> {
    // The format has one size, checked before so many bytes are read.
    let length = std::fs::metadata(path).map_err(|e| MapError::io(path, e))?.len();
    if length > SIZE as u64 {
        return Err(MapError::invalid(path, format!("has {length} bytes; a MERL table has {SIZE}")));
    }
    parse_merl(path, &read_file(path)?)
}

/// [`read_merl`] of a file's bytes.
///
/// # Errors
/// [`MapError`] for bytes that are no such table.
pub fn parse_merl(path: &Path, bytes: &[u8]) -> Result<(Measured, usize), MapError> {
    let Some((header, values)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(MapError::invalid(
            path,
            format!("has {} bytes, not even the header of a MERL table", bytes.len()),
        ));
    };
    let counts =
        [0, 4, 8].map(|i| i32::from_le_bytes([header[i], header[i + 1], header[i + 2], header[i + 3]]));
    if counts != [BINS as i32, BINS as i32, TURNS as i32] {
        let [a, b, c] = counts;
        let reason =
            format!("is no MERL table: it begins with {a} × {b} × {c}, not {BINS} × {BINS} × {TURNS}");
        return Err(MapError::invalid(path, reason));
    }
    if bytes.len() != SIZE {
        return Err(MapError::invalid(path, format!("has {} bytes; a MERL table has {SIZE}", bytes.len())));
    }
    let values = values.as_chunks::<8>().0;
    let value =
        |channel: usize, bin: usize| f64::from_le_bytes(values[channel * VALUES + bin]) * SCALES[channel];
    let good = |v: f64| v.is_finite() && v >= 0.0;
    let missing = (0..3).map(|c| (0..VALUES).filter(|bin| !good(value(c, *bin))).count()).sum();
    if missing == 3 * VALUES {
        return Err(MapError::invalid(path, "holds no value that is not negative"));
    }
    let rgb = |bin: usize| [0, 1, 2].map(|c| value(c, bin) as f32);
    let table = MeasuredTable::new(TURNS, (0..VALUES).map(rgb).collect())
        .unwrap_or_else(|_| unreachable!("one value for each bin"));
    Ok((Measured::new(&format!("merl:{}", path.display()), table), missing))
}
