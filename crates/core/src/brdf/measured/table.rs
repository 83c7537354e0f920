//! Measurements in the bins of a MERL table: half angle, difference angle, and turn of the difference.

use std::f64::consts::PI;

use glam::DVec3;

/// Bins of `theta_h` and of `theta_d` in a MERL table, to 90 degrees.
pub const BINS: usize = 90;

/// The half angle at a place in the table, in bins: MERL tables are finer towards the peak, `theta_h =
/// (i/90)² 90°`.
#[must_use]
pub fn half_angle(i: f64) -> f64 {
    let part = i / BINS as f64;
    part * part * PI / 2.0
}

/// The difference angle at a place in the table, in bins, evenly.
pub(super) fn difference_angle(i: f64) -> f64 {
    i / BINS as f64 * PI / 2.0
}

/// Solid angle of a cell, of half-vectors and of differences, but for a constant.
fn solid_angle(h: usize, d: usize) -> f64 {
    let step = half_angle(h as f64 + 1.0) - half_angle(h as f64);
    half_angle(h as f64 + 0.5).sin() * step * difference_angle(d as f64 + 0.5).sin()
}

/// Directions to the light and to the eye, from Rusinkiewicz' angles.
pub(super) fn directions(theta_h: f64, theta_d: f64, phi_d: f64) -> (DVec3, DVec3) {
    let (sin, cos) = theta_h.sin_cos();
    let wh = DVec3::new(sin, 0.0, cos);
    let (sin_d, cos_d) = theta_d.sin_cos();
    let (sin_phi, cos_phi) = phi_d.sin_cos();
    let d = DVec3::new(sin_d * cos_phi, sin_d * sin_phi, cos_d);
    let wi = DVec3::new(cos * d.x + sin * d.z, d.y, cos * d.z - sin * d.x);
    (wi, 2.0 * wi.dot(wh) * wh - wi)
}

/// Table of measurements: reflectance, linear RGB, at `90 × 90 × turns` pairs of directions.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredTable {
    turns: usize,
    /// `(theta_h × 90 + theta_d) × turns + phi_d`; not finite where nothing was measured.
    values: Vec<[f32; 3]>,
}

/// Means over the turns of the measurements at a pair of angles.
#[derive(Clone, Copy, Default)]
pub(super) struct Cell {
    pub(super) mean: DVec3,
    /// Solid angle times both cosines, squared as errors are.
    pub(super) weight: f64,
    /// Sum of the weighted squares by which measurements stray from the mean.
    pub(super) scatter: DVec3,
}

impl MeasuredTable {
    /// Table of these values, `(theta_h × 90 + theta_d) × turns + phi_d`, turns from 0 to 180 degrees. Values
    /// that are negative or not finite count as not measured.
    ///
    /// # Errors
    /// The number of values that a table of so many turns has, when it is another.
    pub fn new(turns: usize, mut values: Vec<[f32; 3]>) -> Result<Self, usize> {
        let wanted = BINS * BINS * turns;
        if values.len() != wanted || turns == 0 {
            return Err(wanted);
        }
        for value in &mut values {
            if !value.iter().all(|v| v.is_finite() && *v >= 0.0) {
                *value = [f32::NAN; 3];
            }
        }
        Ok(Self { turns, values })
    }

    /// Table of a reflectance, asked for at the middle of every bin.
    #[must_use]
    pub fn of(turns: usize, reflectance: impl Fn(DVec3, DVec3) -> DVec3) -> Self {
        let at = |i: usize| {
            let (h, d, p) = (i / turns / BINS, i / turns % BINS, i % turns);
            let (wi, wo) = middle(turns, h, d, p);
            let value = if wi.z > 0.0 && wo.z > 0.0 { reflectance(wi, wo) } else { DVec3::NAN };
            value.as_vec3().to_array()
        };
        Self { turns, values: (0..BINS * BINS * turns).map(at).collect() }
    }

    fn value(&self, i: usize) -> Option<DVec3> {
        let value = self.values[i].map(f64::from);
        value[0].is_finite().then(|| DVec3::from(value))
    }

