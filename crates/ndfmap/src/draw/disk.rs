//! Distributions of directions drawn on the unit disk, seen from above.

use glam::DVec3;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::sphere::DiskLattice;

use super::{Rgb, heat};

/// Lattice of directions, and squares of pixels that stand for them.
pub struct Disk {
    /// Directions that are drawn, of the upper hemisphere.
    pub lattice: DiskLattice,
    side: usize,
    scale: usize,
}

impl Disk {
    /// A disk of `side × side` points, each `scale × scale` pixels.
    #[must_use]
    pub fn new(side: usize, scale: usize) -> Self {
        Self { lattice: DiskLattice::new(side, 0.99), side, scale }
    }

    /// Draws one value for each direction of the lattice; `peak` and higher are white. The square root
    /// spreads the dark end.
    ///
    /// # Panics
    /// When there are fewer values than directions.
    #[must_use]
    pub fn draw(&self, values: &[f64], peak: f64) -> Grid<Rgb> {
        let mut points = vec![heat(0.0); self.side * self.side];
        let pixel = |c: f64| ((c + 1.0) / 2.0 * self.side as f64) as usize;
        assert!(values.len() >= self.lattice.len(), "a value for each direction");
        for (w, value) in self.lattice.directions.iter().zip(values) {
            // y runs up the disk, and down the picture.
            let (i, j) = (pixel(w.x), self.side - 1 - pixel(w.y));
            points[j * self.side + i] = heat((value / peak.max(f64::MIN_POSITIVE)).max(0.0).sqrt());
        }
        let size = Size { width: self.side * self.scale, height: self.side * self.scale };
        Grid::from_fn(size, |x, y| points[y / self.scale * self.side + x / self.scale])
    }

    /// Directions of the same disk seen from the side, from -y: z runs up the picture. They are those of
    /// [`lattice`](Self::lattice), turned.
    #[must_use]
    pub fn from_the_side(&self) -> Vec<DVec3> {
        self.lattice.directions.iter().map(|w| DVec3::new(w.x, -w.z, w.y)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pole_is_in_the_middle_and_y_runs_up() {
        let disk = Disk::new(9, 2);
        let towards = |to: DVec3| {
            let values: Vec<f64> =
                disk.lattice.directions.iter().map(|w| w.dot(to).max(0.0).powi(400)).collect();
            let picture = disk.draw(&values, 1.0);
            let light = |(x, y): (usize, usize)| picture.row(y)[x].map(u32::from).iter().sum::<u32>();
            let places = (0..18).flat_map(|y| (0..18).map(move |x| (x, y)));
            places.max_by_key(|at| (light(*at), std::cmp::Reverse(*at))).unwrap()
        };
        assert_eq!(towards(DVec3::Z), (8, 8));
        let (x, y) = towards(DVec3::new(0.0, 0.7, 0.7));
        assert!(x == 8 && y < 5, "{x} {y}");
        assert!(disk.from_the_side().iter().all(|w| w.y <= 0.0 && (w.length() - 1.0).abs() < 1e-12));
    }
}
