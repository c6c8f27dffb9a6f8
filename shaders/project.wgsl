// project: slices each Gaussian at the view's time and projects it.
// In: Gaussians, colour coefficients, an instance. Out: one splat and one depth key for each; the key of an invisible splat is
// INVISIBLE. Section 3.3 of the 4DGS model, in its order; twin of src/gaussian/projection.rs and src/reference/project.rs.
#import gs4d::types::{Gaussian, Instance, Splat, FILTER_NONE, INVISIBLE}
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_cosine}

const TILE_SIZE: f32 = 16.0;
const MARGINAL_CUTOFF: f32 = 0.05;
const LOW_PASS: f32 = 0.3;
const FRUSTUM_CLAMP: f32 = 1.3;
// 255 = 1 / ALPHA_MIN.
const INVERSE_ALPHA_MIN: f32 = 255.0;

@group(0) @binding(0) var<uniform> instance: Instance;
@group(0) @binding(1) var<storage, read_write> splats: array<Splat>;
@group(0) @binding(2) var<storage, read_write> depth_keys: array<u32>;
// The list of `activate`; not read without a filter.
@group(0) @binding(3) var<storage, read> active_list: array<u32>;
@group(0) @binding(4) var<storage, read> active_counts: array<u32>;
@group(1) @binding(0) var<storage, read> gaussians: array<Gaussian>;
@group(1) @binding(1) var<storage, read> harmonics: array<vec4<f32>>;

@compute @workgroup_size(256)
fn project(@builtin(global_invocation_id) id: vec3<u32>) {
    let slot = instance.first_slot + id.x;
    var index = id.x;
    if instance.filter_mode == FILTER_NONE {
        if id.x >= instance.count {
            return;
        }
    } else {
        if id.x >= active_counts[instance.part] {
            return;
        }
        index = active_list[slot];
    }
    depth_keys[slot] = project_one(index, slot);
}

// Writes the splat of a Gaussian into its slot and returns its depth key.
fn project_one(index: u32, slot: u32) -> u32 {
    let g = gaussians[index];
    let dt = instance.time - g.mean_t;
    let z = dt * g.inverse_sigma_t;
    let marginal = exp(-0.5 * z * z);
    if marginal <= MARGINAL_CUTOFF {
        return INVISIBLE;
    }
    let mean = vec4(g.mean + g.velocity * dt, 1.0);
    let q = vec3(dot(instance.camera_x, mean), dot(instance.camera_y, mean), dot(instance.camera_z, mean));
    if q.z <= instance.near {
        return INVISIBLE;
    }
    let size = vec2<f32>(instance.size);
    let ndc = vec2(dot(instance.clip_x, mean), dot(instance.clip_y, mean)) / (q.z + 1e-7);
    let center = ((ndc + 1.0) * size - 1.0) * 0.5;

    // The nesting of min and max matters: with the field-of-view sentinel the limits are negative.
    let limit = FRUSTUM_CLAMP * instance.tan_fov;
    let ray = min(limit, max(-limit, q.xy / q.z));
    let j = instance.focal / q.z;
    let mx = j.x * (instance.camera_x.xyz - ray.x * instance.camera_z.xyz);
    let my = j.y * (instance.camera_y.xyz - ray.y * instance.camera_z.xyz);
    let ca = g.covariance_a;
    let cb = g.covariance_b;
    let covariance = mat3x3(ca.x, ca.y, ca.z, ca.y, ca.w, cb.x, ca.z, cb.x, cb.y);
    let cx = covariance * mx;
    let a = dot(mx, cx) + LOW_PASS;
    let b = dot(my, cx);
    let c = dot(my, covariance * my) + LOW_PASS;
    let det = a * c - b * b;
    if det == 0.0 {
        return INVISIBLE;
    }
    let mid = 0.5 * (a + c);
    let radius = ceil(3.0 * sqrt(mid + sqrt(max(0.1, mid * mid - det))));
    // Neither infinite nor not a number.
    if !(radius <= 3.4e38) {
        return INVISIBLE;
    }
    let grid = vec2<f32>(instance.tiles);
    var low = clamp(trunc((center - radius) / TILE_SIZE), vec2(0.0), grid);
    var high = clamp(trunc((center + radius + (TILE_SIZE - 1.0)) / TILE_SIZE), vec2(0.0), grid);

    // Tiles where alpha never reaches 1/255 are left out; blend would skip them. See Projected::contributing_tiles.
    let opacity = g.opacity * marginal;
    if det > 0.0 {
        let energy = 2.0 * log(opacity * INVERSE_ALPHA_MIN);
        if energy < -1e-3 {
            return INVISIBLE;
        }
        let half = sqrt(max(energy, 0.0) * vec2(a, c)) * 1.001 + 0.01;
        low = max(low, floor((center - half) / TILE_SIZE));
        high = min(high, floor((center + half) / TILE_SIZE) + 1.0);
    }
    // Written so that a value that is not a number is invisible.
    if !(high.x > low.x && high.y > low.y) {
        return INVISIBLE;
    }

    var seen = g.mean;
    if instance.displaced != 0u {
        seen = mean.xyz;
    }
    var splat: Splat;
    splat.center = center;
    splat.opacity = opacity;
    splat.depth = q.z;
    splat.conic = vec3(c, -b, a) / det;
    splat.color = color(index, normalize(seen - instance.camera_position), -dt);
    splat.tiles_low = u32(low.x) | (u32(low.y) << 16u);
    splat.tiles_high = u32(high.x) | (u32(high.y) << 16u);
    splats[slot] = splat;
    return bitcast<u32>(q.z);
}

fn color(index: u32, direction: vec3<f32>, tau: f32) -> vec3<f32> {
    let at = index * instance.stride;
    if instance.degree == 0u {
        return max(harmonics[at].xyz * 0.28209479 + 0.5, vec3(0.0));
    }
    let b0 = basis_first(direction);
    if instance.degree == 1u {
        return max(four(at, b0) + 0.5, vec3(0.0));
    }
    let b1 = basis_second(direction);
    let b2 = basis_third(direction);
    if instance.degree == 2u {
        let ninth = harmonics[at + 6u].xyz * b2.x;
        return max(four(at, b0) + four(at + 3u, b1) + ninth + 0.5, vec3(0.0));
    }
    let b3 = basis_fourth(direction);
    var sum = four(at, b0) + four(at + 3u, b1) + four(at + 6u, b2) + four(at + 9u, b3);
    for (var n = 1u; n <= instance.degree_t; n++) {
        let block = at + 12u * n;
        let value = four(block, b0) + four(block + 3u, b1) + four(block + 6u, b2) + four(block + 9u, b3);
        sum += time_cosine(f32(n), tau, instance.time_span) * value;
    }
    return max(sum + 0.5, vec3(0.0));
}

// Sum of four coefficients (three vec4s from `at`) times their basis values.
fn four(at: u32, basis: vec4<f32>) -> vec3<f32> {
    let u = harmonics[at];
    let v = harmonics[at + 1u];
    let w = harmonics[at + 2u];
    return u.xyz * basis.x + vec3(u.w, v.xy) * basis.y + vec3(v.zw, w.x) * basis.z + w.yzw * basis.w;
}
