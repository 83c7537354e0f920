// Functions for renderers that have materials and lights of their own. `ndf_decode_lobes` looks up a place's
// lobes; `ndf_shade` is the light of one lamp, to be called once a lamp; `ndf_shade_environment` is the
// mirrored light of a prefiltered cube. Directions lie in the tangent frame: x along u, y against v (v runs
// down the rows), z out of the surface.

// A material, at a place.
struct NdfMaterial {
    // Albedo of its matt part, linear RGB: of metals 0.
    diffuse: vec3<f32>,
    // Reflectance at normal incidence, linear RGB: of metals the base colour, else about 0.04.
    specular: vec3<f32>,
    // Width of its GGX: the square of glTF's roughness.
    alpha: f32,
}

// A lobe of normals, ready to be shaded.
struct NdfLobe {
    // Mean direction, unit length.
    normal: vec3<f32>,
    // Share of the place.
    weight: f32,
    // Variance of its slopes along each axis.
    variance: f32,
    // Colours that the lobe carries, where the map has attributes: the first is its albedo, the second its
    // reflectance at normal incidence. Else 0.
    diffuse: vec3<f32>,
    specular: vec3<f32>,
}

// A tangent frame, in the space of an environment: unit vectors along u, against v, and out of the surface.
struct NdfFrame {
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    normal: vec3<f32>,
}

// Direction in the frame's space of one in the frame.
fn ndf_outward(frame: NdfFrame, towards: vec3<f32>) -> vec3<f32> {
    return towards.x * frame.tangent + towards.y * frame.bitangent + towards.z * frame.normal;
}

// Lobes of a place. Their weights add up to 1.
struct NdfLobes {
    lobe: array<NdfLobe, LOBES>,
}

// Looks up a place. Call it where all pixels of a quad do: it takes derivatives.
fn ndf_decode_lobes(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2<f32>) -> NdfLobes {
    var channels = channels_at(map, map_sampler, uv);
    return lobes_of(&channels);
}

// Lobes of channels that were looked up.
fn lobes_of(channels: ptr<function, Channels>) -> NdfLobes {
    let decoded = decode(channels);
    var lobes: NdfLobes;
    for (var j = 0u; j < LOBES; j++) {
        let carried = params_of(channels, j, SurfaceParams(vec3<f32>(0.0), 0.0, vec3<f32>(0.0)));
        let lobe = decoded[j];
        lobes.lobe[j] = NdfLobe(direction(lobe), lobe.weight, lobe.variance, carried.diffuse, carried.specular);
    }
    return lobes;
}

// The material of a lobe: its own colours where it carries them, as wide as the renderer has it.
fn ndf_material(lobe: NdfLobe, material: NdfMaterial) -> NdfMaterial {
    var own = material;
    if ATTRIBUTES > 0u {
        own.diffuse = lobe.diffuse;
    }
    if ATTRIBUTES > 1u {
        own.specular = lobe.specular;
    }
    own.alpha = min(ndf_width(material.alpha), 1.0);
    return own;
}

// Light to the eye of one lamp, for each unit of its irradiance on a plane that faces it. `wi` and `wo` are
// unit vectors to the lamp and to the eye.
fn ndf_shade(lobes: NdfLobes, material: NdfMaterial, wi: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let h = normalize(wi + wo);
    let u = saturate(dot(wo, h));
    var light = vec3<f32>(0.0);
    for (var j = 0u; j < LOBES; j++) {
        let lobe = lobes.lobe[j];
        if lobe.weight > 0.0 {
            let own = ndf_material(lobe, material);
            let cosine = saturate(dot(lobe.normal, h));
            let tail = ndf_tail(own.alpha, lobe.variance);
            let far = ndf_ggx(ndf_widened(own.alpha, lobe.variance), cosine);
            var mirrored = tail * far * by_facet(lobe.normal, own, wi, wo, u);
            if tail < 1.0 {
                let near = ndf_core(own.alpha, lobe.variance, cosine);
                let facet = ndf_shining_facet(lobe.normal, lobe.variance, own.alpha, h);
                mirrored += (1.0 - tail) * near * by_facet(facet, own, wi, wo, u);
            }
            let matt = lambert_evaluate(lobe.variance, dot(lobe.normal, wi)) / NDF_PI;
            light += lobe.weight * (mirrored + matt * own.diffuse);
        }
    }
    return light;
}

