//! Captures as assets in Bevy apps: the loading states of entities; files that are missing, broken, replaced or saved;
//! captures without handles.
//!
//! In: packages and checkpoints written to a folder. Out: proof that states and messages are right, and that captures
//! are dropped with their last handle. Needs neither a GPU nor a window.

use crate::support::event_log::{record, take_events};
use crate::support::pth::Pth;
use crate::support::waiting::{LOAD_TIMEOUT, wait_until};
use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader};
use bevy::asset::saver::{SaveAssetError, SavedAsset, save_using_saver};
use bevy::asset::{AssetLoadError, AssetLoadFailedEvent, AssetTrackingSystems, LoadState};
use bevy::prelude::*;
use bevy::tasks::block_on;
use bevy_gs4d::asset::{
    CaptureAssetSystems, CaptureFailed, CaptureLoaderSettings, CaptureReady, CaptureSaveError, CaptureState,
    GaussianCapture, PackageSaver, PackageSaverSettings,
};
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::prelude::Upright;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, TemporalFilter, UpAxis};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::fs;
use std::path::Path;
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tempfile::TempDir;

/// Returns an app whose assets are in `folder`. It watches the files only with `watch`; all other reloads are explicit.
fn app(folder: &Path, watch: bool) -> App {
    let assets = AssetPlugin {
        file_path: folder.to_str().expect("temporary folders have plain names").into(),
        watch_for_changes_override: Some(watch),
        ..default()
    };
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, assets, GaussianCapturePlugins));
    record::<CaptureReady>(&mut app, Update);
    record::<CaptureFailed>(&mut app, Update);
    app.init_resource::<Failures>().add_systems(Update, count_failures);
    app
}

fn ready(entity: Entity, capture: &Handle<GaussianCapture>) -> String {
    format!("{:?}", CaptureReady { entity, capture: capture.id() })
}

/// Updates until `so` returns true, and then twice more to receive late messages.
fn wait(app: &mut App, what: &str, so: impl Fn(&App) -> bool) {
    wait_until(app, what, so, App::update);
    app.update();
    app.update();
}

fn load(app: &App, name: &'static str) -> Handle<GaussianCapture> {
    app.world().resource::<AssetServer>().load(name)
}

fn reload(app: &App, name: &'static str) {
    app.world().resource::<AssetServer>().reload(name);
}

/// Reloads a file that fails, until Bevy has made all `times` attempts: one for a missing file, two for a broken file.
/// A later attempt could otherwise read the file that a test writes next.
fn attempt(app: &mut App, name: &'static str, times: usize) {
    let failures = |app: &App| app.world().resource::<Failures>().0;
    let enough = failures(app) + times;
    reload(app, name);
    wait(app, "failing", |app| failures(app) >= enough);
}

/// The number of failed attempts to load.
#[derive(Resource, Default)]
struct Failures(usize);

fn count_failures(mut failures: MessageReader<AssetLoadFailedEvent<GaussianCapture>>, mut count: ResMut<Failures>) {
    count.0 += failures.read().count();
}

fn spawn(app: &mut App, capture: &Handle<GaussianCapture>) -> Entity {
    app.world_mut().spawn(GaussianCapture3d(capture.clone())).id()
}

fn state(app: &App, entity: Entity) -> CaptureState {
    app.world().get::<CaptureState>(entity).expect("every capture has a state").clone()
}

fn is_ready(app: &App, entity: Entity) -> bool {
    state(app, entity) == CaptureState::Ready
}

fn captures(app: &App) -> &Assets<GaussianCapture> {
    app.world().resource()
}

fn scene<'a>(app: &'a App, capture: &Handle<GaussianCapture>) -> Option<&'a RuntimeScene> {
    Some(captures(app).get(capture)?.scene())
}

/// Returns the number of Gaussians of a capture; 0 if it is not among the assets.
fn count(app: &App, capture: &Handle<GaussianCapture>) -> usize {
    scene(app, capture).map_or(0, RuntimeScene::len)
}

