//! Renders a scene or a model through its maps:
//! `cargo run --release -p ndfmap --features models --example render_a_model [SCENE|MODEL [FILE.png]]`.

use ndfmap::SceneSpec;
use ndfmap::core::grid::Size;
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::core::ndf::Vmf;
use ndfmap::core::observe::Unobserved;
use ndfmap::core::pyramid::Precision;
use ndfmap::maps::picture::write_picture;
use ndfmap::render::{Device, RenderJob, render};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let scene = words.next().unwrap_or_else(|| "sphere".to_owned());
    let output = words.next().unwrap_or_else(|| "sphere.png".to_owned());
    let job = RenderJob {
        scene: &SceneSpec { scene, ..SceneSpec::default() },
        times: &[0.0],
        methods: &[Vmf::new(4)?.into()],
        size: Size { width: 320, height: 240 },
        storage: Precision::Half.into(),
        lookups: Lookups::taps(Filtering::fine(16)),
        truth: None,
        sparkle: false,
        keep: true,
        keep_drift: false,
    };
    let report = render(&job, &Device::Cpu, &Unobserved, &mut |_, _| Ok(()))?;
    let frame = &report.frames[0];
    Ok(write_picture(output.as_ref(), &frame.pictures[0], frame.exposure)?)
}