// Mirrored light of a lamp by a facet, for each unit of the facets' density; `u` is the cosine between the
// facet and both directions.
fn by_facet(facet: vec3<f32>, material: NdfMaterial, wi: vec3<f32>, wo: vec3<f32>, u: f32) -> vec3<f32> {
    let incident = saturate(dot(facet, wi));
    let seen = clamp(dot(facet, wo), 1e-4, 1.0);
    return incident * ndf_visibility(material.alpha, incident, seen, u)
        * ndf_tint(material.specular, u) * ndf_compensation(material.specular, material.alpha, seen);
}

// Mean normal of a place, unit length: for matt light of an environment, and for all that wants one normal.
fn ndf_normal(lobes: NdfLobes) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var j = 0u; j < LOBES; j++) {
        sum += lobes.lobe[j].weight * lobes.lobe[j].normal;
    }
    return direction_or_up(sum);
}

// Part of an environment that a lobe mirrors.
struct NdfMirrored {
    // Direction from which light comes, unit length.
    direction: vec3<f32>,
    // Roughness at which the prefiltered environment is looked up: the root of an alpha.
    roughness: f32,
    // Factor on the light that is found there.
    tint: vec3<f32>,
}

// Direction, roughness and factor of a lobe's look-up, for environments that are no cubes. The factor is the
// material's own: a lobe's normals spread what is mirrored, and mirror no less.
fn ndf_mirrored(lobe: NdfLobe, material: NdfMaterial, wo: vec3<f32>) -> NdfMirrored {
    let own = ndf_material(lobe, material);
    let seen = clamp(dot(lobe.normal, wo), 1e-4, 1.0);
    let width = ndf_widened(own.alpha, ndf_mirrored_variance(lobe.variance, seen));
    let share = ndf_split_sum(sqrt(own.alpha), seen);
    return NdfMirrored(
        reflect(-wo, lobe.normal),
        sqrt(min(width, 1.0)),
        (own.specular * share.x + share.y) * ndf_compensation(own.specular, own.alpha, seen),
    );
}

// Mirrored light of an environment that a cube holds, blurred more on each of its `levels`; `frame` lies in
// the cube's space.
fn ndf_shade_environment(
    lobes: NdfLobes,
    material: NdfMaterial,
    wo: vec3<f32>,
    frame: NdfFrame,
    room: texture_cube<f32>,
    room_sampler: sampler,
    levels: f32,
) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    for (var j = 0u; j < LOBES; j++) {
        let lobe = lobes.lobe[j];
        if lobe.weight > 0.0 {
            let seen = ndf_mirrored(lobe, material, wo);
            let level = ndf_room_level(seen.roughness, levels);
            light += lobe.weight * seen.tint
                * textureSampleLevel(room, room_sampler, ndf_outward(frame, seen.direction), level).xyz;
        }
    }
    return light;
}

// Scale and bias of a reflectance under even light (Karis 2014, for mobile devices).
fn ndf_split_sum(roughness: f32, cosine: f32) -> vec2<f32> {
    let r = roughness * vec4<f32>(-1.0, -0.0275, -0.572, 0.022) + vec4<f32>(1.0, 0.0425, 1.04, -0.04);
    let a = min(r.x * r.x, exp2(-9.28 * cosine)) * r.x + r.y;
    return vec2<f32>(-1.04, 1.04) * a + r.zw;
}

// Schlick's Fresnel, from `f0` to `f90`.
fn ndf_schlick(f0: vec3<f32>, f90: f32, u: f32) -> vec3<f32> {
    let rest = 1.0 - u;
    return mix(f0, vec3<f32>(f90), rest * rest * rest * rest * rest);
}

// Smith's masking and shadowing of GGX, correlated by height, over four cosines (Heitz 2014).
fn ndf_smith(alpha: f32, incident: f32, seen: f32) -> f32 {
    let a2 = alpha * alpha;
    let masked = incident * sqrt(seen * seen * (1.0 - a2) + a2);
    let shadowed = seen * sqrt(incident * incident * (1.0 - a2) + a2);
    return 0.5 / max(masked + shadowed, 1e-6);
}

// Light that facets pass on to each other, as a factor on what is reflected once (Fdez-Agüera 2019;
// Filament).
fn ndf_passed_on(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    let share = ndf_split_sum(sqrt(alpha), seen);
    return 1.0 + f0 * (1.0 / max(share.x + share.y, 1e-3) - 1.0);
}