fn synthetic(count: usize) -> GaussianScene {
    synthesize(&SynthSettings { count, ..SynthSettings::default() })
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn write(folder: &Path, name: &str, count: usize) {
    offline::work::save(&folder.join(name), &synthetic(count), &WriteSettings { level: 1 })
        .expect("the folder can be written to");
}

/// Writes the first half of a package.
fn write_broken(folder: &Path, name: &str) {
    write(folder, name, 50);
    let bytes = fs::read(folder.join(name)).expect("just written");
    fs::write(folder.join(name), &bytes[..bytes.len() / 2]).expect("the folder can be written to");
}

#[test]
fn a_capture_is_ready_once_it_has_been_loaded() {
    let folder = folder();
    write(folder.path(), "good.gs4d", 50);
    let mut app = app(folder.path(), false);
    let capture = load(&app, "good.gs4d");
    let entity = spawn(&mut app, &capture);
    assert_eq!(state(&app, entity), CaptureState::Loading, "the state is Loading before the first update");
    wait(&mut app, "loading", |app| is_ready(app, entity));
    assert_eq!(count(&app, &capture), 50, "the capture has been loaded");
    assert_eq!(take_events(&mut app), [ready(entity, &capture)], "one message is sent");
    let second = spawn(&mut app, &capture);
    app.update();
    app.update();
    assert_eq!(state(&app, second), CaptureState::Ready, "another entity with the capture is ready at once");
    assert_eq!(take_events(&mut app), [ready(second, &capture)], "the message is sent only for the new entity");
}

/// An asset source whose files can be read only once the test has opened the gate.
#[derive(Clone)]
struct Gated {
    files: MemoryAssetReader,
    gate: Arc<Mutex<Receiver<()>>>,
}

impl AssetReader for Gated {
    async fn read<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        // A read on the main thread would wait until the timeout and fail the test. A failed test drops the sender,
        // which opens the gate.
        let _ = self.gate.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOAD_TIMEOUT);
        self.files.read(path).await
    }

    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        self.files.read_meta(path).await
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        self.files.read_directory(path).await
    }

    async fn is_directory<'a>(&'a self, path: &'a Path) -> Result<bool, AssetReaderError> {
        self.files.is_directory(path).await
    }
}

#[test]
fn updates_do_not_wait_for_a_loading_capture() {
    let folder = folder();
    write(folder.path(), "slow.gs4d", 50);
    let files = Dir::default();
    files.insert_asset(Path::new("slow.gs4d"), fs::read(folder.path().join("slow.gs4d")).expect("just written"));
    let (open, gate) = mpsc::channel();
    let gated = Gated { files: MemoryAssetReader { root: files }, gate: Arc::new(Mutex::new(gate)) };
    let mut app = App::new();
    app.register_asset_source("gated", AssetSourceBuilder::new(move || Box::new(gated.clone())));
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    let capture = load(&app, "gated://slow.gs4d");
    let entity = spawn(&mut app, &capture);
    for frame in 0..50 {
        app.update();
        assert_eq!(state(&app, entity), CaptureState::Loading, "the capture is still loading in frame {frame}");
    }
    open.send(()).expect("the reader waits");
    wait(&mut app, "loading", |app| is_ready(app, entity));
    assert_eq!(count(&app, &capture), 50, "all Gaussians are loaded");
}

