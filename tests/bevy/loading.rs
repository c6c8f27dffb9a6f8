//! The loader of captures, with the same settings for every kind of file.
//!
//! In: a package, a checkpoint and a PLY, with settings of the loader and in a `.meta` file. Out: proof that they are
//! loaded as `codec::load` loads them with the same options; that a long loading pauses, so that a page can draw; that
//! a file that a capture names is reported if it is missing. Needs neither a GPU nor a window.

use crate::support::asset_app::{app, scene, wait};
use crate::support::pth::Pth;
use bevy::asset::io::{Reader, VecReader};
use bevy::asset::{AssetLoader, LoadContext, RenderAssetUsages};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy_gs4d::asset::{
    CaptureFailure, CaptureLoadError, CaptureLoader, CaptureLoaderSettings, CaptureState, GaussianCapture,
};
use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::scene::UpAxis;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use std::fs;
use std::future::poll_fn;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A PLY with one Gaussian.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                   property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
                   property float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\n\
                   property float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n\
                   0 0 0 1 1 1 5 -2 -2 -2 1 0 0 0\n";

fn package_of(count: usize) -> Vec<u8> {
    let (scene, mut bytes) = (synthesize(&SynthSettings { count, ..SynthSettings::default() }), Vec::new());
    package::write(&mut bytes, &scene, &WriteSettings { level: 1 }).expect("memory can be written to");
    bytes
}

#[test]
fn settings_apply_to_packages_checkpoints_and_files_of_other_makes_alike() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let read = ReadOptions { up: Some(UpAxis::PosX), marginal_cutoff: Some(0.25), ..ReadOptions::default() };
    let mut app = app(folder.path());
    for (name, bytes) in
        [("a.gs4d", package_of(20)), ("a.pth", Pth::rotating(3, 48).bytes()), ("a.ply", PLY.as_bytes().to_vec())]
    {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("the folder can be written to");
        let given = CaptureLoaderSettings { read: read.clone(), asset_usage: RenderAssetUsages::RENDER_WORLD };
        let settings = move |settings: &mut CaptureLoaderSettings| settings.clone_from(&given);
        let capture = app.world().resource::<AssetServer>().load_builder().with_settings(settings).load(name);
        assert_eq!(wait(&mut app, name, &capture), CaptureState::Ready, "{name} is loaded");
        let expected = codec::load(&path, &read).expect("a readable file").into_runtime().expect("drawable");
        let found = scene(&app, &capture);
        assert_eq!(*found, expected, "{name}: as without Bevy");
        let playing = (found.playback.up, found.trained_with.marginal_cutoff);
        assert_eq!(playing, (UpAxis::PosX, 0.25), "{name}: the settings");
    }
}

#[test]
fn a_meta_file_has_the_settings_of_a_package() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("a.gs4d"), package_of(20)).expect("the folder can be written to");
    let meta = r#"(meta_format_version: "1.0", asset: Load(
        loader: "bevy_gs4d::asset::CaptureLoader",
        settings: (read: (duration_seconds: Some(4.0), up: Some(neg_y)), asset_usage: ("RENDER_WORLD")),
    ))"#;
    fs::write(folder.path().join("a.gs4d.meta"), meta).expect("the folder can be written to");
    let mut app = app(folder.path());
    let capture = app.world().resource::<AssetServer>().load("a.gs4d");
    assert_eq!(wait(&mut app, "a.gs4d", &capture), CaptureState::Ready, "it is loaded");
    let playback = scene(&app, &capture).playback;
    assert_eq!((playback.up, playback.duration_seconds), (UpAxis::NegY, 4.0), "the settings of the file");
}

/// Loads as [`CaptureLoader`] does, and counts its pauses.
#[derive(TypePath)]
struct Counting(Arc<AtomicUsize>);

impl AssetLoader for Counting {
    type Asset = GaussianCapture;
    type Settings = CaptureLoaderSettings;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &CaptureLoaderSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        // Nothing has to be waited for: a loader that is not ready pauses.
        let mut at_hand = VecReader::new(bytes);
        let loader = CaptureLoader::default();
        let mut loading = pin!(loader.load(&mut at_hand, settings, context));
        let poll = poll_fn(|context| {
            let polled = loading.as_mut().poll(context);
            self.0.fetch_add(usize::from(polled.is_pending()), Ordering::Relaxed);
            polled
        });
        poll.await
    }

    fn extensions(&self) -> &[&str] {
        &["counted"]
    }
}

#[test]
fn a_long_loading_pauses_so_that_a_page_can_draw() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("a.counted"), package_of(6000)).expect("the folder can be written to");
    let mut app = app(folder.path());
    let pauses = Arc::new(AtomicUsize::new(0));
    app.register_asset_loader(Counting(pauses.clone()));
    let capture = app.world().resource::<AssetServer>().load("a.counted");
    assert_eq!(wait(&mut app, "a.counted", &capture), CaptureState::Ready, "it is loaded");
    let mebibytes = scene(&app, &capture).size() >> 20;
    let pauses = pauses.load(Ordering::Relaxed);
    assert!(mebibytes > 2, "the scene is not small: {mebibytes} MiB");
    assert!(pauses > mebibytes, "each mebibyte is read, stored and converted with a pause: {pauses} of {mebibytes}");
}

#[test]
fn a_file_that_a_capture_names_is_reported_if_it_is_missing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let document = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "b.bin", "byteLength": 4}],
        "meshes": [{"primitives": [{"extensions": {"KHR_gaussian_splatting": {}}}]}]}"#;
    fs::write(folder.path().join("a.gltf"), document).expect("the folder can be written to");
    let mut app = app(folder.path());
    let capture = app.world().resource::<AssetServer>().load("a.gltf");
    let state = wait(&mut app, "a.gltf", &capture);
    let CaptureState::Failed(failure) = state else { panic!("without its buffer it is not loaded") };
    assert!(matches!(failure, CaptureFailure::Unreadable { .. }), "games can tell: {failure:?}");
    let message = failure.to_string();
    assert!(message.starts_with("a.gltf: ") && message.contains("b.bin"), "both files are named: {message}");
}
