//! Distributions of normals under one texel, and the lobes that methods make of them.

use std::ops::RangeInclusive;

use glam::DVec3;
use ndfmap::Error;
use ndfmap::compare::{Comparison, Row, Subject, compare};
use ndfmap::core::bake::Bake;
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::measure::TexelTruth;
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::pyramid::{Precision, Pyramid};
use ndfmap::core::sphere::DiskLattice;
use ndfmap::core::surface::Surface;
use ndfmap::maps::source::{SourceMap, SourceOptions, read_source};

use crate::Plan;

/// Texel of a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Texel {
    pub(crate) level: usize,
    pub(crate) x: usize,
    pub(crate) y: usize,
}

/// Built-in map of a side.
pub(crate) fn builtin(plan: &Plan<'_>, name: &str, side: usize) -> Result<SourceMap, Error> {
    let options = SourceOptions { builtin_size: plan.map(side), ..SourceOptions::default() };
    Ok(read_source(format!("builtin:{name}").as_ref(), &options)?)
}

/// Lobe of a spelling that we wrote.
pub(crate) fn lobe(spelling: &str) -> AnyLobe {
    spelling.parse().unwrap_or_else(|e| unreachable!("{spelling}: {e}"))
}

/// Methods of spellings that we wrote.
pub(crate) fn methods(spellings: &[&str]) -> Vec<AnyMethod> {
    spellings.iter().map(|s| s.parse().unwrap_or_else(|e| unreachable!("{s}: {e}"))).collect()
}

/// Errors of methods on a map, level by level.
pub(crate) fn compared(
    plan: &Plan<'_>,
    surface: &dyn Surface,
    brdf: &str,
    spellings: &[&str],
) -> Result<Comparison, Error> {
    let subject = Subject {
        name: "map",
        surface,
        lobe: &*lobe(brdf),
        methods: &methods(spellings),
        baked: &[],
        engines: &[],
        storage: Precision::Half.into(),
        filtering: false,
    };
    compare(&subject, plan.observer)
}

/// Baked levels of a map by a method.
pub(crate) fn baked(plan: &Plan<'_>, surface: &dyn Surface, method: &AnyMethod) -> Result<Pyramid, Error> {
    Ok(Bake::new(surface, &**method).precision(Precision::Half).observer(plan.observer).to_pyramid()?.0)
}

/// Directions that need not lie on a disk, each for itself.
pub(crate) fn scattered(directions: Vec<DVec3>) -> DiskLattice {
    let rows = directions.iter().enumerate().map(|(i, w)| (w.y, i..i + 1)).collect();
    DiskLattice { directions, rows }
}

/// Effective lobe of the normals under a texel, at each direction of a lattice.
pub(crate) fn true_lobe(surface: &dyn Surface, brdf: &str, lattice: &DiskLattice, texel: Texel) -> Vec<f64> {
    let lobe = lobe(brdf);
    let truth = TexelTruth::new(surface, &*lobe, lattice);
    let size = ndfmap::core::pyramid::level_sizes(surface.size())[texel.level];
    truth.texel(size, texel.x, texel.y)
}

/// Effective lobe that a method remembers of a texel.
pub(crate) fn lobe_of(
    pyramid: &Pyramid,
    method: &AnyMethod,
    brdf: &str,
    at: (&DiskLattice, Texel),
) -> Vec<f64> {
    let (lattice, Texel { level, x, y }) = at;
    let mut values = vec![0.0; lattice.len()];
    method.evaluator(&*lobe(brdf), &lattice.directions).evaluate(&pyramid.texel(level, x, y), &mut values);
    values
}

/// `|a - truth| / |truth|` of two lobes.
pub(crate) fn apart(a: &[f64], truth: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let difference = square(&mut a.iter().zip(truth).map(|(a, t)| a - t));
    (difference / square(&mut truth.iter().copied()).max(f64::MIN_POSITIVE)).sqrt()
}

/// Largest of a lobe's values.
pub(crate) fn peak(values: &[f64]) -> f64 {
    values.iter().copied().fold(1e-12, f64::max)
}

/// Mean error of a method over levels.
pub(crate) fn mean_error(row: &Row, levels: &RangeInclusive<usize>) -> f64 {
    let errors: Vec<f64> = row.levels.iter().filter(|l| levels.contains(&l.level)).map(|l| l.error).collect();
    errors.iter().sum::<f64>() / errors.len().max(1) as f64
}
