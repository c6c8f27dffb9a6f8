//! Time without pictures.
//!
//! In: an app, and a time to pass. Out: the same app, that much later.

use super::error::TestingError;
use super::waiting::{load, update};
use bevy::app::App;
use bevy::time::{TimePlugin, TimeUpdateStrategy};
use std::time::Duration;

/// Time that one update of [`step`] advances, but for the last: a frame of most displays.
const FRAME: Duration = Duration::from_nanos(16_666_667);

/// Waits until all assets are loaded, and advances the app by exactly `duration`: in updates of a 60th of a second, and a last one of what
/// is left. Then time stands still.
///
/// Systems run as often as in a game. [`picture`](super::picture) makes the whole step in one update instead. Needs no GPU; any app with
/// Bevy's `TimePlugin` will do. The game's own clock may be paused or slowed down meanwhile, as ever.
///
/// # Errors
/// An app without `TimePlugin`; an asset that cannot be loaded, or not within two minutes; errors of drawing.
pub fn step(app: &mut App, duration: Duration) -> Result<(), TestingError> {
    // While assets are loaded, no time passes in other apps than our own, either.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    load(app)?;
    let mut left = duration;
    while !left.is_zero() {
        let frame = left.min(FRAME);
        advance(app, frame)?;
        left -= frame;
    }
    Ok(())
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
