// Bevy's standard material, each of a texel's lobes shaded by Bevy's own light.

#import bevy_pbr::{
    ambient,
    clustered_forward as clustering,
    forward_io::{FragmentOutput, VertexOutput},
    lighting,
    lighting::LAYER_BASE,
    mesh_types::MESH_FLAGS_SHADOW_RECEIVER_BIT,
    mesh_view_bindings as view_bindings,
    mesh_view_types,
    pbr_fragment::pbr_input_from_standard_material,
    pbr_functions,
    pbr_types,
    shadows,
}
#ifdef ENVIRONMENT_MAP
#import bevy_pbr::environment_map
#endif
#import ndfmap::lobes::{
    ndf_core,
    ndf_shining_facet,
    ndf_ggx,
    ndf_mirrored_variance,
    ndf_share,
    ndf_tail,
    ndf_widened,
}

struct Ranges {
    low: array<vec4<f32>, #{NDF_MOST}>,
    span: array<vec4<f32>, #{NDF_MOST}>,
    // Texels of level 0.
    size: vec2<f32>,
    from_level: f32,
    anisotropy: f32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var ndf_map: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var ndf_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var<uniform> ranges: Ranges;

// Lobes of the map and one more, the last: the normal map's own, which fades.
const ALL = #{NDF_LOBES} + 1;

struct NdfLobe {
    // Unit vector.
    normal: vec3<f32>,
    // Share of the fragment.
    weight: f32,
    // Variance of slopes along each axis.
    variance: f32,
}

// The lobe that four filtered sums stand for, normal in the tangent frame: x along u, y against v, z out.
// Sums are of the weight and of the weight times (x, y, 1 - z), of which the last is small on flat maps.
fn lobe_of(sums: vec4<f32>) -> NdfLobe {
    let alpha = max(sums.x, 0.0);
    let r = sums.yzw / max(alpha, 1e-6);
    let spread = clamp(2.0 * r.z - r.z * r.z - dot(r.xy, r.xy), 0.0, 1.0);
    let size = max(sqrt(1.0 - spread), 1e-3);
    var lobe: NdfLobe;
    lobe.normal = normalize(vec3<f32>(r.xy, max(1.0 - r.z, 1e-3)));
    // Half a step of eight bits says nothing.
    lobe.weight = select(0.0, alpha, alpha > 2e-3);
    // 1 / kappa, with kappa of a mean this long (Banerjee et al. 2005).
    lobe.variance = spread / (size * (3.0 - size * size));
    return lobe;
}

// Lobes of the fragment, in world space.
fn decode(uv: vec2<f32>, frame: mat3x3<f32>, side: f32, near: vec3<f32>) -> array<NdfLobe, ALL> {
    var lobes: array<NdfLobe, ALL>;
    let share = ndf_share(dpdx(uv) * ranges.size, dpdy(uv) * ranges.size, ranges.from_level, ranges.anisotropy);
    var total = 0.0;
    for (var j = 0; j < #{NDF_LOBES}; j++) {
        let stored = textureSample(ndf_map, ndf_sampler, uv, j);
        lobes[j] = lobe_of(ranges.low[j] + ranges.span[j] * stored);
        lobes[j].normal = normalize(side * (frame * lobes[j].normal));
        total += lobes[j].weight;
    }
    for (var j = 0; j < #{NDF_LOBES}; j++) {
        lobes[j].weight *= share / max(total, 1e-6);
    }
    lobes[#{NDF_LOBES}] = NdfLobe(near, 1.0 - share, 0.0);
    return lobes;
}

// Light of one lamp: the engine's, twice a lobe. Diffuse light goes by the normal map.
fn towards(input: lighting::LightingInput, lobes: ptr<function, array<NdfLobe, ALL>>, kind: u32, id: u32) -> vec3<f32> {
    var matt = input;
    matt.F0_dielectric = vec3<f32>(0.0);
    matt.F0_metallic = vec3<f32>(0.0);
    var light = lamp(&matt, kind, id, true);
    let alpha = input.layers[LAYER_BASE].roughness;
    let h = normalize(direction(input, kind, id) + input.V);
    for (var j = 0; j < ALL; j++) {
        let lobe = (*lobes)[j];
        if lobe.weight <= 0.0 {
            continue;
        }
        let cosine = saturate(dot(lobe.normal, h));
        let tail = ndf_tail(alpha, lobe.variance);
        let far = tail * ndf_ggx(ndf_widened(alpha, lobe.variance), cosine);
        light += lobe.weight * far * by_facet(input, lobe.normal, h, kind, id);
        if tail < 1.0 {
            let near = (1.0 - tail) * ndf_core(alpha, lobe.variance, cosine);
            light += lobe.weight * near
                * by_facet(input, ndf_shining_facet(lobe.normal, lobe.variance, alpha, h), h, kind, id);
        }
    }
    return light;
}

// The engine's mirrored light of a lamp by a facet, for each unit of the facets' density.
fn by_facet(input: lighting::LightingInput, facet: vec3<f32>, h: vec3<f32>, kind: u32, id: u32) -> vec3<f32> {
    var shiny = input;
    shiny.layers[LAYER_BASE].N = facet;
    shiny.layers[LAYER_BASE].NdotV = max(dot(facet, input.V), 0.0001);
    shiny.layers[LAYER_BASE].R = reflect(-input.V, facet);
    let own = ndf_ggx(input.layers[LAYER_BASE].roughness, saturate(dot(facet, h)));
    return lamp(&shiny, kind, id, false) / max(own, 1e-6);
}

const POINT = 0u;
const SPOT = 1u;
const DIRECTIONAL = 2u;

// Unit vector to a lamp.
fn direction(input: lighting::LightingInput, kind: u32, id: u32) -> vec3<f32> {
    if kind == DIRECTIONAL {
        return view_bindings::lights.directional_lights[id].direction_to_light.xyz;
    }
    return normalize(view_bindings::clustered_lights.data[id].position_radius.xyz - input.P);
}

// The engine's light of a lamp.
fn lamp(input: ptr<function, lighting::LightingInput>, kind: u32, id: u32, diffuse: bool) -> vec3<f32> {
    if kind == DIRECTIONAL {
        return lighting::directional_light(id, input, diffuse);
    }
    if kind == SPOT {
        return lighting::spot_light(id, input, diffuse);
    }
    return lighting::point_light(id, input, diffuse, true);
}

// The engine's shadow of a lamp: 1 in full light.
fn shadow(in: pbr_types::PbrInput, kind: u32, id: u32, view_z: f32) -> f32 {
    if (in.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) == 0u {
        return 1.0;
    }
    if kind == DIRECTIONAL {
        let casts = view_bindings::lights.directional_lights[id].flags
            & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT;
        if casts == 0u {
            return 1.0;
        }
        return shadows::fetch_directional_shadow(id, in.world_position, in.world_normal, view_z, in.frag_coord.xy);
    }
    let light = view_bindings::clustered_lights.data[id];
    if (light.flags & mesh_view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
        return 1.0;
    }
    if kind == SPOT {
        let near = light.shadow_map_near_z;
        return shadows::fetch_spot_shadow(id, in.world_position, in.world_normal, near, in.frag_coord.xy);
    }
    return shadows::fetch_point_shadow(id, in.world_position, in.world_normal, in.frag_coord.xy);
}

fn lit(in: pbr_types::PbrInput, lobes: ptr<function, array<NdfLobe, ALL>>) -> vec4<f32> {
    let color = in.material.base_color;
    let metallic = in.material.metallic;
    let perceptual = in.material.perceptual_roughness;
    let NdotV = max(dot(in.N, in.V), 0.0001);
    let diffuse_color = pbr_functions::calculate_diffuse_color(color.rgb, metallic, 0.0, 0.0);
    let F0 = pbr_functions::calculate_F0(color.rgb, metallic, in.material.reflectance);

    var input: lighting::LightingInput;
    input.layers[LAYER_BASE].N = in.N;
    input.layers[LAYER_BASE].NdotV = NdotV;
    input.layers[LAYER_BASE].R = reflect(-in.V, in.N);
    input.layers[LAYER_BASE].perceptual_roughness = perceptual;
    input.layers[LAYER_BASE].roughness = lighting::perceptualRoughnessToRoughness(perceptual);
    input.P = in.world_position.xyz;
    input.V = in.V;
    input.diffuse_color = diffuse_color;
    input.metallic = metallic;
    input.F0_dielectric = pbr_functions::calculate_F0_dielectric(in.material.reflectance);
    input.F0_metallic = color.rgb;
    input.F_ab = lighting::F_AB(perceptual, NdotV);

    let view = view_bindings::view.view_from_world;
    let view_z = dot(vec4<f32>(view[0].z, view[1].z, view[2].z, view[3].z), in.world_position);
    let cluster = clustering::view_fragment_cluster_index(in.frag_coord.xy, view_z, in.is_orthographic);
    var near = clustering::unpack_clusterable_object_index_ranges(cluster);
    var light = vec3<f32>(0.0);
    for (var i = near.first_point_light_index_offset; i < near.first_reflection_probe_index_offset; i++) {
        let id = clustering::get_clusterable_object_id(i);
        let kind = select(SPOT, POINT, i < near.first_spot_light_index_offset);
        light += shadow(in, kind, id, view_z) * towards(input, lobes, kind, id);
    }
    for (var id = 0u; id < view_bindings::lights.n_directional_lights; id++) {
        light += shadow(in, DIRECTIONAL, id, view_z) * towards(input, lobes, DIRECTIONAL, id);
    }

    // Even light and the room's, once a lobe: as wide as the lobe makes it, in the direction and as bright as
    // the material's own facets have it.
    let alpha = input.layers[LAYER_BASE].roughness;
    for (var j = 0; j < ALL; j++) {
        let lobe = (*lobes)[j];
        if lobe.weight > 0.0 {
            let cosine = max(dot(lobe.normal, in.V), 0.0001);
            light += lobe.weight * ambient::ambient_light(
                in.world_position, lobe.normal, in.V, cosine, diffuse_color, F0, perceptual, in.diffuse_occlusion);
#ifdef ENVIRONMENT_MAP
            let width = ndf_widened(alpha, ndf_mirrored_variance(lobe.variance, cosine));
            var seen = input;
            seen.layers[LAYER_BASE].N = lobe.normal;
            seen.layers[LAYER_BASE].NdotV = cosine;
            seen.layers[LAYER_BASE].R = reflect(-in.V, lobe.normal);
            seen.layers[LAYER_BASE].perceptual_roughness = sqrt(min(width, 1.0));
            seen.F_ab = lighting::F_AB(perceptual, cosine);
            let room = environment_map::environment_map_light(&seen, &near, false);
            light += lobe.weight * (room.diffuse * in.diffuse_occlusion + room.specular * in.specular_occlusion);
#endif
        }
    }

    let glow = in.material.emissive.rgb * color.a * mix(1.0, view_bindings::view.exposure, in.material.emissive.a);
    return vec4<f32>(view_bindings::view.exposure * light + glow, color.a);
}

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
    var input = pbr_input_from_standard_material(in, is_front);
    input.material.base_color = pbr_functions::alpha_discard(input.material, input.material.base_color);
    var bare = in.uv;
#ifdef STANDARD_MATERIAL_NORMAL_MAP_UV_B
#ifdef VERTEX_UVS_B
    bare = in.uv_b;
#endif
#endif
    let uv = (input.material.uv_transform * vec3<f32>(bare, 1.0)).xy;
    let frame = pbr_functions::calculate_tbn_mikktspace(input.world_normal, in.world_tangent);
    let flags = input.material.flags;
    let away = (flags & pbr_types::STANDARD_MATERIAL_FLAGS_DOUBLE_SIDED_BIT) != 0u && !is_front;
    var lobes = decode(uv, frame, select(1.0, -1.0, away), input.N);
    var out: FragmentOutput;
    if (flags & pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT) == 0u {
        out.color = lit(input, &lobes);
    } else {
        out.color = input.material.base_color;
    }
    out.color = pbr_functions::main_pass_post_lighting_processing(input, out.color);
    return out;
}
