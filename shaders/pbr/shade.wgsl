// shade: applies the surrounding scene to captures: ambient light, shadows of meshes, fog.
//
// In: the captures' color and transmittance (premultiplied, in their blend space) and their depths, for the pixels of
// the viewport; the lights, shadow maps and fog of Bevy's view (groups 0 and 1). Out: the same picture, shaded;
// transmittance is unchanged.
#import gs4d::srgb
#import bevy_pbr::mesh_view_bindings as view_bindings
#import bevy_pbr::mesh_view_types as view_types
#import bevy_pbr::clustered_forward as clustering
#import bevy_pbr::shadows::{fetch_directional_shadow, fetch_point_shadow, fetch_spot_shadow}
#ifdef DISTANCE_FOG
#import bevy_pbr::fog::{linear_fog, exponential_fog, exponential_squared_fog, atmospheric_fog}
#endif

// The largest half-precision number: an infinite pixel would spread through bloom.
const BRIGHTEST: f32 = 65504.0;
// Depth that stands for infinity, camera units: any fog has its full strength there.
const FAR: f32 = 1e6;
// Number of distances from the surface at which the own shadow of a capture is looked up.
const OWN_STEPS: u32 = 4u;
// Opacities between which a dark pixel changes from particles, which fog does not light, to a surface.
const PARTICLES: f32 = 0.5;
const SURFACE: f32 = 0.95;
// The light of the fog on a pixel of particles, at most, in units of the light of the pixel itself.
const FOG_GAIN: f32 = 4.0;

// Shading settings of one capture, identical to GpuShading in src/plugin/pbr/shade/uniform.rs.
struct Shading {
    // Rows of the transform from the world to the cube from -1 to 1 that bounds the capture.
    cube_from_world: array<vec4<f32>, 3>,
    // Linear color factor in full shadow; w is 1 if the capture receives shadows.
    tint: vec4<f32>,
    // x: weight of the scene's light; y: reciprocal of the light during training; z: offset towards lights, world
    // units; w: distance over which the capture's own shadow sets in, world units, 0 if it casts none.
    light: vec4<f32>,
}

// Identical to GpuSettings in the same file.
struct Settings {
    // Size of the captures' picture, pixels.
    size: vec2<u32>,
    // Number of shadings.
    count: u32,
    // Whether the blend space is linear light.
    is_linear: u32,
    // Whether an environment map surrounds the captures. It contributes to their opacity but not to their depth.
    is_surrounded: u32,
    shadings: array<Shading, #{MOST_SHADINGS}>,
}

@group(2) @binding(0) var colors: texture_2d<f32>;
// Camera units: x the sum of z alpha T, not divided by 1 - T; y the depth at which T falls to one half or below, 0 if
// it never does.
@group(2) @binding(1) var depths: texture_2d<f32>;
@group(2) @binding(2) var<uniform> settings: Settings;

// A point on the visible surface of captures.
struct Point {
    world: vec3<f32>,
    // Along the camera's z axis: negative in front of it.
    view_z: f32,
    // Pixel of the target.
    frag_coord: vec2<f32>,
    // Width of its pixel at its depth, camera units.
    width: f32,
    is_environment: bool,
}

// The transfer functions, mirrored for negative values.
fn to_linear(color: vec3<f32>) -> vec3<f32> {
    if settings.is_linear != 0u {
        return color;
    }
    return sign(color) * srgb::decode(abs(color));
}

fn to_blend_space(color: vec3<f32>) -> vec3<f32> {
    if settings.is_linear != 0u {
        return color;
    }
    return sign(color) * srgb::encode(abs(color));
}

// Returns the point of view space at depth z behind a position in the picture, normalized device coordinates.
fn view_position(place: vec2<f32>, z: f32) -> vec3<f32> {
    let lens = view_bindings::view.clip_from_view;
    let scale = vec2(lens[0][0], lens[1][1]);
    if lens[3][3] == 1.0 {
        return vec3((place - lens[3].xy) / scale, -z);
    }
    return vec3(z * (place + lens[2].xy) / scale, -z);
}

fn point_at(position: vec2<f32>, alpha: f32) -> Point {
    let depth = textureLoad(depths, vec2<u32>(position), 0).xy;
    var point: Point;
    var z = depth.x / max(alpha, 1e-4);
    if settings.is_surrounded != 0u && depth.y != 0.0 {
        z = depth.y;
    } else if settings.is_surrounded != 0u && (alpha > 0.999 || depth.x == 0.0) {
        point.is_environment = true;
        z = FAR;
    }
    let share = position / vec2<f32>(settings.size);
    let place = vec2(2.0 * share.x - 1.0, 1.0 - 2.0 * share.y);
    point.world = (view_bindings::view.world_from_view * vec4(view_position(place, z), 1.0)).xyz;
    point.view_z = -z;
    let beside = place + vec2(2.0 / f32(settings.size.x), 0.0);
    point.width = abs(view_position(beside, z).x - view_position(place, z).x);
    point.frag_coord = view_bindings::view.viewport.xy + share * view_bindings::view.viewport.zw;
    return point;
}

