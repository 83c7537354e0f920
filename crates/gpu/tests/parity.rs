//! The twins agree: every method's decoding and shading, and every lobe's functions, on the GPU and on the
//! CPU.
//!
//! An output may differ by 1e-5 of itself (the issue of single floats: a chain of some tens of roundings of
//! 6e-8, and `exp` and `pow`, which devices are allowed 2e-6 for), and by what the exact function would
//! change if its inputs moved by a few of their own last digits (`INPUT_STEP`). The second is no slack of
//! ours: where a function multiplies such a step, no arithmetic in single floats can do without, as in `1 -
//! |r|²` of a narrow lobe.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use common::device;
use glam::{DVec3, Mat2, Vec3};
use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, ShadingModel, SurfaceParams};
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookup;
use ndfmap_core::ndf::{self, AnyMethod, FilteredTexel, IncidentLight, Method};
use ndfmap_core::units::SlopeVariance;
use ndfmap_core::{brdf, procedural, shader};
use ndfmap_gpu::Device;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Relative error allowed.
const RELATIVE: f64 = 1e-5;

/// Steps that inputs are moved by, of the largest in their vector: four units in the last place.
const INPUT_STEP: f32 = 4.8e-7;

/// One evaluation: a material, a way, a texel.
#[derive(Clone, Debug)]
struct Probe {
    params: SurfaceParams,
    wi: Vec3,
    wo: Vec3,
    /// The normal of a facet.
    normal: Vec3,
    at_means: bool,
    channels: Vec<f32>,
    /// How slopes lie on the displaced surface.
    by: Mat2,
    /// Its base turns its back on the eye.
    below: bool,
}

fn unit(v: DVec3) -> Vec3 {
    v.normalize().as_vec3()
}

fn towards(random: &mut Pcg64Mcg) -> Vec3 {
    let [x, y]: [f64; 2] = random.random();
    let z: f64 = random.random();
    unit(DVec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, z * z + 0.02))
}

/// Texels of all levels of a real map, mixed as filters mix them, and degenerate ones.
fn probes(method: &dyn Method, count: usize) -> Vec<Probe> {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let size = Size { width: 64, height: 64 };
    let surface = (procedural::find("foil").unwrap().build)(size);
    let (pyramid, _) = Bake::new(&*surface, method).to_pyramid().unwrap();
    let map = Lookup::new(&pyramid);
    let texel = |random: &mut Pcg64Mcg| {
        let level = random.random_range(0..pyramid.sizes().len());
        let size = pyramid.sizes()[level];
        map.texel(level, random.random_range(0..size.width), random.random_range(0..size.height)).to_vec()
    };
    let probe = |i: usize| {
        let mut channels = texel(&mut random);
        if i % 3 == 1 && method.filterable() {
            let (other, t) = (texel(&mut random), random.random::<f32>());
            channels.iter_mut().zip(other).for_each(|(c, o)| *c += t * (o - *c));
        }
        match i % 50 {
            48 => channels.fill(0.0),
            49 => channels.iter_mut().skip(4).for_each(|c| *c = 0.0),
            _ => {}
        }
        let roughness = if i.is_multiple_of(4) { 0.05 * random.random::<f64>() } else { 0.0 };
        let colour = |random: &mut Pcg64Mcg| DVec3::from(random.random::<[f32; 3]>().map(f64::from));
        let params = SurfaceParams {
            diffuse: colour(&mut random),
            specular: colour(&mut random),
            roughness: SlopeVariance::clamped(f64::from(roughness as f32)),
        };
        let [wi, wo, normal] = [(); 3].map(|()| towards(&mut random));
        let [a, b, c, d]: [f32; 4] = random.random();
        let by = Mat2::from_cols_array(&[0.5 + a, 0.6 * b - 0.3, 0.6 * c - 0.3, 0.5 + d]);
        let (at_means, below) = (i.is_multiple_of(5), i % 3 == 1);
        Probe { params, wi, wo, normal, at_means, channels, by, below }
    };
    (0..count).map(probe).collect()
}

/// What both are asked, with the same numbers.
struct Question<'a> {
    method: &'a dyn Method,
    brdf: &'a Brdf,
}

