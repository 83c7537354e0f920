// Lobes of normals that a texel stands for, and their part in a renderer's own light.
#define_import_path ndfmap::lobes

const NDF_PI: f32 = 3.14159265;

// Share of the map against the normal map that a renderer has near by, where a map lacks its finest levels: a
// texture unit's level of detail, up to the level that both have. Pixels lie `dx` and `dy` apart, in texels
// of the normal map; the filter takes `anisotropy` taps at most.
fn ndf_share(dx: vec2<f32>, dy: vec2<f32>, from_level: f32, anisotropy: f32) -> f32 {
    if from_level <= 0.0 {
        return 1.0;
    }
    let longer = max(length(dx), length(dy));
    let shorter = max(min(length(dx), length(dy)), 1e-6);
    let taps = clamp(ceil(longer / shorter), 1.0, anisotropy);
    return saturate(log2(max(longer / taps, 1e-6)) / from_level);
}

// GGX, by the cosine between normal and half vector (Walter et al. 2007).
fn ndf_ggx(alpha: f32, cosine: f32) -> f32 {
    let a2 = alpha * alpha;
    let below = cosine * cosine * (a2 - 1.0) + 1.0;
    return a2 / (NDF_PI * below * below);
}

// Width of a GGX that a lobe's normals widen, about: squares of widths add.
fn ndf_widened(alpha: f32, variance: f32) -> f32 {
    return sqrt(alpha * alpha + 2.0 * variance);
}

// Share of a lobe's light that comes from the material's tail. A GGX blurred by a Gaussian of normals keeps
// the tail of the GGX: far off, it is this share of a GGX as wide as both.
fn ndf_tail(alpha: f32, variance: f32) -> f32 {
    return alpha * alpha / (alpha * alpha + 2.0 * variance);
}

// Density of facets towards the half vector that are no tail: a Gaussian as wide as both, by the cosine
// between the lobe's normal and the half vector.
fn ndf_core(alpha: f32, variance: f32, cosine: f32) -> f32 {
    let width = ndf_widened(alpha, variance);
    let c2 = max(cosine * cosine, 1e-4);
    return exp((1.0 - 1.0 / c2) / (width * width)) / (NDF_PI * width * width * c2 * c2);
}

// Facet of the core that shines towards the half vector `h`: the mean of the product of two Gaussians, the
// lobe's normals and the material's facets. Its cosines and its masking are the light's. In the tail every
// normal of the lobe shines alike, so that its facet is the lobe's own normal.
fn ndf_shining_facet(normal: vec3<f32>, variance: f32, alpha: f32, h: vec3<f32>) -> vec3<f32> {
    return normalize(0.5 * alpha * alpha * normal + variance * h);
}

// Variance by which a lobe's normals spread mirrored light: twice as far as they lie apart in the plane of
// incidence, and across it less, by the cosine to the eye. GGX's alpha counts the spread of normals, so that
// this is the mean of 1 and the cosine's square.
fn ndf_mirrored_variance(variance: f32, cosine: f32) -> f32 {
    return 0.5 * (1.0 + cosine * cosine) * variance;
}
