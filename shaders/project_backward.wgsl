// project_backward: from the gradients of splats to those of the raw parameters: projection, slice, color and activations.
// In: what `project` read and wrote, the sums of `blend_backward`. Out: the gradients of this view, added to those of the batch so far.
// CPU reference: src/gaussian/gradient.rs; equations: sections 7.2 to 7.4 of the 4DGS model. COMPAT: as the original computes them, with
// the deviations of section 7.5.
#import gs4d::types::{SplatRecord, TrainedRecord, TrainedScene, INVISIBLE}
#import gs4d::records::{covariance_of, read_splat}
#import gs4d::tile::tile_count
#import gs4d::capture::{index_of, instance, load_gaussian}
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_angle, time_cosine}
#import gs4d::harmonics::{slope_first, slope_second, slope_third, slope_fourth}
#import gs4d::trained::{left_matrix, opacity_of, outer, right_matrix, rotation_3d, slice_of, ROTATED_4D, STATIC_3D}

// As in `project`.
const FRUSTUM_CLAMP: f32 = 1.3;
const LOW_PASS: f32 = 0.3;
const TAU: f32 = 6.2831853;
// As in `blend_backward`.
const SUMS: u32 = 10u;

@group(0) @binding(1) var<uniform> scene: TrainedScene;
@group(0) @binding(2) var<storage, read> splats: array<SplatRecord>;
@group(0) @binding(3) var<storage, read> depth_keys: array<u32>;
@group(0) @binding(4) var<storage, read> first_pairs: array<u32>;
@group(0) @binding(5) var<storage, read> pair_gradients: array<f32>;
@group(3) @binding(0) var<storage, read> trained: array<TrainedRecord>;
@group(3) @binding(1) var<storage, read> harmonics: array<vec4<f32>>;
@group(3) @binding(2) var<storage, read_write> trained_gradients: array<TrainedRecord>;
@group(3) @binding(3) var<storage, read_write> harmonic_gradients: array<vec4<f32>>;
// Gradients that are not finite so far: their number, one more than the index of the Gaussian and the number of the view of the first.
@group(3) @binding(4) var<storage, read_write> faults: array<atomic<u32>, 3>;

// Sums over the pairs of a splat, see `blend_backward`.
struct Sums {
    // q dx, q dy
    center: vec2<f32>,
    // q dx^2, q dx dy, q dy^2
    conic: vec3<f32>,
    // q
    opacity: f32,
    color: vec3<f32>,
    depth: f32,
}

fn sums_of(slot: u32) -> Sums {
    var sums: Sums;
    let first = first_pairs[slot];
    let count = tile_count(splats[slot].shape.w, splats[slot].color.w);
    for (var at = SUMS * first; at < SUMS * (first + count); at += SUMS) {
        sums.center += vec2(pair_gradients[at], pair_gradients[at + 1u]);
        sums.conic += vec3(pair_gradients[at + 2u], pair_gradients[at + 3u], pair_gradients[at + 4u]);
        sums.opacity += pair_gradients[at + 5u];
        sums.color += vec3(pair_gradients[at + 6u], pair_gradients[at + 7u], pair_gradients[at + 8u]);
        sums.depth += pair_gradients[at + 9u];
    }
    return sums;
}

// What the color passes on: gradients with respect to the direction and to the time since the frame.
struct ColorSlope {
    direction: vec3<f32>,
    time: f32,
}