impl Question<'_> {
    /// The inputs as the shader takes them; the second result says which may be moved, and by how much.
    fn pack(&self, probe: &Probe, out: &mut Vec<f32>) {
        let table = self.method.shader_table(self.brdf, probe.params.roughness, probe.params.roughness);
        let SurfaceParams { diffuse, specular, roughness } = probe.params;
        let roughness = roughness.get() as f32;
        let base = self.brdf.lobe.base() as f32;
        out.extend([base, self.brdf.shading.index() as f32, f32::from(probe.at_means), roughness]);
        out.extend(diffuse.as_vec3().extend(roughness).to_array());
        out.extend(specular.as_vec3().extend(0.0).to_array());
        out.extend(probe.wi.extend(self.side(probe)).to_array());
        out.extend(probe.wo.extend(0.0).to_array());
        out.extend(probe.normal.extend(0.0).to_array());
        out.extend(probe.by.to_cols_array());
        out.extend(table.as_flat());
        out.extend(&probe.channels);
    }

    /// -1 where the base of the displaced surface turns its back on the eye, as only methods that know of
    /// displacement can take.
    fn side(&self, probe: &Probe) -> f32 {
        if self.method.knows_displacement() && probe.below { -1.0 } else { 1.0 }
    }

    /// The twelve numbers by the CPU.
    fn answer(&self, probe: &Probe) -> [f64; OUTPUTS] {
        let Probe { params, wi, wo, normal, at_means, channels, by, .. } = probe;
        let lobe = &self.brdf.lobe;
        let directions = Directions::new(wi.as_dvec3(), wo.as_dvec3()).unwrap();
        let prepared = self.method.prepare(self.brdf, params.roughness);
        let texel = FilteredTexel {
            channels,
            params: &|_| *params,
            prepared: &prepared,
            at_means: *at_means,
            slope_map: None,
        };
        let light =
            self.method.reflect(&texel, &[IncidentLight { directions, irradiance: DVec3::ONE }]).to_array();
        let eye = directions.wo * DVec3::new(1.0, 1.0, self.side(probe).into());
        let texel = FilteredTexel { slope_map: Some(by.as_dmat2()), ..texel };
        let lit = IncidentLight {
            directions: Directions::between(directions.wi, eye).unwrap(),
            irradiance: DVec3::ONE,
        };
        let slope_map = self.method.reflect(&texel, &[lit]).to_array();
        // Within four deviations: beyond, what is left is nothing to what the artificial normal brings.
        let visible = lobe.visible_area(eye.z, 0.3 + params.roughness.get());
        let facet = self.brdf.facet(normal.as_dvec3(), params, &directions).x;
        let width = self.brdf.width(params.roughness);
        let specular = self.brdf.is_specular();
        let of_lobe = |v: f64| if specular { v } else { 0.0 };
        let masking = if specular { lobe.masking(directions.wo.z, width) } else { 1.0 };
        let lambert = brdf::Lambert::SHARP;
        use brdf::Widen;
        [
            light[0],
            light[1],
            light[2],
            facet,
            of_lobe(lobe.evaluate_widened(params.roughness, normal.z.into())),
            of_lobe(width.get()),
            masking,
            lambert.value_widened(params.roughness, directions.wi.z),
            slope_map[0],
            slope_map[1],
            slope_map[2],
            visible,
        ]
    }

    /// What the answer may be off by.
    fn allowed(&self, probe: &Probe, answer: &[f64; OUTPUTS]) -> [f64; OUTPUTS] {
        let mut allowed = answer.map(|a| RELATIVE * a.abs() + 1e-30);
        let mut moved = |other: Probe| {
            let changed = self.answer(&other);
            for ((allowed, a), b) in allowed.iter_mut().zip(answer).zip(changed) {
                *allowed += (a - b).abs();
            }
        };
        for k in 0..4 {
            let mut by = probe.by.to_cols_array();
            by[k] *= 1.0 + INPUT_STEP;
            moved(Probe { by: Mat2::from_cols_array(&by), ..probe.clone() });
        }
        for axis in Vec3::AXES {
            moved(Probe { wi: probe.wi + axis * INPUT_STEP, ..probe.clone() });
            moved(Probe { normal: probe.normal + axis * INPUT_STEP, ..probe.clone() });
            moved(Probe { wo: probe.wo + axis * INPUT_STEP, ..probe.clone() });
        }
        for (layer, four) in probe.channels.as_chunks::<4>().0.iter().enumerate() {
            let largest = four.iter().fold(0.0_f32, |m, c| m.max(c.abs()));
            for k in 0..4 {
                let mut other = probe.clone();
                other.channels[4 * layer + k] += INPUT_STEP * largest;
                moved(other);
            }
        }
        let specular = probe.params.specular * (1.0 - f64::from(INPUT_STEP));
        moved(Probe { params: SurfaceParams { specular, ..probe.params }, ..probe.clone() });
        let roughness = SlopeVariance::clamped(probe.params.roughness.get() * (1.0 + f64::from(INPUT_STEP)));
        moved(Probe { params: SurfaceParams { roughness, ..probe.params }, ..probe.clone() });
        allowed
    }
}

