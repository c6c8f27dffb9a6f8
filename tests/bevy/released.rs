//! Captures whose Gaussians are dropped from memory once they are on the GPU.
//!
//! In: a package, loaded with both usages and for the render world alone, and a checkpoint. Out: proof that the
//! pictures are equal, that picking and saving report the missing Gaussians, and that the usages do not depend on the
//! format. Skipped without a GPU; a software driver is enough.

use crate::support::fixtures::{synthetic, synthetic_eye};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use crate::support::pth::Pth;
use bevy::asset::RenderAssetUsages;
use bevy::asset::saver::{SavedAsset, save_using_saver};
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy::tasks::block_on;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::{CaptureLoaderSettings, GaussianCapture, PackageSaver, PackageSaverSettings};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::picker::CapturePicker;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::scene::GaussianScene;
use std::path::Path;

const SIZE: UVec2 = UVec2::new(64, 48);

/// Returns an app that draws the capture in a file, loaded with these usages, and its handle.
fn drawing(file: &Path, asset_usage: RenderAssetUsages) -> Option<(App, Handle<GaussianCapture>)> {
    let mut app = app(SIZE)?;
    let settings = move |settings: &mut CaptureLoaderSettings| settings.asset_usage = asset_usage;
    let path = file.to_str().expect("temporary folders have plain names").to_owned();
    let capture = app.world().resource::<AssetServer>().load_builder().with_settings(settings).load(path);
    app.world_mut().spawn((GaussianCapture3d(capture.clone()), Playback::paused_at(0.7)));
    spawn_camera(&mut app, Msaa::Off, synthetic_eye());
    Some((app, capture))
}

/// Returns whether a ray from the camera towards any of the points around the origin hits a capture.
fn is_hit(app: &mut App) -> bool {
    let cast = |picker: CapturePicker| {
        let eye = synthetic_eye().translation;
        let towards = |x: i32, z: i32| Dir3::new(Vec3::new(x as f32, 0.0, z as f32) * 0.1 - eye).expect("not the eye");
        (-5..=5)
            .flat_map(|x| (-5..=5).map(move |z| (x, z)))
            .any(|(x, z)| picker.cast(Ray3d::new(eye, towards(x, z))).is_some())
    };
    app.world_mut().run_system_once(cast).expect("the system runs")
}

#[test]
fn a_capture_without_a_copy_in_memory_is_drawn_and_reports_that_it_cannot_be_picked_or_saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("small.gs4d");
    let scene = GaussianScene::from(synthetic(2000, 1, true));
    offline::work::save(&file, &scene, &WriteSettings { level: 1 }).expect("the folder can be written to");
    let mut pictures = Vec::new();
    for usages in [RenderAssetUsages::default(), RenderAssetUsages::RENDER_WORLD] {
        let Some((mut app, handle)) = drawing(&file, usages) else { return };
        pictures.push(picture(&mut app, 0.0));
        let capture = app.world().resource::<Assets<GaussianCapture>>().get(&handle).expect("still loaded").clone();
        let keeps = usages.contains(RenderAssetUsages::MAIN_WORLD);
        assert_eq!(capture.is_released(), !keeps, "{usages:?}: the Gaussians are released");
        assert_eq!(capture.scene().len(), if keeps { 2000 } else { 0 }, "{usages:?}: the Gaussians in memory");
        assert!(capture.bounds().is_some(), "{usages:?}: the bounds are known");
        assert!(capture.key_frames().is_some(), "{usages:?}: the key-frames are known");
        assert_eq!(is_hit(&mut app), keeps, "{usages:?}: a ray hits the capture");
        let server = app.world().resource::<AssetServer>().clone();
        let to = folder.path().join("saved.gs4d").to_str().expect("a plain name").to_owned();
        let saved = SavedAsset::from_asset(&capture);
        let settings = PackageSaverSettings::default();
        let result = block_on(save_using_saver(server, &PackageSaver, &to.into(), saved, &settings));
        match result {
            Ok(()) => assert!(keeps, "{usages:?}: a capture without Gaussians is not saved"),
            Err(error) => {
                let error = format!("{error}");
                assert!(
                    !keeps && error.contains("RenderAssetUsages"),
                    "{usages:?}: the error names the remedy: {error}"
                );
            }
        }
    }
    assert!(pictures[0].pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "the capture is drawn");
    assert!(pictures[0] == pictures[1], "the pictures are equal");
}

#[test]
fn a_checkpoint_without_a_copy_in_memory_is_drawn() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("tiny.pth");
    std::fs::write(&file, Pth::rotating(40, 48).bytes()).expect("the folder can be written to");
    let Some((mut app, handle)) = drawing(&file, RenderAssetUsages::RENDER_WORLD) else { return };
    picture(&mut app, 0.0);
    let capture = app.world().resource::<Assets<GaussianCapture>>().get(&handle).expect("still loaded");
    assert!(capture.is_released() && capture.scene().is_empty(), "the Gaussians are released");
}