// Adds the gradients of the coefficients of one Gaussian. `g` is the gradient of the color, `tau` the time from the frame to the mean.
fn color_backward(index: u32, g: vec3<f32>, d: vec3<f32>, tau: f32) -> ColorSlope {
    var slope = ColorSlope(vec3(0.0), 0.0);
    let coefficients = (instance.degree + 1u) * (instance.degree + 1u);
    for (var n = 0u; n <= instance.degree_t; n++) {
        var factor = 1.0;
        if n > 0u {
            factor = time_cosine(f32(n), tau, instance.time_span);
        }
        // Sum of basis times coefficient times gradient.
        var sum = 0.0;
        for (var group = 0u; group < 4u; group++) {
            if 4u * group >= coefficients {
                break;
            }
            var basis = basis_first(d);
            var by_direction = slope_first();
            if group == 1u {
                basis = basis_second(d);
                by_direction = slope_second(d);
            } else if group == 2u {
                basis = basis_third(d);
                by_direction = slope_third(d);
            } else if group == 3u {
                basis = basis_fourth(d);
                by_direction = slope_fourth(d);
            }
            let present = vec4<f32>(vec4(0u, 1u, 2u, 3u) + 4u * group < vec4(coefficients));
            basis *= present;
            let at = index * instance.stride + 12u * n + 3u * group;
            // One or four of the coefficients are present: those of degree 2 end with one.
            let u = harmonics[at];
            var v = vec4(0.0);
            var w = vec4(0.0);
            if present.w > 0.0 {
                v = harmonics[at + 1u];
                w = harmonics[at + 2u];
            }
            let along =
                present * vec4(dot(u.xyz, g), dot(vec3(u.w, v.xy), g), dot(vec3(v.zw, w.x), g), dot(w.yzw, g));
            sum += dot(basis, along);
            slope.direction += factor * (along * by_direction);
            var b = factor * basis;
#ifdef COMPAT
#ifndef WITHOUT_TIME
            // The original takes the constant basis for the second coefficient.
            if group == 0u && n == 0u && coefficients > 1u {
                b.y = 0.28209479;
            }
#endif
#endif
            harmonic_gradients[at] += vec4(b.x * g, b.y * g.x);
            if present.w > 0.0 {
                harmonic_gradients[at + 1u] += vec4(b.y * g.yz, b.z * g.xy);
                harmonic_gradients[at + 2u] += vec4(b.z * g.z, b.w * g);
            }
        }
        if n > 0u {
            let rate = TAU * f32(n) / instance.time_span;
            let sine = sin(time_angle(f32(n), tau, instance.time_span));
#ifdef COMPAT
            slope.time = rate * sine * sum;
#else
            slope.time -= rate * sine * sum;
#endif
        }
    }
    return slope;
}

// Returns the gradient of a raw quaternion from that of its unit quaternion.
fn raw_rotation(raw: vec4<f32>, unit: vec4<f32>, gradient: vec4<f32>) -> vec4<f32> {
    return (gradient - unit * dot(unit, gradient)) / length(raw);
}

// Returns the gradients with respect to l and r from those of the matrices L and R; see left_matrix. Matrices are m[column][row].
fn left_gradient(h: mat4x4<f32>) -> vec4<f32> {
    return vec4(
        h[0][0] + h[1][1] + h[2][2] + h[3][3],
        h[1][0] - h[0][1] + h[3][2] - h[2][3],
        -h[2][0] + h[3][1] + h[0][2] - h[1][3],
        h[3][0] + h[2][1] - h[1][2] - h[0][3],
    );
}

fn right_gradient(k: mat4x4<f32>) -> vec4<f32> {
    return vec4(
        k[0][0] + k[1][1] + k[2][2] + k[3][3],
        k[1][0] - k[0][1] - k[3][2] + k[2][3],
        -k[2][0] - k[3][1] + k[0][2] + k[1][3],
        -k[3][0] + k[2][1] - k[1][2] + k[0][3],
    );
}

// Returns the gradient with respect to a unit quaternion from that of its rotation matrix g[column][row].
fn rotation_gradient(q: vec4<f32>, g: mat3x3<f32>) -> vec4<f32> {
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    let g01 = g[1][0];
    let g02 = g[2][0];
    let g10 = g[0][1];
    let g12 = g[2][1];
    let g20 = g[0][2];
    let g21 = g[1][2];
    return 2.0 * vec4(
        -z * g01 + y * g02 + z * g10 - x * g12 - y * g20 + x * g21,
        y * g01 + z * g02 + y * g10 - 2.0 * x * g[1][1] - w * g12 + z * g20 + w * g21 - 2.0 * x * g[2][2],
        -2.0 * y * g[0][0] + x * g01 + w * g02 + x * g10 + z * g12 - w * g20 + z * g21 - 2.0 * y * g[2][2],
        -2.0 * z * g[0][0] - w * g01 + x * g02 + w * g10 - 2.0 * z * g[1][1] + y * g12 + x * g20 + y * g21,
    );
}

fn is_finite(v: vec4<f32>) -> bool {
    // Written so that NaN is not finite.
    return all(abs(v) <= vec4(3.4e38));
}

