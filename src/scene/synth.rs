//! A procedural moving scene of any size, for tests and benchmarks.
//!
//! In: a count and a seed. Out: a [`GaussianScene`] in the trained form, the same on every machine: a checkered ground
//! at rest and colored balls circling over it, with lifespans from a flash to the whole interval.

use super::random::Random;
use super::{GaussianScene, PlaybackHints, SceneForm, Trained, TrainedWith};
use crate::gaussian::{Harmonics, Parameters};
use crate::view::RasterFov;
use glam::{EulerRot, Quat, Vec3};
use std::f32::consts::TAU;

/// Settings of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynthSettings {
    /// Number of Gaussians. Default: 10,000.
    pub count: usize,
    /// Seed of the random numbers. Default: 1.
    pub seed: u64,
    /// Spatial degree of color, 0 to 3. Default: 3.
    pub degree: u32,
    /// Time degree of color, 0 to 2; used only if `degree` is 3. Default: 2.
    pub degree_t: u32,
    /// Seconds of playback. Default: 2.
    pub duration_seconds: f32,
}

impl Default for SynthSettings {
    fn default() -> Self {
        Self { count: 10_000, seed: 1, degree: 3, degree_t: 2, duration_seconds: 2.0 }
    }
}

/// Number of balls over the ground.
const BALLS: usize = 7;
/// Percentage of the Gaussians that form the ground.
const GROUND_PERCENT: usize = 40;
/// Value of the first spherical harmonic: a stored coefficient is `color − 0.5` divided by it.
const SH_C0: f32 = 0.282_094_79;

/// Returns the scene. The time interval is [0, 1], up is +z, and everything fits in a box of about two units.
pub fn synthesize(settings: &SynthSettings) -> GaussianScene {
    let mut random = Random::new(settings.seed);
    let mut harmonics = Harmonics { degree: settings.degree.min(3), ..Harmonics::default() };
    harmonics.degree_t = if harmonics.degree == 3 { settings.degree_t.min(2) } else { 0 };
    harmonics.coefficients = harmonics.evaluated();
    let mut parameters = Parameters::default();
    // The surface of each Gaussian shrinks with their number, so that any number covers the scene equally.
    let spacing = (8.0 / settings.count.max(1) as f32).sqrt();
    for index in 0..settings.count {
        let ground = index % 100 < GROUND_PERCENT;
        let (mean, color, motion) =
            if ground { ground_point(&mut random) } else { ball_point(index % BALLS, &mut random) };
        let mean_t = random.in_range(-0.1, 1.1);
        let scale_t = if ground { 2.0 } else { 0.02 * (30.0f32).powf(random.unit()) };
        parameters.mean.push(if ground { mean } else { motion(mean_t) }.to_array());
        parameters.mean_t.push(mean_t);
        let flat = Vec3::new(1.0, random.in_range(0.4, 1.0), random.in_range(0.1, 0.4)) * spacing;
        parameters.log_scale.push(flat.map(f32::ln).to_array());
        parameters.log_scale_t.push(scale_t.ln());
        let (left, right) = rotations(ground, &mut random);
        parameters.rotation_l.push(left);
        parameters.rotation_r.push(right);
        parameters.opacity_logit.push(random.in_range(-1.0, 4.0));
        harmonics.values.extend(((color - 0.5) / SH_C0).to_array());
        let rest = (harmonics.coefficients - 1) * 3;
        harmonics.values.extend((0..rest).map(|_| random.in_range(-0.05, 0.05)));
    }
    GaussianScene {
        form: SceneForm::Trained(Trained { parameters, harmonics }),
        environment: None,
        filter: None,
        trained_with: TrainedWith { raster_fov: RasterFov::Corrected, ..TrainedWith::default() },
        playback: PlaybackHints { duration_seconds: settings.duration_seconds, ..PlaybackHints::default() },
        levels: Vec::new(),
        sockets: Vec::new(),
        colliders: None,
        sound: None,
        chunks: None,
    }
}

type Motion = Box<dyn Fn(f32) -> Vec3>;

fn ground_point(random: &mut Random) -> (Vec3, Vec3, Motion) {
    let point = Vec3::new(random.in_range(-1.0, 1.0), random.in_range(-1.0, 1.0), random.in_range(-0.01, 0.0));
    let square = ((point.x * 4.0).floor() + (point.y * 4.0).floor()).rem_euclid(2.0);
    (point, Vec3::splat(0.25 + 0.5 * square), Box::new(move |_| point))
}

fn ball_point(ball: usize, random: &mut Random) -> (Vec3, Vec3, Motion) {
    let direction = Vec3::new(random.in_range(-1.0, 1.0), random.in_range(-1.0, 1.0), random.in_range(-1.0, 1.0));
    let surface = direction.normalize_or(Vec3::Z) * 0.15;
    let phase = ball as f32 / BALLS as f32;
    let color = Vec3::new((phase * TAU).cos(), (phase * TAU + 2.1).cos(), (phase * TAU + 4.2).cos()) * 0.4 + 0.5;
    let motion = move |time: f32| {
        let angle = TAU * (phase + time);
        Vec3::new(0.7 * angle.cos(), 0.7 * angle.sin(), 0.25 + 0.1 * (2.0 * angle).sin()) + surface
    };
    (motion(0.0), color, Box::new(motion))
}

/// Returns a pair of quaternions: equal quaternions give a Gaussian at rest, different ones a Gaussian that moves.
/// Their components are reversed so that the 3D part is the rotation `turn`.
fn rotations(ground: bool, random: &mut Random) -> ([f32; 4], [f32; 4]) {
    let [a, b, c] = if ground {
        [random.in_range(0.0, TAU), 0.0, 0.0]
    } else {
        [random.in_range(0.0, TAU), random.in_range(0.0, TAU), random.in_range(0.0, TAU)]
    };
    let turn = Quat::from_euler(EulerRot::ZYX, a, b, c);
    let twist = if ground { 0.0 } else { random.in_range(-0.02, 0.02) };
    let other = turn * Quat::from_rotation_x(twist) * Quat::from_rotation_z(twist);
    let backwards = |q: Quat| [q.w, -q.z, -q.y, -q.x];
    (backwards(turn), backwards(other))
}