#[test]
fn failures_name_the_file_and_the_remedy() {
    let folder = folder();
    write_broken(folder.path(), "broken.gs4d");
    fs::write(folder.path().join("text.pth"), "epoch 30000\n".repeat(100)).expect("the folder can be written to");
    let mut app = app(folder.path(), false);
    for (name, fault, kind) in [
        ("missing.gs4d", "check the name", "NotFound"),
        ("broken.gs4d", "copy or download it again", "Invalid"),
        ("text.pth", "it is text that begins with epoch 30000", "Invalid"),
    ] {
        let capture = load(&app, name);
        let entity = spawn(&mut app, &capture);
        wait(&mut app, name, |app| matches!(state(app, entity), CaptureState::Failed(_)));
        let CaptureState::Failed(error) = state(&app, entity) else { panic!("{name} has failed") };
        let text = error.to_string();
        assert!(text.starts_with(name) && text.contains(fault), "{text:?} names {name} and contains {fault:?}");
        assert!(!text.contains("loader"), "the error does not mention asset loaders: {text:?}");
        assert!(format!("{error:?}").starts_with(kind), "games can tell that {name} is {kind}: {error:?}");
        let failed = |entity| format!("{:?}", CaptureFailed { entity, error: error.clone() });
        assert_eq!(take_events(&mut app), [failed(entity)], "one failure is sent");
        let late = spawn(&mut app, &capture);
        app.update();
        app.update();
        assert_eq!(state(&app, late), CaptureState::Failed(error.clone()), "an entity spawned later has failed, too");
        assert_eq!(take_events(&mut app), [failed(late)], "the failure is sent only for the new entity");
    }
}

#[test]
fn a_repaired_file_can_be_loaded_again() {
    let folder = folder();
    let mut app = app(folder.path(), false);
    let capture = load(&app, "late.gs4d");
    let entity = spawn(&mut app, &capture);
    wait(&mut app, "failing", |app| matches!(state(app, entity), CaptureState::Failed(_)));
    take_events(&mut app);
    for _ in 0..3 {
        attempt(&mut app, "late.gs4d", 1);
        assert_eq!(take_events(&mut app), [""; 0], "the same failure is not sent again");
        assert!(matches!(state(&app, entity), CaptureState::Failed(_)), "the state is still Failed");
    }
    write_broken(folder.path(), "late.gs4d");
    attempt(&mut app, "late.gs4d", 2);
    let said = take_events(&mut app);
    assert!(said.len() == 1 && said[0].contains("Invalid"), "a different failure is sent: {said:?}");
    write(folder.path(), "late.gs4d", 50);
    reload(&app, "late.gs4d");
    wait(&mut app, "loading", |app| is_ready(app, entity));
    assert_eq!(take_events(&mut app), [ready(entity, &capture)], "the repaired file is ready");
}

#[test]
fn a_failure_is_sent_while_the_server_loads_again() {
    /// The sender that opens the gate, until it has been used.
    #[derive(Resource)]
    struct Gate(Option<mpsc::Sender<()>>);
    /// Runs after the server has received a failure and before the states are updated: lets Bevy's second attempt
    /// begin.
    fn begin_again(server: Res<AssetServer>, mut gate: ResMut<Gate>, captures: Query<&GaussianCapture3d>) {
        let state = || captures.iter().find_map(|capture| server.get_load_state(capture.0.id()));
        if let Some(LoadState::Failed(error)) = state()
            && matches!(*error, AssetLoadError::AssetLoaderError(_))
            && let Some(open) = gate.0.take()
        {
            open.send(()).expect("the reader waits");
            let start = Instant::now();
            while !matches!(state(), Some(LoadState::Loading)) {
                assert!(start.elapsed() < LOAD_TIMEOUT, "the second attempt begins: {:?}", state());
                std::thread::yield_now();
            }
        }
    }
    let (open, gate) = mpsc::channel();
    let files = Dir::default();
    let gated = Gated { files: MemoryAssetReader { root: files.clone() }, gate: Arc::new(Mutex::new(gate)) };
    let mut app = App::new();
    app.register_asset_source("gated", AssetSourceBuilder::new(move || Box::new(gated.clone())));
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    record::<CaptureFailed>(&mut app, Update);
    app.insert_resource(Gate(None))
        .add_systems(PreUpdate, begin_again.after(AssetTrackingSystems).before(CaptureAssetSystems));
    let capture = load(&app, "gated://late.gs4d");
    let entity = spawn(&mut app, &capture);
    open.send(()).expect("the reader waits");
    wait(&mut app, "failing", |app| matches!(state(app, entity), CaptureState::Failed(_)));
    assert_eq!(take_events(&mut app).len(), 1, "the missing file is reported");

    files.insert_asset(Path::new("late.gs4d"), b"not a package".to_vec());
    app.insert_resource(Gate(Some(open.clone())));
    reload(&app, "gated://late.gs4d");
    open.send(()).expect("the reader waits");
    wait(&mut app, "failing again", |app| app.world().resource::<Gate>().0.is_none());
    let said = take_events(&mut app);
    assert!(said.len() == 1 && said[0].contains("Invalid"), "the broken file is reported once: {said:?}");
    wait(&mut app, "the second attempt", |app| matches!(state(app, entity), CaptureState::Failed(_)));
    assert_eq!(take_events(&mut app), [""; 0], "the second attempt fails with the same error");
}

