//! Published fits of the hundred MERL materials (Matusik et al. 2003): shifted-gamma (Bagher, Soler and
//! Holzschuch 2012) and ABC (Löw et al. 2012). The numbers are those of J. Dupuy's `dj_brdf`, public domain;
//! each row of the two files is a material.

use std::f64::consts::PI;

use glam::DVec3;

use super::PublishedFit;

const SGD: &str = include_str!("merl_sgd_fits.csv");
const ABC: &str = include_str!("merl_abc_fits.csv");

/// A material's numbers, as they stand in its row.
#[derive(Debug)]
pub(super) enum Material {
    Sgd(Vec<f64>),
    Abc(Vec<f64>),
}

/// Names, in the files' order.
pub(super) fn names() -> Vec<&'static str> {
    SGD.lines().skip(1).filter_map(|row| row.split(',').next()).collect()
}

/// A material by its name.
pub(super) fn find(fit: PublishedFit, name: &str) -> Result<Material, String> {
    let (file, names_in_row) = match fit {
        PublishedFit::Sgd => (SGD, 2),
        PublishedFit::Abc => (ABC, 1),
    };
    let row = file.lines().skip(1).find(|row| row.split(',').next() == Some(name)).ok_or_else(|| {
        let all = names();
        let alike =
            |n: &&&str| !name.is_empty() && n.split('-').any(|word| name.split('-').any(|w| w == word));
        let near: Vec<&str> = all.iter().filter(alike).copied().take(8).collect();
        let (which, list) =
            if near.is_empty() { ("among the hundred are", &all[..8]) } else { ("like it are", &near[..]) };
        format!("there is no such material; {which} {}", list.join(", "))
    })?;
    let numbers = row.split(',').skip(names_in_row).map(|t| t.parse().unwrap_or(f64::NAN)).collect();
    Ok(match fit {
        PublishedFit::Sgd => Material::Sgd(numbers),
        PublishedFit::Abc => Material::Abc(numbers),
    })
}

impl Material {
    /// Reflectance, RGB, for unit directions about the normal z; zero where one is below the surface.
    pub(super) fn reflectance(&self, wi: DVec3, wo: DVec3) -> DVec3 {
        let Some(wh) = (wi + wo).try_normalize() else { return DVec3::ZERO };
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return DVec3::ZERO;
        }
        let of = |channel: usize| match self {
            Self::Sgd(numbers) => shifted_gamma(numbers, channel, (wi, wo, wh)),
            Self::Abc(numbers) => abc(numbers, channel, (wi, wo, wh)),
        };
        DVec3::from([0, 1, 2].map(of))
    }
}

fn shifted_gamma(numbers: &[f64], channel: usize, (wi, wo, wh): (DVec3, DVec3, DVec3)) -> f64 {
    let [rho_d, rho_s, alpha, p, f0, f1, kap, lambda, c, k, theta0]: [f64; 11] =
        std::array::from_fn(|i| numbers[3 * i + channel]);
    let cos2 = wh.z * wh.z;
    let a = alpha + (1.0 - cos2).max(0.0) / cos2 / alpha;
    let facets = kap * (-a).exp() / (PI * a.powf(p) * cos2 * cos2);
    let u = wi.dot(wh);
    let fresnel = f0 - u * f1 + (1.0 - u).powi(5) * (1.0 - f0);
    let seen = |w: DVec3| {
        let past = (w.z.clamp(-1.0, 1.0).acos() - theta0).max(0.0);
        (1.0 + lambda * (1.0 - (c * past.powf(k)).exp())).clamp(0.0, 1.0)
    };
    let specular = rho_s * fresnel * facets * seen(wi) * seen(wo) / (wi.z * wo.z);
    (rho_d + specular).max(0.0) / PI
}

fn abc(numbers: &[f64], channel: usize, (wi, wo, wh): (DVec3, DVec3, DVec3)) -> f64 {
    let (kd, a) = (numbers[channel], numbers[3 + channel]);
    let [b, c, ior] = [numbers[6], numbers[7], numbers[8]];
    let facets = a / (1.0 + b * (1.0 - wh.z)).powf(c);
    let u = wi.dot(wh);
    let root = (ior * ior - 1.0 + u * u).max(0.0).sqrt();
    // Unpolarised, of a dielectric (Cook and Torrance 1982, equation 2).
    let across = (root - u) / (root + u);
    let along = (u * (root + u) - 1.0) / (u * (root - u) + 1.0);
    let fresnel = 0.5 * across * across * (1.0 + along * along);
    let seen = (2.0 * wh.z * wi.z / u).min(2.0 * wh.z * wo.z / u).min(1.0);
    kd / PI + fresnel * facets * seen / (PI * wi.z * wo.z)
}
