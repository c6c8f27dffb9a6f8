//! Levels of detail, measured on the GPU.
//!
//! In: a synthetic scene. Out: proof that a level has the promised PSNR in views in which it was neither trained nor
//! measured, and that levels below the wanted PSNR are dropped. Skipped where there is no GPU.

use crate::support::gpu;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::scene::pixels_across;
use bevy_gs4d::offline::detail::{DetailError, DetailSettings, detail};
use bevy_gs4d::offline::work::NoProgress;
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::{Bounds, Environment, Form, GaussianScene, RuntimeScene, SceneForm};
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov, View};
use glam::{UVec2, Vec3};

/// Settings that take seconds on a software driver.
const QUICK: DetailSettings = DetailSettings { levels: 1, min_psnr: 45.0, steps: 0, directions: 4, times: 2 };

/// Returns a scene of clumps of faint Gaussians. The clumps are far smaller than their distances, so that each can be
/// merged into one Gaussian.
fn clumps() -> GaussianScene {
    let (mut gaussians, mut values) = (Vec::new(), Vec::new());
    for clump in 0..20u32 {
        let part = |step: f32| (clump as f32 * step).fract() - 0.5;
        let middle = Vec3::new(part(0.618), part(0.414), part(0.732)) * 4.0;
        for one in 0..7u32 {
            let offset = Vec3::new((one as f32).sin(), (one as f32 * 1.3).cos(), (one as f32 * 2.1).sin()) * 1e-3;
            gaussians.push(Gaussian {
                mean: (middle + offset).to_array(),
                mean_t: 0.5,
                velocity: [0.05, 0.0, 0.0],
                sigma_t: 0.8,
                covariance: [0.02, 0.0, 0.0, 0.03, 0.0, 0.01],
                opacity: 0.02,
                padding: 0.0,
            });
            values.extend([part(0.3), part(0.5), part(0.7)]);
        }
    }
    RuntimeScene::sliced(gaussians, Harmonics { coefficients: 1, degree: 0, degree_t: 0, values }).into()
}

/// Returns a view in which the bounding sphere of a scene has a diameter of `pixels` pixels.
fn view(scene: &RuntimeScene, direction: Vec3, time: f32, pixels: f32) -> View {
    let bounds = Bounds::of(scene.iter(), scene.trained_with.time_interval, scene.trained_with.marginal_cutoff, None)
        .expect("something is drawn");
    let distance = 30.0 * bounds.radius();
    let focal = pixels / pixels_across(bounds.radius(), distance, 1.0);
    let side = pixels.ceil();
    let fov = 2.0 * (side / (2.0 * focal)).atan();
    let eye = bounds.center() + direction.normalize() * distance;
    Camera::look_at(eye, bounds.center(), Vec3::Z, fov, UVec2::splat(side as u32)).view(time, RasterFov::Corrected)
}

/// Returns the PSNR between two frames as parts of a screen of 1280x720 pixels: the lower value of black and white
/// background.
fn screen_psnr(a: &Frame, b: &Frame) -> f64 {
    let over = |frame: &Frame, at: usize, behind: f32| {
        (frame.picture.pixels[at] + frame.transmittance[at] * behind).clamp(Vec3::ZERO, Vec3::ONE)
    };
    let of = |behind: f32| {
        let squares: f32 =
            (0..a.picture.pixels.len()).map(|at| (over(a, at, behind) - over(b, at, behind)).length_squared()).sum();
        -10.0 * (f64::from(squares) / (3.0 * 1280.0 * 720.0)).log10()
    };
    of(0.0).min(of(1.0))
}

fn draw(headless: &mut Headless, scene: &RuntimeScene, view: &View) -> Frame {
    let capture = headless.upload(scene).expect("the scene fits the GPU");
    headless.render(&capture, view, Background::Color([0.0; 3])).expect("the view is drawn")
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn a_level_has_the_promised_psnr_in_other_views() {
    let Some(mut headless) = gpu::headless() else { return };
    let made = detail(&mut headless, clumps(), &QUICK, &mut NoProgress).expect("levels can be made");
    let [level] = &made.scene.levels[..] else { panic!("expected one level: {:?}", made.made) };
    assert_eq!(level.scene.len(), 20, "the level has a seventh of the Gaussians");
    assert_eq!(made.made[0].pixels, Some(level.pixels), "the report has the size of the level");
    let full = made.scene.clone().into_runtime().expect("drawable");
    for (direction, time) in [(Vec3::new(1.0, 0.4, 0.3), 0.2), (Vec3::new(-0.3, 1.0, -0.5), 0.9)] {
        let view = view(&full, direction, time, level.pixels);
        let smooth = view.antialiased(level.scene.trained_with.pixel);
        let found = screen_psnr(&draw(&mut headless, &full, &view), &draw(&mut headless, &level.scene, &smooth));
        // A tolerance of 1 dB for views that were not measured.
        assert!(found > 44.0, "{found} dB at {} pixels from {direction}", level.pixels);
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn training_increases_the_psnr_of_a_level() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = clumps();
    let SceneForm::Ready(Form::Sliced(sliced)) = &mut scene.form else { panic!("the clumps are sliced") };
    sliced.gaussians.iter_mut().for_each(|gaussian| gaussian.opacity = 0.6);
    let lowest = |headless: &mut Headless, steps: usize| {
        let settings = DetailSettings { min_psnr: 0.0, steps, ..QUICK };
        let made = detail(headless, scene.clone(), &settings, &mut NoProgress).expect("levels can be made");
        // The size in pixels for a level of 20 Gaussians.
        let measured = made.made[0].measured.iter().find(|close| close.pixels == 10.0);
        measured.expect("the level is measured at 10 pixels").truth
    };
    let (merged, trained) = (lowest(&mut headless, 0), lowest(&mut headless, 150));
    assert!(trained > merged, "{trained} dB after training, {merged} dB before");
}

#[test]
fn levels_below_the_minimum_psnr_are_dropped() {
    let Some(mut headless) = gpu::headless() else { return };
    let strict = DetailSettings { min_psnr: 300.0, directions: 1, times: 1, ..QUICK };
    let made = detail(&mut headless, clumps(), &strict, &mut NoProgress).expect("levels can be measured");
    assert!(made.scene.levels.is_empty() && made.made[0].pixels.is_none(), "no level has a PSNR of 300 dB");
    assert_eq!(made.scene, clumps(), "the scene is unchanged");
}

#[test]
fn scenes_with_environment_map_or_without_gaussians_have_no_levels() {
    let Some(mut headless) = gpu::headless() else { return };
    let environment = Some(Environment { width: 1, height: 1, texels: vec![0.5; 3] });
    let around = GaussianScene { environment, ..clumps() };
    let refused = detail(&mut headless, around, &QUICK, &mut NoProgress);
    assert!(matches!(refused, Err(DetailError::Surrounded)), "a scene with an environment map is refused");
    let nothing = RuntimeScene::sliced(Vec::new(), Harmonics::default());
    let refused = detail(&mut headless, nothing.into(), &QUICK, &mut NoProgress);
    assert!(matches!(refused, Err(DetailError::NothingDrawn)), "a scene without Gaussians is refused");
}
