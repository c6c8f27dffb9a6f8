//! Time steps without pictures.
//!
//! In: an app and a duration. Out: the same app after that duration.

use super::error::TestingError;
use super::waiting::{load, update};
use bevy::app::App;
use bevy::time::{TimePlugin, TimeUpdateStrategy};
use std::time::Duration;

/// Duration of each update of [`step`] except the last: one frame at 60 Hz.
const FRAME: Duration = Duration::from_nanos(16_666_667);

/// Waits until all assets are loaded and advances the app by exactly `duration`, in updates of a 60th of a second and a
/// shorter last update. No time passes afterwards.
///
/// Systems run as often as in a game at 60 Hz; [`picture`](super::picture) makes the whole step in one update instead.
/// Needs no GPU, only an app with Bevy's `TimePlugin`. Pausing or scaling `Time<Virtual>` works as in a game.
///
/// # Errors
/// An app without `TimePlugin`; an asset that cannot be loaded, or not within two minutes; errors of drawing.
pub fn step(app: &mut App, duration: Duration) -> Result<(), TestingError> {
    // No time passes while assets are loaded, also in apps that `testing::app` did not create.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    load(app)?;
    if duration.is_zero() { Ok(()) } else { advance_by(app, duration) }
}

/// Advances the app as [`step`] does, in at least one update, without waiting for assets.
pub(super) fn advance_by(app: &mut App, duration: Duration) -> Result<(), TestingError> {
    let mut left = duration;
    loop {
        let frame = left.min(FRAME);
        advance(app, frame)?;
        left -= frame;
        if left.is_zero() {
            return Ok(());
        }
    }
}

/// Runs one update that advances time by `step`.
pub(super) fn advance(app: &mut App, step: Duration) -> Result<(), TestingError> {
    if !step.is_zero() && !app.is_plugin_added::<TimePlugin>() {
        return Err(TestingError::NoPlugin { plugin: "TimePlugin (DefaultPlugins and MinimalPlugins have it)" });
    }
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let stepped = update(app);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    stepped
}
