// A Gaussian in space restricted to the sphere (Olano and North 1997). Twin of ndm.rs.
//
// KERNEL is the BRDF's own profile, Gaussian or Pearson with PEARSON_M; NORMALISATION is partial, integrated,
// plane or tangent.

const BRDF_KERNEL: u32 = 0u;
const PEARSON: u32 = 2u;
const INTEGRATED: u32 = 1u;
const PLANE: u32 = 2u;
const TANGENT: u32 = 3u;

struct Decoded {
    // Mean normal.
    mean: vec3<f32>,
    // Covariance: xx, yy, zz, and xy, xz, yz.
    squares: vec3<f32>,
    products: vec3<f32>,
    // Normalisation factors for roughnesses of exponents 8, 128 and 2048.
    factors: vec3<f32>,
}

fn decode(channels: ptr<function, Channels>) -> Decoded {
    let a = (*channels)[0];
    let b = (*channels)[1];
    let c = (*channels)[2];
    let p = a.xyz;
    let squares = max(b.xyz - p * p, vec3<f32>(0.0));
    return Decoded(p + vec3<f32>(0.0, 0.0, 1.0), squares, c.xyz - p.xxy * p.yzz, vec3<f32>(a.w, b.w, c.w));
}

fn mean_normal(g: ptr<function, Decoded>) -> vec3<f32> {
    return (*g).mean;
}

// The matrix L D Lᵀ of a covariance, widened by `floor` and with no pivot below it.
struct Pivots {
    d: vec3<f32>,
    // l10, l20, l21.
    l: vec3<f32>,
}

fn with_pivots_above(g: ptr<function, Decoded>, floor: f32) -> Pivots {
    let s = (*g).squares + floor;
    let p = (*g).products;
    let d0 = max(s.x, floor);
    let l10 = p.x / d0;
    let l20 = p.y / d0;
    let d1 = max(s.y - l10 * l10 * d0, floor);
    let l21 = (p.z - l20 * l10 * d0) / d1;
    let d2 = max(s.z - l20 * l20 * d0 - l21 * l21 * d1, floor);
    return Pivots(vec3<f32>(d0, d1, d2), vec3<f32>(l10, l20, l21));
}

// xᵀ (L D Lᵀ)⁻¹ x, by forward substitution.
fn distance_from(p: Pivots, x: vec3<f32>) -> f32 {
    let y1 = x.y - p.l.x * x.x;
    let y2 = x.z - p.l.y * x.x - p.l.z * y1;
    return x.x * x.x / p.d.x + y1 * y1 / p.d.y + y2 * y2 / p.d.z;
}

// Lᵀ x, with which xᵀ (L D Lᵀ) y is a sum of products.
fn across(p: Pivots, x: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(x.x + p.l.x * x.y + p.l.y * x.z, x.y + p.l.z * x.z, x.z);
}

// The power that Pearson's kernel takes, of a number above zero or zero.
fn pearson_power(x: f32) -> f32 {
    var power = 1.0;
    for (var k = 0u; k < u32(PEARSON_M); k++) {
        power *= x;
    }
    return power;
}

fn generator(d: f32) -> f32 {
    if KERNEL == PEARSON {
        return pearson_power(max(1.0 - d / (2.0 * PEARSON_M), 0.0));
    }
    return exp(-d / 2.0);
}

// The generator's integral over the sphere, for a flat map of roughness `v`.
fn flat_integral(v: f32) -> f32 {
    if KERNEL == PEARSON {
        let reach = PEARSON_M * v;
        let most = max(1.0 - 2.0 / reach, 0.0);
        let behind = pearson_power(most) * most;
        return 2.0 * PI * reach / (PEARSON_M + 1.0) * (1.0 - behind);
    }
    return 2.0 * PI * v * (1.0 - exp(-2.0 / v));
}

// The generator's integral over a plane.
fn plane_integral() -> f32 {
    return select(2.0 * PI, 2.0 * PI * PEARSON_M / (PEARSON_M + 1.0), KERNEL == PEARSON);
}

