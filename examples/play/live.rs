//! Captures whose file changes while the example `play` shows them, such as the output of `gs4d train`.
//!
//! In: the capture of the app, the size and the time of change of its file. Out: the capture, loaded again after each
//! change. Bevy's own watcher sees files in `assets/` alone, and not those that a complete file replaces under its
//! name, as `gs4d` does.

use bevy::asset::io::file::FileAssetReader;
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::GaussianCapture;
use std::fs;
use std::time::SystemTime;

/// What changes with the contents of a file.
type Stamp = (u64, Option<SystemTime>);

/// Loads the capture again if its file has changed since the last look, or has appeared. A file that is missing for a
/// moment is not a change.
pub fn reload_changed(
    assets: Res<AssetServer>,
    capture: Single<&GaussianCapture3d>,
    mut seen: Local<Option<(AssetId<GaussianCapture>, Option<Stamp>)>>,
) {
    let Some(path) = assets.get_path(capture.0.id()) else { return };
    // An absolute path replaces the folder.
    let file = FileAssetReader::get_base_path().join("assets").join(path.path());
    let stamp = fs::metadata(file).ok().map(|found| (found.len(), found.modified().ok()));
    let now = (capture.0.id(), stamp);
    let before = seen.filter(|before| before.0 == now.0);
    if before.is_some() && stamp.is_none() {
        return;
    }
    if before.is_some_and(|before| before != now) {
        assets.reload(path.into_owned());
    }
    *seen = Some(now);
}
