// The environment map: a lat-long texture on a sphere of radius 60. CPU reference: src/scene/environment.rs.
#define_import_path gs4d::environment

const RADIUS: f32 = 60.0;

// Returns the texel coordinates of the point where the ray from `origin` along the unit vector `direction` leaves the
// sphere.
fn environment_texel(origin: vec3<f32>, direction: vec3<f32>, size: vec2<u32>) -> vec2<f32> {
    let along = dot(origin, direction);
    // Rays from outside may miss the sphere: then the point of the ray nearest to the sphere is used.
    let reach = -along + sqrt(max(along * along - (dot(origin, origin) - RADIUS * RADIUS), 0.0));
    let hit = origin + direction * reach;
    let u = atan2(hit.y, hit.x) / 6.2831853 + 0.5;
    let v = acos(clamp(hit.z / RADIUS, -1.0, 1.0)) / 3.1415927;
    return vec2(u, v) * vec2<f32>(size) - 0.5;
}

// Returns the texel coordinates behind the center of a pixel of a picture. `projection` is P00, P11, P02, P12; the axes
// are the columns of camera-to-world, w: the camera position.
fn environment_behind(
    pixel: vec2<f32>,
    picture: vec2<u32>,
    projection: vec4<f32>,
    axis_x: vec4<f32>,
    axis_y: vec4<f32>,
    axis_z: vec4<f32>,
    size: vec2<u32>,
) -> vec2<f32> {
    let ndc = (pixel + 0.5) / vec2<f32>(picture) * 2.0 - 1.0;
    let ray = vec3((ndc - projection.zw) / projection.xy, 1.0);
    let world = axis_x.xyz * ray.x + axis_y.xyz * ray.y + axis_z.xyz * ray.z;
    return environment_texel(vec3(axis_x.w, axis_y.w, axis_z.w), normalize(world), size);
}

// Returns the weight of a texel in the color at these texel coordinates.
fn bilinear_weight(at: vec2<f32>, texel: vec2<f32>) -> f32 {
    return (1.0 - abs(at.x - texel.x)) * (1.0 - abs(at.y - texel.y));
}
