//! Shades one texel of a baked map: `cargo run --release -p ndfmap --example shade_a_texel [FILE.ktx2]`.

use glam::DVec3;
use ndfmap::core::brdf::{Brdf, Directions, Ggx, ShadingModel, SurfaceParams};
use ndfmap::core::ndf::IncidentLight;
use ndfmap::core::units::{Alpha, SlopeVariance};
use ndfmap::maps::NdfMap;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "foil.ktx2".to_owned());
    let texel = NdfMap::open(file.as_ref())?.texel(6, 0, 0).ok_or("the map has no such texel")?;
    let brdf = Brdf::new(Ggx::new(Alpha::new(0.2)?), ShadingModel::Smith);
    let params = SurfaceParams {
        diffuse: DVec3::splat(0.02),
        specular: DVec3::splat(0.9),
        roughness: SlopeVariance::ZERO,
    };
    let light = DVec3::new(0.3, 0.1, 1.0).normalize();
    let directions = Directions::new(light, DVec3::Z).ok_or("the light is below the surface")?;
    println!("{:?}", texel.decoded());
    println!("{}", texel.shade(&brdf, &params, &[IncidentLight { directions, irradiance: DVec3::ONE }]));
    Ok(())
}