#[test]
fn a_state_follows_the_handle() {
    let folder = folder();
    write(folder.path(), "one.gs4d", 50);
    write(folder.path(), "two.gs4d", 60);
    let mut app = app(folder.path(), false);
    let [one, two] = ["one.gs4d", "two.gs4d"].map(|name| load(&app, name));
    let entity = spawn(&mut app, &one);
    wait(&mut app, "both", |app| count(app, &one) > 0 && count(app, &two) > 0);
    assert_eq!(take_events(&mut app), [ready(entity, &one)], "the first capture is ready");
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(two.clone()));
    app.update();
    app.update();
    assert_eq!(
        (state(&app, entity), take_events(&mut app)),
        (CaptureState::Ready, vec![ready(entity, &two)]),
        "the second capture is ready"
    );
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d::default());
    app.update();
    app.update();
    assert_eq!(state(&app, entity), CaptureState::Loading, "a missing capture counts as loading");
    assert_eq!(take_events(&mut app), [""; 0], "no message is sent for a missing capture");
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(one.clone()));
    app.update();
    app.update();
    assert_eq!(take_events(&mut app), [ready(entity, &one)], "the first capture is ready again");
}

#[test]
fn a_changed_file_replaces_the_capture_and_a_broken_one_does_not() {
    let folder = folder();
    write(folder.path(), "baked.gs4d", 50);
    let mut app = app(folder.path(), false);
    let capture = load(&app, "baked.gs4d");
    let entity = spawn(&mut app, &capture);
    wait(&mut app, "loading", |app| is_ready(app, entity));
    take_events(&mut app);

    write(folder.path(), "baked.gs4d", 70);
    reload(&app, "baked.gs4d");
    wait(&mut app, "the new one", |app| count(app, &capture) == 70);
    assert_eq!(state(&app, entity), CaptureState::Ready, "the state stays Ready during a reload");
    assert_eq!(take_events(&mut app), [ready(entity, &capture)], "the reloaded capture is ready");

    write_broken(folder.path(), "baked.gs4d");
    attempt(&mut app, "baked.gs4d", 2);
    assert_eq!((state(&app, entity), count(&app, &capture)), (CaptureState::Ready, 70), "the previous capture is kept");
    let said_now = take_events(&mut app);
    let failed = said_now.iter().all(|said| said.contains("CaptureFailed") && said.contains("baked.gs4d"));
    assert!(said_now.len() == 1 && failed, "one failure that names the file: {said_now:?}");

    write(folder.path(), "baked.gs4d", 90);
    reload(&app, "baked.gs4d");
    wait(&mut app, "the repaired one", |app| count(app, &capture) == 90);
    assert_eq!(take_events(&mut app), [ready(entity, &capture)], "the repaired capture is ready");
}

#[test]
fn a_capture_is_dropped_with_its_last_handle() {
    let folder = folder();
    write(folder.path(), "good.gs4d", 50);
    let mut app = app(folder.path(), false);
    let capture = load(&app, "good.gs4d");
    let entities = [spawn(&mut app, &capture), spawn(&mut app, &capture)];
    wait(&mut app, "loading", |app| is_ready(app, entities[1]));
    drop(capture);
    app.world_mut().despawn(entities[0]);
    app.update();
    app.update();
    assert_eq!(captures(&app).len(), 1, "a capture with a handle is kept");
    app.world_mut().despawn(entities[1]);
    app.update();
    app.update();
    assert_eq!(captures(&app).len(), 0, "a capture without handles is dropped");
}

