//! Captures that are dropped on the window of the example `play`.
//!
//! In: files of any format, folders of sequences. Out: the capture of the app, played from its beginning.

use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::{CaptureLoaderSettings, GaussianCapture};
use bevy_gs4d::playback::Playback;
use std::path::Path;

/// Loads a file, or the capture in a folder: its `meta.json`, or its numbered files as a sequence.
pub fn load(assets: &AssetServer, path: &Path) -> Handle<GaussianCapture> {
    if !path.is_dir() {
        return assets.load(path.to_owned());
    }
    let files = path.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
    let first = files.filter(|file| file.extension().is_some_and(|extension| extension == "ply")).min();
    match first {
        Some(first) => {
            let settings = |settings: &mut CaptureLoaderSettings| settings.read.sequence = true;
            assets.load_builder().with_settings(settings).load(first)
        }
        None => assets.load(path.join("meta.json")),
    }
}

/// Shows the last capture that has been dropped.
pub fn drop_file(
    mut drops: MessageReader<FileDragAndDrop>,
    assets: Res<AssetServer>,
    mut capture: Single<(&mut GaussianCapture3d, &mut Playback)>,
) {
    for drop in drops.read() {
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = drop {
            let (shown, playback) = &mut *capture;
            shown.0 = load(&assets, path_buf);
            **playback = Playback::default();
        }
    }
}
