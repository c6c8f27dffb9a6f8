// project_backward: converts gradients of splats to gradients of raw parameters, through projection, slice, color and
// activations.
// In: the inputs and outputs of `project` for one part, the sums of `blend_backward`. Out: the gradients of this view,
// added to the gradients of the batch. CPU reference: src/gaussian/gradient.rs; equations: sections 7.2 to 7.4 of the
// 4DGS model. COMPAT: as the original computes them, with the deviations of section 7.5. MIP_FILTER: the opacity of
// each splat is reduced by the filter of Mip-Splatting, in views whose training pixel is 0.
#import gs4d::training::{TrainedRecord, TrainedScene}
#import gs4d::types::{SplatRecord, INVISIBLE}
#import gs4d::conic::{conic_entries, determinant_of, screen_covariance}
#ifdef MIP_FILTER
#import gs4d::conic::{determinant_with_less, LOW_PASS}
#endif
#import gs4d::records::{covariance_of, read_splat}
#import gs4d::tile::tile_count
#import gs4d::capture::{index_of, instance, load_gaussian}
#import gs4d::harmonics::{basis_first, basis_second, basis_third, basis_fourth, time_angle, time_cosine}
#import gs4d::harmonics::{slope_first, slope_second, slope_third, slope_fourth}
#import gs4d::trained::{opacity_of, outer, slice_of, STATIC_3D, UNROTATED_4D}
#import gs4d::slice_backward::{is_finite, is_finite_slice, through_slice}

// The same values as in `project`.
const FRUSTUM_CLAMP: f32 = 1.3;
const TAU: f32 = 6.2831853;
// The same value as in `blend_backward`.
const SUMS: u32 = 10u;
// Index of the first of all Gaussians in `notes`.
const FIRST_SEEN: u32 = 3u;

@group(0) @binding(1) var<uniform> scene: TrainedScene;
@group(0) @binding(2) var<storage, read> splats: array<SplatRecord>;
@group(0) @binding(3) var<storage, read> depth_keys: array<u32>;
@group(0) @binding(4) var<storage, read> first_pairs: array<u32>;
@group(0) @binding(5) var<storage, read> pair_gradients: array<f32>;
@group(3) @binding(0) var<storage, read> trained: array<TrainedRecord>;
@group(3) @binding(1) var<storage, read> harmonics: array<vec4<f32>>;
@group(3) @binding(2) var<storage, read_write> trained_gradients: array<TrainedRecord>;
@group(3) @binding(3) var<storage, read_write> harmonic_gradients: array<vec4<f32>>;
// Number of gradients that are not finite so far; for the first of them the index of the Gaussian plus one and the
// number of the view. Then one word for each Gaussian: the number of views of the batch that show it; then a number for
// each: the sum of the lengths of the gradients of its center in these views, in normalized device coordinates.
@group(3) @binding(4) var<storage, read_write> notes: array<atomic<u32>>;

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

// Gradients through the color with respect to the direction and the temporal mean, and whether those with respect to
// the coefficients are finite.
struct ColorSlope {
    direction: vec3<f32>,
    time: f32,
    finite_coefficients: bool,
}