/// Returns a capture with colors over time and a filter.
fn dressed() -> RuntimeScene {
    let scene = synthetic(200);
    let runtime = scene.clone().into_runtime().expect("a synthetic scene can be drawn");
    let filter = TemporalFilter::support(
        runtime.iter(),
        scene.trained_with.time_interval,
        scene.trained_with.marginal_cutoff,
        5,
    );
    RuntimeScene { filter: Some(filter), ..runtime }
}

fn save(app: &App, capture: &GaussianCapture) -> Result<(), SaveAssetError> {
    let server = app.world().resource::<AssetServer>().clone();
    let settings = PackageSaverSettings { level: 1 };
    block_on(save_using_saver(server, &PackageSaver, &"made.gs4d".into(), SavedAsset::from_asset(capture), &settings))
}

#[test]
fn a_saved_capture_loads_bit_for_bit() {
    let folder = folder();
    let mut app = app(folder.path(), false);
    let made = GaussianCapture::new(dressed());
    save(&app, &made).expect("the folder can be written to");
    let capture = load(&app, "made.gs4d");
    let entity = spawn(&mut app, &capture);
    wait(&mut app, "loading", |app| is_ready(app, entity));
    assert!(scene(&app, &capture) == Some(made.scene()), "the loaded scene equals the saved scene, bit for bit");
}

#[test]
fn saving_an_inconsistent_scene_is_an_error() {
    let folder = folder();
    let app = app(folder.path(), false);
    let mut broken = dressed();
    broken.form.as_sliced_mut().expect("sliced").harmonics.values.pop();
    let Err(SaveAssetError::SaverError(error)) = save(&app, &GaussianCapture::new(broken)) else {
        panic!("saving an inconsistent scene is an error")
    };
    let typed = error.downcast_ref::<CaptureSaveError>();
    assert!(matches!(typed, Some(CaptureSaveError::Package(_))), "the error is a package error: {error}");
}

const WHITE: &str = "Namespace(sh_degree=3, white_background=True, prefilter_var=0.25)";

/// Returns a folder with one checkpoint without `cfg_args` and two checkpoints with it.
fn checkpoints() -> TempDir {
    let folder = folder();
    let bytes = Pth::rotating(3, 48).bytes();
    for name in ["without/a.pth", "with/a.pth", "with/b.pth"] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("in a folder")).expect("the folder can be written to");
        fs::write(path, &bytes).expect("the folder can be written to");
    }
    fs::write(folder.path().join("with/cfg_args"), WHITE).expect("the folder can be written to");
    folder
}

#[test]
fn settings_override_cfg_args_and_cfg_args_override_defaults() {
    let folder = checkpoints();
    let mut app = app(folder.path(), false);
    let server = app.world().resource::<AssetServer>().clone();
    let settings = |settings: &mut CaptureLoaderSettings| settings.read.background = Some([0.25; 3]);
    let captures: [Handle<GaussianCapture>; 3] = [
        server.load("without/a.pth"),
        server.load("with/a.pth"),
        server.load_builder().with_settings(settings).load("with/b.pth"),
    ];
    let entities = captures.each_ref().map(|capture| spawn(&mut app, capture));
    wait(&mut app, "all three", |app| entities.iter().all(|&entity| is_ready(app, entity)));
    let trained = captures.each_ref().map(|capture| {
        let trained_with = &scene(&app, capture).expect("loaded").trained_with;
        (trained_with.background, trained_with.prefilter_var)
    });
    let expected = [([0.0; 3], -1.0), ([1.0; 3], 0.25), ([0.25; 3], 0.25)];
    assert_eq!(trained, expected, "defaults without cfg_args, values of cfg_args, and settings over cfg_args");
}

