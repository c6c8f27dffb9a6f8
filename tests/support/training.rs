//! Trainers with optional parts, their steps, and views around the scenes that they train.
//!
//! In: a scene, what is trained with it, the number of a step or of a view. Out: a trainer, a step, a view on a circle.

use bevy_gs4d::gaussian::GradientMode;
use bevy_gs4d::internal::offline::train::{Request, RoundingSettings, Step, Trainer};
use bevy_gs4d::offline::train::{FineTuneSettings, Growth, Rates, Terms, TrainerError};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::{Bits, GaussianScene};
use bevy_gs4d::view::{Camera, RasterFov, View};
use glam::{UVec2, Vec3};

/// The seed of the random numbers of [`growing`] trainers.
pub const SEED: u64 = 5;

/// Returns training from pictures alone in which nothing is hidden, moves or is relocated.
pub fn still_growth() -> Growth {
    let (relocate_from, relocate_until) = (0, usize::MAX);
    Growth { relocate_every: None, relocate_from, relocate_until, noise: 0.0, dropout: 0.0, ..Growth::over(1000) }
}

/// Returns a trainer with the parts of this training from pictures alone.
pub fn growing(headless: &mut Headless, scene: GaussianScene, growth: Growth) -> Trainer<'_> {
    let mut trainer = Trainer::new(headless, scene, GradientMode::Exact).expect("the scene can be trained");
    let settings = FineTuneSettings { growth: Some(growth), seed: SEED, ..FineTuneSettings::default() };
    trainer.prepare(&Request::of(&settings)).expect("the Gaussians are native");
    trainer
}

/// Adds terms to the loss of a trainer that has none.
///
/// # Errors
/// Weights that no term can have, more Gaussians than a term can have.
pub fn add_terms(trainer: &mut Trainer<'_>, terms: Terms) -> Result<(), TrainerError> {
    trainer.prepare(&Request::of(&FineTuneSettings { terms, ..FineTuneSettings::default() }))
}

/// Draws the geometry of a trainer rounded to these bits from now on, and rounds it again before each step whose number
/// is a multiple of `every`.
///
/// # Errors
/// Gaussians that the packed form cannot hold.
pub fn round(trainer: &mut Trainer<'_>, bits: Bits, every: usize) -> Result<(), TrainerError> {
    let rounding = Some(RoundingSettings { bits, first: 0, every });
    trainer.prepare(&Request { rounding, ..Request::of(&FineTuneSettings::default()) })
}

/// Returns the step of this number, from 0, of training from pictures alone, in which so many values of each color are
/// trained.
pub fn growing_step(index: usize, rates: Rates, color_values: u32) -> Step {
    Step { index, color_values: Some(color_values), grows: true, ..Step::new(rates, 1.0, index + 1) }
}

/// Returns a view of the origin from another angle and at another time for each index; index 6 is at time 1.
pub fn view(index: usize, size: UVec2) -> View {
    let angle = index as f32 * 0.7;
    let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, size).view(index as f32 / 6.0, RasterFov::Reference)
}