// Returns the shading of the capture at a point. The picture does not contain the index of the capture: the capture in
// whose box the point lies deepest is used. The environment map belongs to the capture with the largest box.
fn shading_of(point: Point) -> u32 {
    var best = 0u;
    var least = 0.0;
    for (var i = 0u; i < settings.count; i++) {
        let rows = settings.shadings[i].cube_from_world;
        let world = vec4(point.world, 1.0);
        let inside = abs(vec3(dot(rows[0], world), dot(rows[1], world), dot(rows[2], world)));
        let reach = max(inside.x, max(inside.y, inside.z));
        let rank = select(reach, -reach, point.is_environment);
        if i == 0u || rank < least {
            best = i;
            least = rank;
        }
    }
    return best;
}

// Returns the ambient light that a white surface reflects, at the camera's exposure.
fn surrounding_light() -> vec3<f32> {
    var light = view_bindings::lights.ambient_color.rgb;
#ifdef ENVIRONMENT_MAP
    if view_bindings::light_probes.view_cubemap_index >= 0 {
        let sum = irradiance(vec3(1.0, 0.0, 0.0)) + irradiance(vec3(-1.0, 0.0, 0.0))
            + irradiance(vec3(0.0, 1.0, 0.0)) + irradiance(vec3(0.0, -1.0, 0.0))
            + irradiance(vec3(0.0, 0.0, 1.0)) + irradiance(vec3(0.0, 0.0, -1.0));
        light += sum / 6.0 * view_bindings::light_probes.intensity_for_view;
    }
#endif
    return light * view_bindings::view.exposure;
}

#ifdef ENVIRONMENT_MAP
fn irradiance(direction: vec3<f32>) -> vec3<f32> {
#ifdef MULTIPLE_LIGHT_PROBES_IN_ARRAY
    return textureSampleLevel(
        view_bindings::diffuse_environment_maps[view_bindings::light_probes.view_cubemap_index],
        view_bindings::environment_map_sampler,
        direction,
        0.0,
    ).rgb;
#else
    return textureSampleLevel(
        view_bindings::diffuse_environment_map,
        view_bindings::environment_map_sampler,
        direction,
        0.0,
    ).rgb;
#endif
}
#endif

// Returns the color factor under a light of which a fraction `visibility` arrives.
fn darkened(tint: vec3<f32>, visibility: f32) -> vec3<f32> {
    return mix(tint, vec3(1.0), visibility);
}

// Returns the color factor of all lights that cast shadows. A capture has no normals: every light counts as
// perpendicular to the surface.
//
// The point is moved towards a light before its shadow is looked up: by `bias` and, if the capture casts a shadow
// itself, by the width of the pixel. Over the distance `own` behind the surface the capture's own shadow sets in
// gradually, so that errors of depth do not appear as sharp blotches.
fn shadow(point: Point, tint: vec3<f32>, bias: f32, own: f32) -> vec3<f32> {
    let steps = select(1u, OWN_STEPS, own > 0.0);
    let first = bias + min(point.width, own);
    let step = own / f32(OWN_STEPS - 1u);
    var factor = vec3(1.0);
    for (var i = 0u; i < view_bindings::lights.n_directional_lights; i++) {
        let light = &view_bindings::lights.directional_lights[i];
        if ((*light).flags & view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
            continue;
        }
        let toward = (*light).direction_to_light;
        var visibility = 0.0;
        for (var k = 0u; k < steps; k++) {
            let place = vec4(point.world + (first + f32(k) * step) * toward, 1.0);
            visibility += fetch_directional_shadow(i, place, toward, point.view_z, point.frag_coord);
        }
        factor *= darkened(tint, visibility / f32(steps));
    }
    let is_orthographic = view_bindings::view.clip_from_view[3][3] == 1.0;
    let cluster = clustering::view_fragment_cluster_index(point.frag_coord, point.view_z, is_orthographic);
    let ranges = clustering::unpack_clusterable_object_index_ranges(cluster);
    // Point lights come first, then spot lights.
    for (var i = ranges.first_point_light_index_offset; i < ranges.first_reflection_probe_index_offset; i++) {
        let id = clustering::get_clusterable_object_id(i);
        let light = &view_bindings::clustered_lights.data[id];
        if ((*light).flags & view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
            continue;
        }
        let ray = (*light).position_radius.xyz - point.world;
        let squared = dot(ray, ray);
        let toward = ray * inverseSqrt(max(squared, 1e-12));
        // The window with which Bevy ends lights at their range, without the falloff inside the range: shadows are a
        // contrast.
        let share = squared * (*light).color_inverse_square_range.w;
        let window = saturate(1.0 - share * share);
        var weight = window * window;
        let is_spot = i >= ranges.first_spot_light_index_offset;
        if is_spot {
            weight *= spot_cone(id, toward);
        }
        var visibility = 0.0;
        for (var k = 0u; k < steps; k++) {
            let place = vec4(point.world + (first + f32(k) * step) * toward, 1.0);
            if is_spot {
                visibility += fetch_spot_shadow(id, place, toward, (*light).shadow_map_near_z, point.frag_coord);
            } else {
                visibility += fetch_point_shadow(id, place, toward, point.frag_coord);
            }
        }
        factor *= mix(vec3(1.0), darkened(tint, visibility / f32(steps)), weight);
    }
    return factor;
}

