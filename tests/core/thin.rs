//! Thin splats: the CPU reference against the same formulas in double precision.
//!
//! In: slivers and needles. Out: proof that the projection, the determinant and the falloff lose no more to rounding
//! than a picture shows.

use crate::support::thin::{huge_scene, thin_scene, views};
use bevy_gs4d::internal::gaussian::LOW_PASS;
use bevy_gs4d::internal::gaussian::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};
use bevy_gs4d::reference::render;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, TILE_SIZE, View};
use glam::{DMat3, DVec2, DVec3, UVec2};

/// A splat in double precision.
struct Splat {
    center: DVec2,
    depth: f64,
    /// Inverse covariance: xx, xy, yy.
    conic: [f64; 3],
    opacity: f64,
    color: DVec3,
    /// First and last + 1 pixel of the tiles that the original assigns.
    low: DVec2,
    high: DVec2,
}

fn project(scene: &RuntimeScene, view: &View) -> Vec<Splat> {
    let camera = view.world_to_camera.as_dmat4();
    let to_camera = DMat3::from_mat4(camera);
    let size = view.size.as_dvec2();
    let focal = view.focal().as_dvec2();
    let limit = 1.3 * view.reach().as_dvec2();
    let [clip_x, clip_y] = view.clip_rows().map(|row| row.as_dvec4());
    let one = |index: usize| {
        let gaussian = scene.gaussian(index);
        let mean = gaussian.mean_at(view.time).as_dvec3();
        let q = camera.transform_point3(mean);
        if q.z <= f64::from(view.near) {
            return None;
        }
        let ndc = DVec2::new(clip_x.dot(mean.extend(1.0)), clip_y.dot(mean.extend(1.0))) / (q.z + 1e-7);
        let center = ((ndc + 1.0) * size - 1.0) * 0.5;
        let ray = limit.min((-limit).max(q.truncate() / q.z));
        let x = to_camera.transpose() * DVec3::new(focal.x / q.z, 0.0, -focal.x * ray.x / q.z);
        let y = to_camera.transpose() * DVec3::new(0.0, focal.y / q.z, -focal.y * ray.y / q.z);
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
        let covariance = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let low_pass = f64::from(LOW_PASS);
        let [a, b, c] = [
            x.dot(covariance * x).max(0.0) + low_pass,
            x.dot(covariance * y),
            y.dot(covariance * y).max(0.0) + low_pass,
        ];
        // Rounding of the record can make its covariance indefinite.
        let flat = ((a - low_pass) * (c - low_pass) - b * b).max(0.0);
        let det = flat + low_pass * (a + c - low_pass);
        let mid = 0.5 * (a + c);
        let radius = (3.0 * (mid + (mid * mid - det).max(0.1).sqrt()).sqrt()).ceil();
        let side = f64::from(TILE_SIZE);
        let low = ((center - radius) / side).trunc().max(DVec2::ZERO) * side;
        let high = ((center + radius + (side - 1.0)) / side).trunc().max(DVec2::ZERO) * side;
        let color = scene.color(index, view.direction_to(gaussian.mean.into()), gaussian.mean_t - view.time);
        let opacity = f64::from(gaussian.opacity);
        let color = color.as_dvec3().max(DVec3::ZERO);
        // Σ⁻¹ of a covariance with this determinant: xx is exact by yy, det and xy.
        let conic = [c / det, -b / det, (1.0 + b * b / det) / c];
        Some(Splat { center, depth: q.z, conic, opacity, color, low, high })
    };
    let mut splats: Vec<Splat> = (0..scene.len()).filter_map(one).collect();
    splats.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    splats
}

fn pixel(splats: &[Splat], at: UVec2) -> DVec3 {
    let at = at.as_dvec2();
    let (mut color, mut left) = (DVec3::ZERO, 1.0);
    for splat in splats {
        if at.cmplt(splat.low).any() || at.cmpge(splat.high).any() {
            continue;
        }
        let (d, [xx, xy, yy]) = (splat.center - at, splat.conic);
        let exponent = -0.5 * (xx * d.x * d.x + yy * d.y * d.y) - xy * d.x * d.y;
        let alpha = (splat.opacity * exponent.exp()).min(f64::from(ALPHA_MAX));
        if alpha < f64::from(ALPHA_MIN) {
            continue;
        }
        let after = left * (1.0 - alpha);
        if after < f64::from(TRANSMITTANCE_MIN) {
            break;
        }
        color += splat.color * (alpha * left);
        left = after;
    }
    color
}

#[test]
fn pictures_of_thin_splats_match_double_precision() {
    for seed in 0..3 {
        let scene = thin_scene(seed, 250);
        for view in views() {
            let found = render(&scene, &view, Background::Color([0.0; 3])).picture;
            let splats = project(&scene, &view);
            let pixels = (0..view.size.y).flat_map(|y| (0..view.size.x).map(move |x| UVec2::new(x, y)));
            let errors =
                pixels.zip(&found.pixels).map(|(at, found)| (pixel(&splats, at) - found.as_dvec3()).length_squared());
            let mean = errors.sum::<f64>() / (3.0 * f64::from(view.size.element_product()));
            let psnr = -10.0 * mean.max(1e-20).log10();
            println!("seed {seed}, {}: {psnr:.1} dB", view.size);
            assert!(psnr > 85.0, "seed {seed}, {}: {psnr:.1} dB to double precision", view.size);
        }
    }
}

#[test]
fn gaussians_beyond_the_largest_variance_are_not_drawn() {
    let scene = huge_scene();
    for view in views() {
        let visible = render(&scene, &view, Background::Color([0.0; 3])).counts.visible;
        // Standard deviations of 10⁶ and 10⁷ units, and the ordinary Gaussian.
        assert!((1..=4).contains(&visible), "{}: {visible} of {} Gaussians are drawn", view.size, scene.len());
    }
}
