//! Checkpoints that Bevy processes to packages, in apps without a window.
//!
//! In: small checkpoints in the folder of a game's assets, with and without `.meta` files. Out: proof that the game
//! loads packages in their place, that settings decide what these are like, and that a changed `.meta` file, and
//! nothing else, makes Bevy process a checkpoint again. Needs neither a GPU nor a window.

use crate::support::pth::Pth;
use crate::support::waiting::wait_until;
use bevy::asset::AssetMode;
use bevy::asset::processor::{AssetProcessor, FileTransactionLogFactory};
use bevy::prelude::*;
use bevy_gs4d::asset::{CaptureState, GaussianCapture};
use bevy_gs4d::codec::package::{self, StoredForm};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use tempfile::TempDir;

/// The folders of a game.
struct Game(TempDir);

impl Game {
    /// Returns a game with the checkpoint `tiny.pth`, which was trained over white.
    fn new() -> Self {
        let game = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(game.path("assets")).expect("the folder can be written to");
        fs::write(game.path("assets/tiny.pth"), Pth::rotating(40, 48).bytes()).expect("the folder can be written to");
        fs::write(game.path("assets/cfg_args"), "Namespace(white_background=True)").expect("written");
        game
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes the `.meta` file of the checkpoint with these settings of the loader and of the transformer.
    fn set(&self, loader: &str, transformer: &str) {
        let meta = format!(
            "(meta_format_version: \"1.0\", asset: Process(
                processor: \"LoadTransformAndSave<CaptureLoader, CaptureTransformer, PackageSaver>\",
                settings: (
                    loader_settings: ({loader}),
                    transformer_settings: ({transformer}),
                    saver_settings: (level: 19),
                ),
            ))"
        );
        fs::write(self.path("assets/tiny.pth.meta"), meta).expect("the folder can be written to");
    }

    /// Starts the game, which processes its assets, loads the checkpoint, and ends. Returns the capture.
    fn play(&self) -> RuntimeScene {
        let text = |name: &str| self.path(name).to_str().expect("temporary folders have plain names").to_owned();
        let assets = AssetPlugin {
            mode: AssetMode::Processed,
            file_path: text("assets"),
            processed_file_path: text("processed"),
            use_asset_processor_override: Some(true),
            watch_for_changes_override: Some(false),
            ..default()
        };
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins));
        let log = FileTransactionLogFactory { file_path: self.path("log") };
        let processor = app.world().resource::<AssetProcessor>();
        processor.data().set_log_factory(Box::new(log)).expect("processing has not begun");
        let capture: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load("tiny.pth");
        let entity = app.world_mut().spawn(GaussianCapture3d(capture.clone())).id();
        let state = |app: &App| app.world().get::<CaptureState>(entity).expect("every capture has a state").clone();
        wait_until(&mut app, "loading", |app| state(app) != CaptureState::Loading, App::update);
        assert_eq!(state(&app), CaptureState::Ready, "the capture is loaded");
        let captures = app.world().resource::<Assets<GaussianCapture>>();
        captures.get(&capture).expect("it is among the assets").scene().clone()
    }

    /// Returns the header of the processed file, and when it was written.
    fn processed(&self) -> (package::Header, SystemTime) {
        let path = self.path("processed/tiny.pth");
        let info = package::inspect(File::open(&path).expect("the file was processed")).expect("a package");
        assert!(info.is_intact(), "every checksum is correct");
        (info.header, modified(&path))
    }
}

fn modified(path: &Path) -> SystemTime {
    path.metadata().and_then(|metadata| metadata.modified()).expect("times of files are known")
}

#[test]
fn a_checkpoint_is_loaded_as_the_package_that_it_was_processed_to() {
    let game = Game::new();
    let scene = game.play();
    let (header, written) = game.processed();
    assert!(matches!(header.form, StoredForm::Packed { .. }), "packed, unless a .meta file says otherwise");
    assert_eq!((scene.len(), scene.filter.as_ref().map(|filter| filter.segments)), (40, Some(10)), "with a filter");
    assert_eq!(scene.trained_with.background, [1.0; 3], "cfg_args beside the checkpoint is read");
    game.play();
    assert_eq!(game.processed().1, written, "a checkpoint that has not changed is not processed again");
}

#[test]
fn a_changed_meta_file_processes_the_checkpoint_again() {
    let game = Game::new();
    fs::remove_file(game.path("assets/cfg_args")).expect("the file exists");
    game.set("", "form: Runtime, segments: None, sh_degree: 1");
    let scene = game.play();
    let (header, _) = game.processed();
    assert_eq!((header.form, header.degree), (StoredForm::Sliced, 1), "as the settings say");
    assert!(scene.filter.is_none(), "without a filter");
    game.set("", "packing: (bits: (mean: 12), color_step: 0.0), segments: Some(4)");
    let scene = game.play();
    let (header, _) = game.processed();
    assert!(matches!(header.form, StoredForm::Packed { .. }), "as the changed settings say");
    assert_eq!(header.filter.map(|filter| filter.segments), Some(4), "with the filter that they say");
    assert_eq!(scene.form.color_degrees().degree, 3, "and colors of all degrees");
}

#[test]
fn settings_of_the_loader_are_kept_in_the_processed_capture() {
    let game = Game::new();
    game.set("read: (duration_seconds: Some(7.0)), asset_usage: (\"RENDER_WORLD\")", "segments: None");
    assert_eq!(game.play().playback.duration_seconds, 7.0, "in the package");
    let meta = fs::read_to_string(game.path("processed/tiny.pth.meta")).expect("the file was processed");
    let is_kept = meta.contains("CaptureLoader") && meta.contains("\"RENDER_WORLD\"");
    assert!(is_kept, "the Gaussians are needed for drawing alone, as the settings say: {meta}");
}
