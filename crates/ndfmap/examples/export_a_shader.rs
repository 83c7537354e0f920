//! Writes the shader of a method and a lobe: `cargo run --release -p ndfmap --features shaders --example
//! export_a_shader [LANGUAGE]`.

use ndfmap::core::brdf::{Brdf, Ggx, ShadingModel};
use ndfmap::core::ndf::Vmf;
use ndfmap::core::units::Alpha;
use ndfmap::gpu::export::{Export, Shading, TABLE};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "glsl-es".to_owned());
    let language = TABLE.iter().find(|row| row.name == name).ok_or("there is no such language")?;
    let brdf = Brdf::new(Ggx::new(Alpha::new(0.2)?), ShadingModel::Smith);
    let bytes =
        Export { method: &Vmf::new(4)?, shading: Shading::Lobe(&brdf), compact: None }.to(language)?;
    println!("{}", String::from_utf8_lossy(&bytes));
    Ok(())
}