    /// Measurement nearest to a pair of unit directions about the normal z; the mean over turns where that
    /// was not measured, and zero where none was.
    #[must_use]
    pub fn reflectance(&self, wi: DVec3, wo: DVec3) -> DVec3 {
        let Some(wh) = (wi + wo).try_normalize() else { return DVec3::ZERO };
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return DVec3::ZERO;
        }
        let bin = |part: f64, bins: usize| ((part * bins as f64) as usize).min(bins - 1);
        let across = wh.x.hypot(wh.y);
        let theta_h = across.atan2(wh.z);
        let theta_d = wi.dot(wh).clamp(-1.0, 1.0).acos();
        // Axes of the difference: down the meridian of the half-vector, and along its circle.
        let (cos, sin) = if across > 1e-12 { (wh.x / across, wh.y / across) } else { (1.0, 0.0) };
        let down = DVec3::new(wh.z * cos, wh.z * sin, -across);
        let phi_d = (cos * wi.y - sin * wi.x).atan2(wi.dot(down)).rem_euclid(PI);
        let h = bin((theta_h / (PI / 2.0)).sqrt(), BINS);
        let first = (h * BINS + bin(theta_d / (PI / 2.0), BINS)) * self.turns;
        self.value(first + bin(phi_d / PI, self.turns)).unwrap_or_else(|| {
            let measured: Vec<DVec3> = (first..first + self.turns).filter_map(|i| self.value(i)).collect();
            measured.iter().sum::<DVec3>() / measured.len().max(1) as f64
        })
    }

    /// Means over the turns, theta_h by theta_d.
    pub(super) fn cells(&self) -> Vec<Cell> {
        let cell = |i: usize| {
            let (h, d) = (i / BINS, i % BINS);
            let measured: Vec<(DVec3, f64)> = (0..self.turns)
                .filter_map(|p| {
                    let (wi, wo) = middle(self.turns, h, d, p);
                    let value = (wi.z > 0.0 && wo.z > 0.0).then(|| self.value(i * self.turns + p))??;
                    Some((value, (wi.z * wo.z).powi(2)))
                })
                .collect();
            let weight: f64 = measured.iter().map(|(_, w)| w).sum();
            if weight <= 0.0 {
                return Cell::default();
            }
            let mean = measured.iter().map(|(v, w)| *v * *w).sum::<DVec3>() / weight;
            let scatter = measured.iter().map(|(v, w)| (*v - mean) * (*v - mean) * *w).sum::<DVec3>();
            let share = solid_angle(h, d) / self.turns as f64;
            Cell { mean, weight: weight * share, scatter: scatter * share }
        };
        (0..BINS * BINS).map(cell).collect()
    }
}

/// Directions at the middle of a bin.
fn middle(turns: usize, h: usize, d: usize, p: usize) -> (DVec3, DVec3) {
    let (theta_h, theta_d) = (half_angle(h as f64 + 0.5), difference_angle(d as f64 + 0.5));
    directions(theta_h, theta_d, PI * (p as f64 + 0.5) / turns as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_looked_up_where_it_was_filled() {
        let of = |wi: DVec3, wo: DVec3| {
            let wh = (wi + wo).normalize();
            DVec3::new(wh.z, wi.dot(wh), wi.x * wo.x + wi.y * wo.y + 1.0)
        };
        let table = MeasuredTable::of(36, of);
        for h in [0, 3, 40, 70] {
            for d in [0, 20, 60] {
                for p in [0, 17, 35] {
                    let (wi, wo) = middle(36, h, d, p);
                    if wi.z <= 0.0 || wo.z <= 0.0 {
                        continue;
                    }
                    // Turned about the normal, and with light and eye exchanged, it is the same measurement.
                    let turn = glam::DMat3::from_rotation_z(1.1);
                    for (a, b) in [(wi, wo), (turn * wi, turn * wo), (wo, wi)] {
                        assert!((table.reflectance(a, b) - of(wi, wo)).length() < 1e-6, "{h} {d} {p}");
                    }
                }
            }
        }
        assert_eq!(table.reflectance(DVec3::Z, -DVec3::Z), DVec3::ZERO);
        assert_eq!(MeasuredTable::new(2, Vec::new()), Err(BINS * BINS * 2));
    }
}