#[test]
fn a_checkpoint_is_loaded_again_when_its_cfg_args_change() {
    let folder = checkpoints();
    let mut app = app(folder.path(), true);
    let capture = load(&app, "with/a.pth");
    let entity = spawn(&mut app, &capture);
    let background = |app: &App| scene(app, &capture).map(|scene| scene.trained_with.background);
    wait(&mut app, "loading", |app| is_ready(app, entity));
    assert_eq!(background(&app), Some([1.0; 3]), "the background of cfg_args is white");
    fs::write(folder.path().join("with/cfg_args"), "Namespace(white_background=False)").expect("the file");
    wait(&mut app, "the change", |app| background(app) == Some([0.0; 3]));
    assert!(is_ready(&app, entity), "the reloaded checkpoint is ready");
}

fn upright_of(app: &mut App, up: UpAxis, rotation: Quat) -> Entity {
    let mut scene = synthetic(20).into_runtime().expect("a synthetic scene can be drawn");
    scene.playback.up = up;
    let capture = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
    app.world_mut().spawn((GaussianCapture3d(capture), Upright, Transform::from_rotation(rotation))).id()
}

fn rotation(app: &App, entity: Entity) -> Quat {
    app.world().get::<Transform>(entity).expect("a required component").rotation
}

#[test]
fn upright_turns_every_up_axis_to_y_and_keeps_the_rotation_of_the_game() {
    let folder = folder();
    let mut app = app(folder.path(), false);
    let turn = Quat::from_rotation_y(0.7);
    for up in [UpAxis::PosX, UpAxis::NegX, UpAxis::PosY, UpAxis::NegY, UpAxis::PosZ, UpAxis::NegZ] {
        let [straight, turned] = [Quat::IDENTITY, turn].map(|rotation| upright_of(&mut app, up, rotation));
        app.update();
        app.update();
        let [straight, turned] = [straight, turned].map(|entity| rotation(&app, entity));
        let above = turned * up.vector();
        assert!(above.abs_diff_eq(Vec3::Y, 1e-5), "{up:?} of the capture points to +y, not to {above}");
        assert!(
            turned.abs_diff_eq(turn * straight, 1e-5),
            "the game's rotation applies after the upright rotation, {up:?}"
        );
    }
}

#[test]
fn an_upright_capture_spawned_after_loading_is_turned_in_the_same_update() {
    let folder = folder();
    let mut app = app(folder.path(), false);
    let known = upright_of(&mut app, UpAxis::PosZ, Quat::IDENTITY);
    app.update();
    let capture = app.world().get::<GaussianCapture3d>(known).expect("just spawned").clone();
    app.add_systems(Update, move |mut commands: Commands, mut spawned: Local<bool>| {
        if !std::mem::replace(&mut *spawned, true) {
            commands.spawn((capture.clone(), Upright));
        }
    });
    app.update();
    let mut all = app.world_mut().query_filtered::<&Transform, With<Upright>>();
    let above: Vec<Vec3> = all.iter(app.world()).map(|transform| transform.rotation * Vec3::Z).collect();
    assert!(
        above.len() == 2 && above.iter().all(|up| up.abs_diff_eq(Vec3::Y, 1e-5)),
        "both captures are upright: {above:?}"
    );
}

#[test]
fn an_upright_capture_is_turned_once_per_capture() {
    let folder = folder();
    let mut app = app(folder.path(), false);
    let entity = upright_of(&mut app, UpAxis::PosZ, Quat::IDENTITY);
    let other = upright_of(&mut app, UpAxis::NegY, Quat::IDENTITY);
    app.update();
    let turn = Quat::from_rotation_y(0.4);
    app.world_mut().get_mut::<Transform>(entity).expect("a required component").rotate(turn);
    let upright = Quat::from_rotation_arc(Vec3::Z, Vec3::Y);
    for _ in 0..3 {
        app.update();
        assert!(rotation(&app, entity).abs_diff_eq(turn * upright, 1e-5), "a rotation by the game is kept");
    }
    let capture = app.world().get::<GaussianCapture3d>(other).expect("just spawned").clone();
    app.world_mut().entity_mut(entity).insert(capture);
    app.update();
    let above = rotation(&app, entity) * Vec3::NEG_Y;
    assert!(above.abs_diff_eq(Vec3::Y, 1e-5), "another capture with another up axis is turned upright, not to {above}");
}