// Computes the gradients of the coefficients of one Gaussian, and adds them if `is_added`. `g` is the gradient of the
// color, `tau` the time from the frame to the mean.
fn color_backward(index: u32, g: vec3<f32>, d: vec3<f32>, tau: f32, is_added: bool) -> ColorSlope {
    var slope = ColorSlope(vec3(0.0), 0.0, true);
    let largest = max(max(abs(g.x), abs(g.y)), abs(g.z));
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
            // One or four coefficients of a group are present: degree 2 has nine coefficients.
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
            // The original uses the constant basis function for the second coefficient.
            if group == 0u && n == 0u && coefficients > 1u {
                b.y = 0.28209479;
            }
#endif
#endif
            slope.finite_coefficients = slope.finite_coefficients && is_finite(b * largest);
            if is_added {
                harmonic_gradients[at] += vec4(b.x * g, b.y * g.x);
                if present.w > 0.0 {
                    harmonic_gradients[at + 1u] += vec4(b.y * g.yz, b.z * g.xy);
                    harmonic_gradients[at + 2u] += vec4(b.z * g.z, b.w * g);
                }
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

@compute @workgroup_size(64)
fn project_backward(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = id.y * groups.x * 64u + id.x;
    if thread >= instance.count {
        return;
    }
    let slot = instance.first_slot + thread;
    if depth_keys[slot] == INVISIBLE {
        return;
    }
    let index = index_of(thread);
    atomicAdd(&notes[FIRST_SEEN + scene.first + index], 1u);
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
    let conic = conic_entries(splat.conic);
    let by_center = -vec2(sums.center.x * conic.x + sums.center.y * conic.y, sums.center.y * conic.z + sums.center.x * conic.y);
    let by_ndc = by_center * 0.5 * vec2<f32>(instance.size);
    let at_length = FIRST_SEEN + scene.total + scene.first + index;
    atomicStore(&notes[at_length], bitcast<u32>(bitcast<f32>(atomicLoad(&notes[at_length])) + length(by_ndc)));
    let by_conic = vec3(-0.5, -1.0, -0.5) * sums.conic;
    var by_opacity = sums.opacity / splat.opacity;
    let by_color = select(vec3(0.0), sums.color, splat.color > vec3(0.0));

    // Section 7.2: the projection, as in `project`.
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
    let screen = screen_covariance(covariance, mx, my);
    let a = screen.x;
    let b = screen.y;
    let c = screen.z;
    let det = determinant_of(screen, covariance, mx, my);
#ifdef COMPAT
    let k = 1.0 / (det * det + 1e-7);
#else
    let k = 1.0 / (det * det);
#endif
    var by_a = k * (-c * c * by_conic.x + b * c * by_conic.y + (det - a * c) * by_conic.z);
    var by_c = k * (-a * a * by_conic.z + a * b * by_conic.y + (det - a * c) * by_conic.x);
    var by_b = k * (2.0 * b * c * by_conic.x - (det + 2.0 * b * b) * by_conic.y + 2.0 * a * b * by_conic.z);
#ifdef MIP_FILTER
    // The factor on opacity is the square root of `rest / det`; a splat that is drawn has a factor above 0.
    let rest = determinant_with_less(screen, det, vec2(LOW_PASS));
    by_opacity *= sqrt(rest / det);
    by_a += 0.5 * sums.opacity * ((c - LOW_PASS) / rest - c / det);
    by_c += 0.5 * sums.opacity * ((a - LOW_PASS) / rest - a / det);
    by_b += sums.opacity * b * (1.0 / det - 1.0 / rest);
#endif
    let by_covariance = outer(mx, by_a * mx + 0.5 * by_b * my) + outer(my, 0.5 * by_b * mx + by_c * my);
    let by_mx = 2.0 * by_a * cx + by_b * cy;
    let by_my = by_b * cx + 2.0 * by_c * cy;
    let by_ray = -j / q.z * vec2(dot(by_mx, instance.camera_z.xyz), dot(by_my, instance.camera_z.xyz));
    var by_z = -j.x / q.z * dot(by_mx, instance.camera_x.xyz) - j.y / q.z * dot(by_my, instance.camera_y.xyz)
        - 2.0 * dot(ray, by_ray);
#ifndef COMPAT
    // The point of a clamped ray moves with the depth.
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
    let slope = color_backward(index, by_color, direction, -dt, false);
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
    var by_peak = by_opacity * marginal;
    // The gradient with respect to the marginal, times the marginal.
    var by_marginal = by_opacity * opacity * marginal;
#ifdef COMPAT
    if scene.model == UNROTATED_4D {
        by_peak = by_opacity;
        by_marginal = 0.0;
    }
#endif
    by_mean_t += by_marginal * dt / variance - dot(by_mean, sliced.c) / sliced.v;
    if scene.model == STATIC_3D {
        by_mean_t = 0.0;
    }
    let by_variance = by_marginal * dt * dt / (2.0 * variance * variance);
    // The mean moves by the velocity times dt.
    let shape = through_slice(raw, scene.model, sliced, by_covariance, dt * by_mean, by_variance);
    let by_raw_mean = vec4(by_mean + by_seen, by_mean_t);
    let by_logit = vec4(by_peak * opacity * (1.0 - opacity), 0.0, 0.0, 0.0);
    let finite_geometry = is_finite(by_raw_mean) && is_finite_slice(shape) && is_finite(by_logit);
    if finite_geometry && slope.finite_coefficients {
        color_backward(index, by_color, direction, -dt, true);
        let before = trained_gradients[index];
        trained_gradients[index] = TrainedRecord(
            before.mean + by_raw_mean,
            before.log_scale + shape.log_scale,
            before.rotation_l + shape.rotation_l,
            before.rotation_r + shape.rotation_r,
            before.opacity_logit + by_logit,
        );
    } else {
        report(index);
    }
}

// Counts a gradient that is not finite, which is left out.
fn report(index: u32) {
    if atomicAdd(&notes[0], 1u) == 0u {
        atomicStore(&notes[1], scene.first + index + 1u);
        atomicStore(&notes[2], scene.view);
    }
}
