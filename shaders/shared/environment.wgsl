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
