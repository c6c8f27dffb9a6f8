//! Levels of detail: the same capture with fewer Gaussians, for pictures of few pixels.
//!
//! In: a scene, [`DetailSettings`]. Out: the scene with levels ([`Detailed`]), each with the size on the screen up to
//! which it is drawn. `maker` makes one level after the other:
//!
//! 1. `merge` replaces many Gaussians by few with the same moments in space and time; `rotation` converts covariances
//!    to raw parameters.
//! 2. `fit` trains the merged Gaussians at the sizes at which the level is drawn, on the mean of two pictures of all
//!    Gaussians: the truth, which is a picture of many times as many pixels, averaged, and the picture drawn at that
//!    size, which the level replaces. The two differ much: as in the original, each splat is blurred to at least half a
//!    pixel, so that many small splats look larger and denser than they are; with [anti-aliasing], which makes splats
//!    fainter, less dense.
//! 3. `looks` compares the level with all Gaussians in other views, at each size. A level is drawn up to the largest
//!    size at which it is about as close to the truth as all Gaussians are, and at which the change of a screen is
//!    hardly visible. A level without such a size is not kept.
//!
//! [anti-aliasing]: crate::view::View::antialiased

mod error;
mod fit;
mod looks;
mod maker;
mod merge;
mod settings;

pub use error::DetailError;
pub use looks::Closeness;
pub use maker::MadeLevel;
pub use settings::DetailSettings;

use crate::offline::forms::convert::require_no_windows;
use crate::offline::work::Progress;
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use looks::Sphere;
use maker::Maker;

/// A scene with levels of detail.
#[derive(Debug, Clone, PartialEq)]
pub struct Detailed {
    /// The scene, unchanged except for its levels.
    pub scene: GaussianScene,
    /// All levels, finest first.
    pub made: Vec<MadeLevel>,
}

/// Makes levels of detail, which replace those of the scene. The levels of a packed scene are packed, those of other
/// scenes are in single precision; no level has a temporal filter. Begins the task "levels" and, inside it, tasks for
/// each level.
///
/// # Errors
/// A scene with an environment map or with windows of time, a scene of which no Gaussian is drawn, a scene that does
/// not fit the GPU, a lost device.
pub fn detail(
    headless: &mut Headless,
    mut scene: GaussianScene,
    settings: &DetailSettings,
    progress: &mut dyn Progress,
) -> Result<Detailed, DetailError> {
    if scene.environment.is_some() {
        return Err(DetailError::Surrounded);
    }
    require_no_windows(scene.filter.as_ref(), "a level of detail")?;
    scene.levels.clear();
    let full = scene.clone().into_runtime()?;
    let sphere = Sphere::of(&full).ok_or(DetailError::NothingDrawn)?;
    let mut maker = Maker { headless, settings, sphere, full, levels: Vec::new() };
    let made = maker.run(progress)?;
    scene.levels = maker.levels;
    Ok(Detailed { scene, made })
}