// Factor at roughness `v`: the parabola in log-log through the stored ones, held to its ends.
fn stored_factor(factors: vec3<f32>, v: f32) -> f32 {
    let x = log(vec3<f32>(1.0 / 8.0, 1.0 / 128.0, 1.0 / 2048.0));
    let y = log(max(factors, vec3<f32>(1e-6)));
    let t = clamp(log(v), x.z, x.x);
    let a = (t - x.y) / (x.x - x.y) * (t - x.z) / (x.x - x.z);
    let b = (t - x.x) / (x.y - x.x) * (t - x.z) / (x.y - x.z);
    let c = (t - x.x) / (x.z - x.x) * (t - x.y) / (x.z - x.y);
    return exp(dot(y, vec3<f32>(a, b, c)));
}

// The density on the sphere.
fn on_sphere(g: ptr<function, Decoded>, base: f32, energy: f32, w: vec3<f32>) -> f32 {
    let v = lobe_variance(base);
    let p = with_pivots_above(g, v);
    let d = distance_from(p, w - (*g).mean);
    var scale = sqrt((v / p.d.x) * (v / p.d.y) * (v / p.d.z));
    if NORMALISATION == INTEGRATED {
        scale *= stored_factor((*g).factors, v);
    }
    if KERNEL == BRDF_KERNEL {
        return scale * lobe_evaluate(base, 1.0 - v * d / 2.0);
    }
    return scale * energy / flat_integral(v) * generator(d);
}

// Covariance on a plane (xx, yy, xy) with the pivots held at `least` or above, as those of a restriction of a
// Gaussian with that base roughness are but for rounding.
fn held_above(c: vec3<f32>, least: f32) -> vec3<f32> {
    let xx = max(c.x, least);
    let along = c.z / xx;
    return vec3<f32>(xx, max(c.y - along * c.z, least) + along * c.z, c.z);
}

// The density on the plane through the mean, or on that which touches the sphere at the mean's direction,
// projected from the centre of the sphere.
fn on_plane(g: ptr<function, Decoded>, base: f32, energy: f32, w: vec3<f32>) -> f32 {
    let mu = direction_or_up((*g).mean);
    let u = dot(w, mu);
    if u <= 0.0 {
        return 0.0;
    }
    let axes = frame(mu);
    let short = clamp(length((*g).mean), 1e-3, 1.0);
    let p = with_pivots_above(g, lobe_variance(base));
    let a = across(p, axes.a);
    let b = across(p, axes.b);
    let m = across(p, mu);
    // Restriction of a Gaussian to a plane: its covariance given the coordinate across the plane, and its
    // mean, which is in the middle of the plane through it.
    let am = dot(p.d * a, m);
    let bm = dot(p.d * b, m);
    let mm = dot(p.d * m, m);
    let covariance = held_above(vec3<f32>(
        dot(p.d * a, a) - am * am / mm,
        dot(p.d * b, b) - bm * bm / mm,
        dot(p.d * a, b) - am * bm / mm,
    ), lobe_variance(base));
    let far_off = select(short, 1.0, NORMALISATION == TANGENT);
    let middle = vec2<f32>(am, bm) * ((far_off - short) / mm);
    let d = vec2<f32>(dot(w, axes.a), dot(w, axes.b)) * far_off / u - middle;
    let onto = far_off * far_off / (u * u * u);
    if KERNEL == BRDF_KERNEL {
        return stretched(base, covariance, d) * onto;
    }
    let determinant = max(covariance.x * covariance.y - covariance.z * covariance.z, 1e-30);
    let far = covariance.y * d.x * d.x - 2.0 * covariance.z * d.x * d.y + covariance.x * d.y * d.y;
    return energy * onto / (plane_integral() * sqrt(determinant)) * generator(far / determinant);
}

fn effective(g: ptr<function, Decoded>, brdf: Brdf, roughness: f32, w: vec3<f32>) -> f32 {
    let base = lobe_widen(brdf.base, roughness);
    var table = brdf.table;
    let energy = tabulated(&table, vec2<f32>(brdf.roughness, brdf.span), 0u, roughness, 0.0);
    if NORMALISATION == PLANE || NORMALISATION == TANGENT {
        return on_plane(g, base, energy, w);
    }
    return on_sphere(g, base, energy, w);
}

fn effective_diffuse(g: ptr<function, Decoded>, brdf: Brdf, w: vec3<f32>) -> f32 {
    let squares = dot((*g).squares, w * w);
    let products = dot((*g).products, w.xxy * w.yzz);
    return mean_of_positive_part(dot(w, (*g).mean), squares + 2.0 * products);
}