// Returns the intensity of a spot light's cone in a direction towards the light, from 0 to 1.
fn spot_cone(id: u32, toward: vec3<f32>) -> f32 {
    let light = &view_bindings::clustered_lights.data[id];
    let packed = (*light).light_custom_data;
    let y = sqrt(max(0.0, 1.0 - packed.x * packed.x - packed.y * packed.y));
    let is_downwards = ((*light).flags & view_types::POINT_LIGHT_FLAGS_SPOT_LIGHT_Y_NEGATIVE) != 0u;
    let axis = vec3(packed.x, select(y, -y, is_downwards), packed.y);
    let inside = saturate(dot(-axis, toward) * packed.z + packed.w);
    return inside * inside;
}

#ifdef DISTANCE_FOG
// Returns a linear color behind Bevy's fog, as on its meshes. `share` is the fraction of the light of the fog itself
// that is added.
fn fogged(color: vec3<f32>, point: Point, share: f32) -> vec3<f32> {
    let haze = view_bindings::fog;
    let ray = point.world - view_bindings::view.world_position;
    let distance = length(ray);
    let direction = ray / max(distance, 1e-6);
    var scattering = vec3(0.0);
    if haze.directional_light_color.a > 0.0 {
        for (var i = 0u; i < view_bindings::lights.n_directional_lights; i++) {
            let light = &view_bindings::lights.directional_lights[i];
            let alignment = max(dot(direction, (*light).direction_to_light), 0.0);
            let glow = pow(alignment, haze.directional_light_exponent) * view_bindings::view.exposure;
            var visibility = 1.0;
            if ((*light).flags & view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u {
                let place = vec4(point.world, 1.0);
                visibility = fetch_directional_shadow(i, place, -direction, point.view_z, point.frag_coord);
            }
            scattering += glow * visibility * (*light).color.rgb;
        }
    }
    return in_fog(color, distance, scattering) - (1.0 - share) * in_fog(vec3(0.0), distance, scattering);
}

// Returns a linear color behind Bevy's fog at this distance.
fn in_fog(color: vec3<f32>, distance: f32, scattering: vec3<f32>) -> vec3<f32> {
    let haze = view_bindings::fog;
    let plain = vec4(color, 1.0);
    if haze.mode == view_types::FOG_MODE_LINEAR {
        return linear_fog(haze, plain, distance, scattering).rgb;
    } else if haze.mode == view_types::FOG_MODE_EXPONENTIAL {
        return exponential_fog(haze, plain, distance, scattering).rgb;
    } else if haze.mode == view_types::FOG_MODE_EXPONENTIAL_SQUARED {
        return exponential_squared_fog(haze, plain, distance, scattering).rgb;
    } else if haze.mode == view_types::FOG_MODE_ATMOSPHERIC {
        return atmospheric_fog(haze, plain, distance, scattering).rgb;
    }
    return color;
}

// Returns the fraction of the light of the fog in front of a pixel of this linear color. A surface has all of it.
// Particles darker than the fog have less: training on a black background leaves many faint black Gaussians, which are
// invisible over black and must stay invisible in fog.
fn fog_share(color: vec3<f32>, alpha: f32) -> f32 {
    let encoded = srgb::encode(max(color, vec3(0.0)));
    let brightness = max(encoded.x, max(encoded.y, encoded.z));
    return max(smoothstep(PARTICLES, SURFACE, alpha), saturate(FOG_GAIN * brightness));
}
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let picture = textureLoad(colors, vec2<u32>(position.xy), 0);
    let alpha = 1.0 - picture.a;
    if alpha <= 0.0 {
        return picture;
    }
    let point = point_at(position.xy, alpha);
    var factor = vec3(1.0);
    if settings.count > 0u {
        let shading = settings.shadings[shading_of(point)];
        factor = mix(factor, surrounding_light() * shading.light.y, shading.light.x);
        if shading.tint.a > 0.0 && !point.is_environment {
            factor *= shadow(point, shading.tint.rgb, shading.light.z, shading.light.w);
        }
    }
#ifndef DISTANCE_FOG
    // An unshaded pixel is unchanged bit for bit.
    if all(factor == vec3(1.0)) {
        return picture;
    }
#endif
    var color = factor * to_linear(picture.rgb / alpha);
#ifdef DISTANCE_FOG
    color = fogged(color, point, fog_share(color, alpha));
#endif
    let shaded = to_blend_space(color) * alpha;
    return vec4(clamp(shaded, vec3(-BRIGHTEST), vec3(BRIGHTEST)), picture.a);
}
