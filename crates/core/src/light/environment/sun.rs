//! Small bright sources, taken out of an environment to shine as lights of their own.
//!
//! A sun of one texel can be 100 000 times as bright as the sky. In spherical harmonics it rings over the
//! whole sphere, and in a cube it is either missed or smeared over a texel. So texels above [`CONTRAST`]
//! times the mean are grouped; of a group that is small, what is above that level becomes a directional
//! light, and the rest stays. Nothing is lost: light and what is left add up to what was there. Groups that
//! are large (a window) or faint are left alone.

use glam::{DVec3, Vec3};

use super::Environment;
use crate::light::Light;

/// Least brightness of a source's texel, in means over the sphere.
const CONTRAST: f32 = 50.0;

/// A source is small when its directions stray by less than this, as a root of the mean square, in radians:
/// 2.5 degrees.
const SMALL: f64 = 0.044;

/// A source is bright when this share of all light is above the level.
const BRIGHT: f64 = 0.002;

/// Largest number of sources that are taken out: the brightest.
const MOST: usize = 16;

/// An environment's small bright sources.
#[derive(Clone, Debug)]
pub struct Suns {
    /// The sources as lights, in the environment's own directions.
    pub lights: Vec<Light>,
    /// Share of all light that comes from them.
    pub share: f64,
}

/// Takes the small bright sources out.
#[must_use]
pub fn without_suns(environment: &Environment) -> (Environment, Suns) {
    let size = environment.size();
    let brightness = |v: &Vec3| v.element_sum() / 3.0;
    let all = environment.mean().element_sum() / 3.0;
    let level = CONTRAST * all as f32;
    let picture = environment.picture();
    // Groups of neighbours above the level, around the picture's sides too.
    let mut group = vec![usize::MAX; size.area()];
    let mut groups: Vec<Vec<(usize, usize)>> = Vec::new();
    for start in 0..size.area() {
        let at = (start % size.width, start / size.width);
        if group[start] != usize::MAX || brightness(&picture.row(at.1)[at.0]) <= level {
            continue;
        }
        let (mut members, mut open) = (Vec::new(), vec![at]);
        group[start] = groups.len();
        while let Some((x, y)) = open.pop() {
            members.push((x, y));
            for (dx, dy) in [(0, 1), (2, 1), (1, 0), (1, 2), (0, 0), (0, 2), (2, 0), (2, 2)] {
                let (nx, ny) = ((x + size.width + dx - 1) % size.width, y + dy);
                if ny == 0 || ny > size.height {
                    continue;
                }
                let i = (ny - 1) * size.width + nx;
                if group[i] == usize::MAX && brightness(&picture.row(ny - 1)[nx]) > level {
                    group[i] = groups.len();
                    open.push((nx, ny - 1));
                }
            }
        }
        // In the picture's order, so that sums are the same however the group was walked.
        members.sort_by_key(|(x, y)| (*y, *x));
        groups.push(members);
    }
    let above = |v: &Vec3| v.as_dvec3() * (1.0 - f64::from(level) / f64::from(brightness(v)));
    let source = |members: Vec<(usize, usize)>| {
        let (mut irradiance, mut middle) = (DVec3::ZERO, DVec3::ZERO);
        for (x, y) in &members {
            let power = above(&picture.row(*y)[*x]) * environment.solid_angle(*y);
            irradiance += power;
            middle += environment.direction(*x as f64 + 0.5, *y as f64 + 0.5) * power.element_sum();
        }
        let weight = irradiance.element_sum();
        // The mean direction is as much shorter than one as half the mean square of what directions stray.
        let stray = (2.0 * (1.0 - middle.length() / weight)).max(0.0).sqrt();
        (members, irradiance, middle.normalize_or(DVec3::Y), stray)
    };
    let sphere = 4.0 * std::f64::consts::PI * 3.0 * all;
    let mut sources: Vec<_> = groups.into_iter().map(source).collect();
    sources.retain(|(_, irradiance, _, stray)| *stray < SMALL && irradiance.element_sum() > BRIGHT * sphere);
    sources.sort_by(|a, b| b.1.element_sum().total_cmp(&a.1.element_sum()));
    sources.truncate(MOST);
    let mut rest = picture.clone();
    let mut suns = Suns { lights: Vec::new(), share: 0.0 };
    for (members, irradiance, towards, _) in sources {
        for (x, y) in members {
            let texel = &mut rest.row_mut(y)[x];
            *texel = (texel.as_dvec3() - above(texel)).max(DVec3::ZERO).as_vec3();
        }
        suns.share += irradiance.element_sum() / sphere;
        suns.lights.push(Light::Directional { towards, irradiance });
    }
    (Environment { radiance: rest }, suns)
}

#[cfg(test)]
mod tests {
    use super::super::tests::smooth;
    use super::*;
    use crate::grid::Size;

    #[test]
    fn a_sun_and_the_sky_add_up() {
        let mut e = smooth(Size { width: 256, height: 128 });
        // Across the picture's side, in two rows.
        for (x, y) in [(0, 30), (255, 30), (0, 31)] {
            e.radiance.row_mut(y)[x] = Vec3::new(1.2e5, 1e5, 0.8e5);
        }
        // A wide window stays.
        for y in 60..90 {
            e.radiance.row_mut(y)[40..80].fill(Vec3::splat(3000.0));
        }
        let (rest, suns) = without_suns(&e);
        assert_eq!(suns.lights.len(), 1);
        let Light::Directional { towards, irradiance } = suns.lights[0] else { panic!("a direction") };
        assert!((towards - e.direction(0.0, 31.0)).length() < 0.02);
        let back = rest.mean() + irradiance / (4.0 * std::f64::consts::PI);
        // The rest is in single floats.
        assert!((back - e.mean()).length() < 1e-6 * e.mean().length(), "{back} {}", e.mean());
        assert_eq!(rest.picture().row(70)[50], Vec3::splat(3000.0));
        assert!(suns.share > 0.0 && suns.share < 1.0);
    }

    #[test]
    fn a_sky_without_a_sun_is_left_alone() {
        let e = smooth(Size { width: 64, height: 32 });
        let (rest, suns) = without_suns(&e);
        assert!(suns.lights.is_empty() && suns.share == 0.0);
        assert_eq!(rest.picture().texels(), e.picture().texels());
    }
}
