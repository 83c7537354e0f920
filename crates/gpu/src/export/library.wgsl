// Functions for other programs to call. `ndf_shade` looks up a place of the map and shades it;
// `ndf_shade_channels` shades channels that were looked up otherwise. `ndf_brdf` is the lobe and its model.

// A place to be shaded, in its tangent frame: x along u, y against v (v runs down the rows), z out of the
// surface.
struct NdfPlace {
    // Unit vector to the light.
    wi: vec3<f32>,
    // Unit vector to the eye.
    wo: vec3<f32>,
    // Diffuse albedo, linear RGB.
    diffuse: vec3<f32>,
    // Reflectance at normal incidence, linear RGB.
    specular: vec3<f32>,
}

// Radiance to the eye, per unit of the light's irradiance on a plane that faces it.
fn ndf_shade_channels(channels: ptr<function, Channels>, place: NdfPlace) -> vec3<f32> {
    if place.wi.z <= 0.0 || place.wo.z <= 0.0 {
        return vec3<f32>(0.0);
    }
    var decoded = decode(channels);
    let params = SurfaceParams(place.diffuse, 0.0, place.specular);
    return reflect_channels(channels, &decoded, params, ndf_brdf(), directions_between(place.wi, place.wo));
}
