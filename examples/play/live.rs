//! Captures whose file changes while the example `play` shows them, such as the output of `gs4d train`.
//!
//! In: the capture of the app, the stamp of its file. Out: the capture, loaded again after each change. Bevy's own
//! watcher sees files in `assets/` alone, and not those that a complete file replaces under its name, as `gs4d` does.

use super::stamp::Stamp;
use bevy::asset::io::file::FileAssetReader;
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::GaussianCapture;

/// Loads the capture again if its file has changed since the last look, or has appeared.
pub fn reload_changed(
    assets: Res<AssetServer>,
    capture: Single<&GaussianCapture3d>,
    mut seen: Local<Option<(AssetId<GaussianCapture>, Stamp)>>,
) {
    let id = capture.0.id();
    let Some(path) = assets.get_path(id) else { return };
    // An absolute path replaces the folder.
    let stamp = Stamp::of(&FileAssetReader::get_base_path().join("assets").join(path.path()));
    if let Some((_, before)) = seen.filter(|(seen, _)| *seen == id) {
        if !stamp.is_change_of(before) {
            return;
        }
        assets.reload(path.into_owned());
    }
    *seen = Some((id, stamp));
}
