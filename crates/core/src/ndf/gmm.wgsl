// Isotropic Gaussians in the plane of n.xy: alpha, alpha mu, alpha (2 sigma² + |mu|²) (Tan et al. 2005). Twin
// of gmm.rs.

const NORMALISED: bool = true;

// Share of a texel's weight below which a lobe says nothing.
const DEAD: f32 = 1e-5;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    let alpha = sums.x;
    if !(alpha > DEAD) {
        return NormalLobe(vec3<f32>(0.0), 0.0, 0.0);
    }
    let xy = sums.yz / alpha;
    let second = max(sums.w / alpha - dot(xy, xy), 0.0);
    // Damaged files aside, means lie in the unit disk.
    let held = clamp(xy, vec2<f32>(-1.5), vec2<f32>(1.5));
    return NormalLobe(vec3<f32>(held, 0.0), alpha, select(second / 2.0, second, PRINTED));
}

// Response of lobes in the plane: the BRDF's lobe, widened, of the cosine of a normal as far from `w` as the
// two are in the plane; PRINTED, a Gaussian of that distance. Below the horizon nothing is reflected. Twin of
// `Response::Plane` and `Response::PlanarGaussian` in mixture.rs.
fn response(brdf: Brdf, lobe: NormalLobe, roughness: f32, w: vec3<f32>) -> f32 {
    if w.z <= 0.0 {
        return 0.0;
    }
    let widened = lobe_widen(brdf.base, lobe.variance + roughness);
    let d = w.xy - lobe.mean.xy;
    let far = dot(d, d);
    if PRINTED {
        let variance = lobe_variance(widened);
        return exp(-far / (2.0 * variance)) / (2.0 * PI * variance);
    }
    return lobe_evaluate(widened, sqrt(max(1.0 - far, 0.0)));
}

// Mean that diffuse light takes the cosine to.
fn lambert_mean(lobe: NormalLobe, mu: vec3<f32>) -> vec3<f32> {
    return mu;
}