@compute @workgroup_size(64)
fn project_backward(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= instance.count {
        return;
    }
    let slot = instance.first_slot + id.x;
    if depth_keys[slot] == INVISIBLE {
        return;
    }
    let index = index_of(id.x);
    let splat = read_splat(splats[slot]);
    let sums = sums_of(slot);
    if !is_finite(vec4(sums.center, sums.opacity, sums.color.x)) || !is_finite(vec4(sums.conic, sums.color.y + sums.color.z + sums.depth)) {
        report(index);
        return;
    }
    let g = load_gaussian(index);
    let raw = trained[index];
    let dt = instance.time - g.mean_t;
    let mean = g.mean + g.velocity * dt;
    let at = vec4(mean, 1.0);

    // Section 7.1: center and conic.
    let conic = splat.conic;
    let by_center = -vec2(sums.center.x * conic.x + sums.center.y * conic.y, sums.center.y * conic.z + sums.center.x * conic.y);
    let by_ndc = by_center * 0.5 * vec2<f32>(instance.size);
    let by_conic = vec3(-0.5, -1.0, -0.5) * sums.conic;
    let by_opacity = sums.opacity / splat.opacity;
    let by_color = select(vec3(0.0), sums.color, splat.color > vec3(0.0));

    // Section 7.2: as in `project`.
    let q = vec3(dot(instance.camera_x, at), dot(instance.camera_y, at), dot(instance.camera_z, at));
    let limit = FRUSTUM_CLAMP * instance.reach;
    let free = q.xy / q.z;
    let ray = min(limit, max(-limit, free));
    let is_clamped = ray != free;
    let j = instance.focal / q.z;
    let mx = j.x * (instance.camera_x.xyz - ray.x * instance.camera_z.xyz);
    let my = j.y * (instance.camera_y.xyz - ray.y * instance.camera_z.xyz);
    let covariance = covariance_of(g);
    let cx = covariance * mx;
    let cy = covariance * my;
    let a = dot(mx, cx) + LOW_PASS;
    let b = dot(my, cx);
    let c = dot(my, cy) + LOW_PASS;
    let det = a * c - b * b;
#ifdef COMPAT
    let k = 1.0 / (det * det + 1e-7);
#else
    let k = 1.0 / (det * det);
#endif
    let by_a = k * (-c * c * by_conic.x + b * c * by_conic.y + (det - a * c) * by_conic.z);
    let by_c = k * (-a * a * by_conic.z + a * b * by_conic.y + (det - a * c) * by_conic.x);
    let by_b = k * (2.0 * b * c * by_conic.x - (det + 2.0 * b * b) * by_conic.y + 2.0 * a * b * by_conic.z);
    let by_covariance = outer(mx, by_a * mx + 0.5 * by_b * my) + outer(my, 0.5 * by_b * mx + by_c * my);
    let by_mx = 2.0 * by_a * cx + by_b * cy;
    let by_my = by_b * cx + 2.0 * by_c * cy;
    let by_ray = -j / q.z * vec2(dot(by_mx, instance.camera_z.xyz), dot(by_my, instance.camera_z.xyz));
    var by_z = -j.x / q.z * dot(by_mx, instance.camera_x.xyz) - j.y / q.z * dot(by_my, instance.camera_y.xyz)
        - 2.0 * dot(ray, by_ray);
#ifndef COMPAT
    // A clamped ray moves with the depth.
    by_z += dot(ray * by_ray, vec2<f32>(is_clamped));
#endif
    let by_q = vec3(select(by_ray, vec2(0.0), is_clamped), by_z + sums.depth);
    var by_mean = by_q.x * instance.camera_x.xyz + by_q.y * instance.camera_y.xyz + by_q.z * instance.camera_z.xyz;
    let iw = 1.0 / (q.z + 1e-7);
    by_mean += by_ndc.x * iw * (instance.clip_x.xyz - instance.camera_z.xyz * (dot(instance.clip_x, at) * iw));
    by_mean += by_ndc.y * iw * (instance.clip_y.xyz - instance.camera_z.xyz * (dot(instance.clip_y, at) * iw));

    // Section 7.3: color.
    var seen = g.mean;
#ifdef COMPAT
    let displaced = true;
#else
    let displaced = instance.displaced != 0u;
#endif
    if displaced {
        seen = mean;
    }
    let far = distance(seen, instance.camera_position);
    let direction = (seen - instance.camera_position) / far;
    let slope = color_backward(index, by_color, direction, -dt);
    let by_point = (slope.direction - direction * dot(direction, slope.direction)) / far;
    var by_mean_t = slope.time;
    var by_seen = by_point;
    if displaced {
        by_mean += by_point;
        by_seen = vec3(0.0);
    }

    // Section 7.4: covariance and activations.
    let sliced = slice_of(raw, scene.model);
    let opacity = opacity_of(raw.opacity_logit.x);
    let variance = sliced.v + max(scene.prefilter_var, 0.0);
    var marginal = exp(-0.5 * dt * dt / variance);
    if scene.model == STATIC_3D {
        marginal = 1.0;
    }
    // The gradient with respect to the marginal, times the marginal.
    let by_marginal = by_opacity * opacity * marginal;
    var by_v = by_marginal * dt * dt / (2.0 * variance * variance);
    var by_log_scale = vec4(0.0);
    var by_l = vec4(0.0);
    var by_r = vec4(0.0);
    let scale = exp(raw.log_scale);
    let l = normalize(raw.rotation_l);
    var by_peak = by_opacity * marginal;
    if scene.model == ROTATED_4D {
        let v = sliced.v;
        let by_velocity = dot(by_mean, sliced.c);
        let gc = by_covariance * sliced.c;
        by_v += dot(sliced.c, gc) / (v * v) - dt / (v * v) * by_velocity;
        by_mean_t += by_marginal * dt / variance - by_velocity / v;
        let half_c = -gc / v + 0.5 * dt / v * by_mean;
        let g4 = mat4x4(
            vec4(by_covariance[0], half_c.x),
            vec4(by_covariance[1], half_c.y),
            vec4(by_covariance[2], half_c.z),
            vec4(half_c, by_v),
        );
        let r = normalize(raw.rotation_r);
        let left = left_matrix(l);
        let right = right_matrix(r);
        let turn = left * right;
        let x = 2.0 * (g4 * turn);
        let squares = scale * scale;
        by_log_scale = squares * vec4(dot(x[0], turn[0]), dot(x[1], turn[1]), dot(x[2], turn[2]), dot(x[3], turn[3]));
        let by_turn = mat4x4(x[0] * squares.x, x[1] * squares.y, x[2] * squares.z, x[3] * squares.w);
        by_l = raw_rotation(raw.rotation_l, l, left_gradient(by_turn * transpose(right)));
        by_r = raw_rotation(raw.rotation_r, r, right_gradient(transpose(left) * by_turn));
    } else {
        let turn = rotation_3d(l);
        let x = 2.0 * (by_covariance * turn);
        let squares = scale.xyz * scale.xyz;
        by_log_scale = vec4(squares * vec3(dot(x[0], turn[0]), dot(x[1], turn[1]), dot(x[2], turn[2])), 0.0);
        let by_turn = mat3x3(x[0] * squares.x, x[1] * squares.y, x[2] * squares.z);
        by_l = raw_rotation(raw.rotation_l, l, rotation_gradient(l, by_turn));
        if scene.model != STATIC_3D {
#ifdef COMPAT
            by_peak = by_opacity;
#else
            by_log_scale.w = by_v * sliced.v;
            by_mean_t += by_marginal * dt / variance;
#endif
        }
    }
    if scene.model == STATIC_3D {
        by_mean_t = 0.0;
    }
    let gradient = TrainedRecord(
        vec4(by_mean + by_seen, by_mean_t),
        by_log_scale,
        by_l,
        by_r,
        vec4(by_peak * opacity * (1.0 - opacity), 0.0, 0.0, 0.0),
    );
    if is_finite(gradient.mean) && is_finite(by_log_scale) && is_finite(by_l) && is_finite(by_r) && is_finite(gradient.opacity_logit) {
        let before = trained_gradients[index];
        trained_gradients[index] = TrainedRecord(
            before.mean + gradient.mean,
            before.log_scale + gradient.log_scale,
            before.rotation_l + gradient.rotation_l,
            before.rotation_r + gradient.rotation_r,
            before.opacity_logit + gradient.opacity_logit,
        );
    } else {
        report(index);
    }
}

// Notes a gradient that is not finite; it is left out.
fn report(index: u32) {
    if atomicAdd(&faults[0], 1u) == 0u {
        atomicStore(&faults[1], index + 1u);
        atomicStore(&faults[2], scene.view);
    }
}