/// The outputs, in order, for messages.
const NAMES: [&str; OUTPUTS] = [
    "red",
    "green",
    "blue",
    "facet",
    "evaluate",
    "variance",
    "masking",
    "lambert",
    "displaced red",
    "displaced green",
    "displaced blue",
    "visible area",
];

/// How many there are.
const OUTPUTS: usize = 12;

/// Compares; returns the share of outputs within [`RELATIVE`] without the second allowance.
fn compare(device: &Device, question: &Question<'_>, probes: &[Probe]) -> f64 {
    let name =
        format!("{} with {} and {}", question.method, question.brdf.lobe, question.brdf.shading.name());
    let text = shader::link(question.method, &*question.brdf.lobe, 0) + include_str!("parity.wgsl");
    let mut input = Vec::new();
    probes.iter().for_each(|p| question.pack(p, &mut input));
    let count = probes.len() as u32;
    let output = device.compute(&text, bytemuck::cast_slice(&input), 48 * u64::from(count), count);
    let output = output.unwrap_or_else(|e| panic!("{name}: {e}"));
    let output: Vec<f32> = bytemuck::pod_collect_to_vec(&output);
    let (mut within, mut all) = (0, 0);
    for (i, (probe, got)) in probes.iter().zip(output.as_chunks::<OUTPUTS>().0).enumerate() {
        let answer = question.answer(probe);
        let plain = |k: usize| (f64::from(got[k]) - answer[k]).abs() <= RELATIVE * answer[k].abs() + 1e-30;
        all += OUTPUTS;
        let exact = (0..OUTPUTS).filter(|k| plain(*k)).count();
        within += exact;
        if exact == OUTPUTS {
            continue;
        }
        let allowed = question.allowed(probe, &answer);
        for k in 0..OUTPUTS {
            let error = (f64::from(got[k]) - answer[k]).abs();
            assert!(
                error <= allowed[k],
                "{name}, probe {i}, {}: {} for {}, off by {error:e}, allowed {:e}\n{probe:?} way {:?} lobe {:e}",
                NAMES[k],
                got[k],
                answer[k],
                allowed[k],
                Directions::new(probe.wi.as_dvec3(), probe.wo.as_dvec3()),
                answer[4]
            );
        }
    }
    f64::from(within as u32) / f64::from(all as u32)
}

fn brdf(lobe: &str, shading: ShadingModel) -> Brdf {
    Brdf { lobe: lobe.parse::<AnyLobe>().unwrap(), shading }
}

#[test]
fn every_method_agrees() {
    let Some(device) = device() else { return };
    for (at, spelling) in ndf::TABLE.iter().flat_map(|row| row.samples).enumerate() {
        let method = spelling.parse::<AnyMethod>().unwrap();
        let probes = probes(&*method, 500);
        for (k, lobe) in ["blinn-phong:50", "ggx:0.2"].into_iter().enumerate() {
            let brdf = brdf(lobe, ShadingModel::ALL[(at + k) % ShadingModel::ALL.len()]);
            let share = compare(&device, &Question { method: &*method, brdf: &brdf }, &probes);
            eprintln!("{spelling} {lobe}: {:.2} % within 1e-5", 100.0 * share);
        }
    }
}

#[test]
fn every_lobe_agrees_in_every_model() {
    let Some(device) = device() else { return };
    let method = "vmf:4".parse::<AnyMethod>().unwrap();
    let probes = probes(&*method, 2000);
    for spelling in brdf::TABLE.iter().flat_map(|row| row.samples) {
        for shading in ShadingModel::ALL {
            let brdf = brdf(spelling, shading);
            let share = compare(&device, &Question { method: &*method, brdf: &brdf }, &probes);
            eprintln!("{spelling} {}: {:.2} % within 1e-5", shading.name(), 100.0 * share);
        }
    }
}

#[test]
fn displaced_surfaces_agree() {
    let Some(device) = device() else { return };
    for method in ["slopes", "slopes:9"] {
        let method = method.parse::<AnyMethod>().unwrap();
        let probes = probes(&*method, 2000);
        for lobe in ["beckmann:0.05", "beckmann:0.4", "ggx:0.2", "lambert"] {
            for shading in [ShadingModel::Masked, ShadingModel::Shadowed] {
                let brdf = brdf(lobe, shading);
                let share = compare(&device, &Question { method: &*method, brdf: &brdf }, &probes);
                eprintln!("{} {lobe} {}: {:.2} % within 1e-5", method, shading.name(), 100.0 * share);
            }
        }
    }
}
