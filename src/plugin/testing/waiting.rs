//! Running an app until all assets are drawn.
//!
//! In: an app, and hooks that return the assets it still needs. Out: the same app with these assets loaded and uploaded
//! and every pipeline compiled. No time has passed.

use super::error::TestingError;
use super::pipelines::{pipelines_are_ready, require_renderer, watch_pipelines};
use crate::plugin::asset::{CaptureState, Uploads};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::{Timeline, TimelinePlayer};
use crate::plugin::render::CaptureStatistics;
use crate::plugin::stream::CaptureStreamState;
use bevy::app::{App, PluginsState};
use bevy::asset::{AssetId, AssetServer, Assets, LoadState, UntypedAssetId};
use bevy::ecs::resource::Resource;
use bevy::ecs::world::World;
use std::time::{Duration, Instant};

/// Longest time for plugins to get ready, for assets to load and for pipelines to compile.
const LOAD_TIMEOUT: Duration = Duration::from_secs(120);
/// Number of updates after which all uploaded captures are drawn completely. Buffers grow by the counts of an earlier
/// frame, so a first frame may lack room.
const SETTLING: usize = 3;

/// A function that returns the assets that are needed and not loaded yet.
type Hook = fn(&mut World) -> Vec<UntypedAssetId>;

/// The hooks that return the assets to wait for.
#[derive(Resource, Clone)]
struct Awaited(Vec<Hook>);

impl Default for Awaited {
    fn default() -> Self {
        Self(vec![captures, timelines])
    }
}

/// Makes [`settle`] and all functions that take pictures wait for further assets besides captures and timelines: for
/// each asset that `missing` returns, until `missing` no longer returns it or the asset server no longer tracks it. An
/// asset that cannot be loaded is an error.
///
/// # Examples
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_gs4d::testing;
/// #[derive(Resource)]
/// struct Poster(Handle<Image>);
///
/// let mut app = testing::app(UVec2::new(320, 240));
/// testing::wait_for(&mut app, |world| {
///     let images = world.resource::<Assets<Image>>();
///     let poster = world.get_resource::<Poster>().filter(|poster| !images.contains(&poster.0));
///     poster.map(|poster| poster.0.id().untyped()).into_iter().collect()
/// });
/// ```
pub fn wait_for(app: &mut App, missing: fn(&mut World) -> Vec<UntypedAssetId>) {
    app.world_mut().get_resource_or_init::<Awaited>().0.push(missing);
}

/// Runs the app until every capture and timeline in its world is loaded and drawn.
///
/// # Errors
/// [`TestingError::NoGpu`]; an app without a renderer, or without
/// [`GaussianCapturePlugins`](crate::GaussianCapturePlugins) though it has captures; an asset that cannot be loaded, or
/// not within two minutes; errors of drawing.
pub fn settle(app: &mut App) -> Result<(), TestingError> {
    require_renderer(app)?;
    load(app)?;
    let began = Instant::now();
    loop {
        for _ in 0..SETTLING {
            update(app)?;
        }
        // Loaded assets may need pipelines that are compiled in the background, and captures may have changed.
        if pipelines_are_ready(app)? && uploading(app.world_mut()).is_empty() {
            return Ok(());
        }
        if began.elapsed() > LOAD_TIMEOUT {
            return Err(TestingError::Slow { seconds: LOAD_TIMEOUT.as_secs(), what: "shaders, or captures".into() });
        }
    }
}

/// Runs the app, at least once, until all assets are loaded, all captures uploaded and all pipelines compiled.
pub(super) fn load(app: &mut App) -> Result<(), TestingError> {
    start(app)?;
    let began = Instant::now();
    loop {
        update(app)?;
        let mut missing = missing(app.world_mut())?;
        missing.extend(uploading(app.world_mut()));
        let compiled = pipelines_are_ready(app)?;
        if missing.is_empty() && compiled {
            return Ok(());
        }
        if began.elapsed() > LOAD_TIMEOUT {
            let what = if compiled { missing.join(", ") } else { "shaders".into() };
            return Err(TestingError::Slow { seconds: LOAD_TIMEOUT.as_secs(), what });
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Finishes the plugins, as a runner does before the first update.
pub(super) fn start(app: &mut App) -> Result<(), TestingError> {
    watch_pipelines(app);
    finish_plugins(app, LOAD_TIMEOUT)
}

fn finish_plugins(app: &mut App, limit: Duration) -> Result<(), TestingError> {
    let began = Instant::now();
    while app.plugins_state() == PluginsState::Adding {
        if began.elapsed() > limit {
            return Err(TestingError::Slow { seconds: limit.as_secs(), what: "one of the app's plugins".into() });
        }
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    if app.plugins_state() == PluginsState::Ready {
        app.finish();
    }
    if app.plugins_state() == PluginsState::Finished {
        app.cleanup();
    }
    Ok(())
}

/// Runs one update.
pub(super) fn update(app: &mut App) -> Result<(), TestingError> {
    app.update();
    match app.should_exit() {
        Some(_) => Err(TestingError::Stopped),
        None => Ok(()),
    }
}

/// Returns the names of the assets that are still being loaded.
fn missing(world: &mut World) -> Result<Vec<String>, TestingError> {
    let has_captures = world.query::<&GaussianCapture3d>().iter(world).next().is_some();
    if has_captures && !world.contains_resource::<Assets<GaussianCapture>>() {
        return Err(TestingError::NoPlugin { plugin: "GaussianCapturePlugins" });
    }
    let hooks = world.get_resource_or_init::<Awaited>().clone();
    let wanted: Vec<UntypedAssetId> = hooks.0.iter().flat_map(|hook| hook(world)).collect();
    let Some(server) = world.get_resource::<AssetServer>() else { return Ok(Vec::new()) };
    let mut missing = Vec::new();
    for id in wanted {
        match server.get_load_state(id) {
            Some(LoadState::Failed(failure)) => return Err(TestingError::Asset(failure)),
            Some(LoadState::NotLoaded | LoadState::Loading) => {
                missing.push(server.get_path(id).map_or_else(|| id.to_string(), |path| path.to_string()));
            }
            // The game has removed the asset, or the server does not load it: it will never be ready.
            Some(LoadState::Loaded) | None => {}
        }
    }
    Ok(missing)
}

/// Returns the names of loaded captures that are not drawn yet.
fn uploading(world: &mut World) -> Vec<String> {
    let mut spawned = world.query::<(&GaussianCapture3d, &CaptureState)>();
    let mut streamed = world.query::<(&GaussianCapture3d, &CaptureStreamState)>();
    let players = players(world);
    let Some(loaded) = world.get_resource::<Assets<GaussianCapture>>() else { return Vec::new() };
    let streaming = streamed.iter(world).filter(|(_, state)| is_streaming(state)).map(|(capture, _)| capture.0.id());
    let waiting = spawned.iter(world).filter(|(_, state)| **state == CaptureState::Loading);
    let waiting = waiting.map(|(capture, _)| capture.0.id()).filter(|id| loaded.contains(*id));
    // Captures of later clips are on no entity yet, and timelines wait for them.
    let uploads = world.get_resource::<Uploads>();
    let is_awaited = |id: AssetId<GaussianCapture>| uploads.is_some_and(|uploads| uploads.awaits(id));
    let clips = clips(world, &players).into_iter().filter(|id| loaded.contains(*id) && is_awaited(*id));
    let waiting = waiting.chain(clips).chain(streaming);
    // Of changed captures, the older version is drawn.
    let changed = world.get_resource::<CaptureStatistics>().map_or(0, CaptureStatistics::uploading_captures);
    waiting.map(|id| id.to_string()).chain((changed > 0).then(|| format!("{changed} changed captures"))).collect()
}

/// Returns whether a picture would lack Gaussians that are still being loaded. Those that the budget leaves no room for
/// are not.
fn is_streaming(state: &CaptureStreamState) -> bool {
    !state.is_coarse || !state.is_whole() && (state.requests > 0 || state.retries > 0)
}

fn captures(world: &mut World) -> Vec<UntypedAssetId> {
    let mut spawned = world.query::<&GaussianCapture3d>();
    absent(world, spawned.iter(world).map(|capture| capture.0.id()))
}

/// Returns the timelines that are needed, and the captures that loaded timelines need.
fn timelines(world: &mut World) -> Vec<UntypedAssetId> {
    let players = players(world);
    let Some(timelines) = world.get_resource::<Assets<Timeline>>() else { return Vec::new() };
    let mut absent = absent(world, clips(world, &players).into_iter());
    absent.extend(players.iter().filter(|player| !timelines.contains(**player)).map(|player| player.untyped()));
    absent
}

/// Returns the timelines that are played.
fn players(world: &mut World) -> Vec<AssetId<Timeline>> {
    let mut players = world.query::<&TimelinePlayer>();
    players.iter(world).map(|player| player.0.id()).collect()
}

/// Returns the captures of the loaded timelines among `players`.
fn clips(world: &World, players: &[AssetId<Timeline>]) -> Vec<AssetId<GaussianCapture>> {
    let Some(timelines) = world.get_resource::<Assets<Timeline>>() else { return Vec::new() };
    let loaded = players.iter().filter_map(|player| timelines.get(*player));
    let clips = loaded.flat_map(|timeline| timeline.tracks()).flat_map(|track| &track.clips);
    clips.map(|clip| clip.capture.id()).collect()
}

/// Returns the captures that are not among the assets.
fn absent(world: &World, captures: impl Iterator<Item = AssetId<GaussianCapture>>) -> Vec<UntypedAssetId> {
    let Some(loaded) = world.get_resource::<Assets<GaussianCapture>>() else { return Vec::new() };
    captures.filter(|capture| !loaded.contains(*capture)).map(AssetId::untyped).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::MinimalPlugins;
    use bevy::app::Plugin;

    struct Endless;

    impl Plugin for Endless {
        fn build(&self, _: &mut App) {}

        fn ready(&self, _: &App) -> bool {
            false
        }
    }

    #[test]
    fn waiting_for_a_plugin_that_is_never_ready_ends_with_an_error() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, Endless));
        let waited = finish_plugins(&mut app, Duration::from_millis(5));
        assert!(matches!(waited, Err(TestingError::Slow { .. })), "waiting ends after the limit: {waited:?}");
    }

    #[test]
    fn pictures_wait_for_files_on_their_way_and_for_retries() {
        let coarse = || CaptureStreamState { is_coarse: true, needed: 2, resident: 1, ..CaptureStreamState::default() };
        assert!(!is_streaming(&coarse()), "the budget has no room for the other file");
        assert!(is_streaming(&CaptureStreamState { requests: 1, ..coarse() }), "the file is on its way");
        assert!(is_streaming(&CaptureStreamState { retries: 1, ..coarse() }), "the file has failed");
        let whole = CaptureStreamState { resident: 2, requests: 1, ..coarse() };
        assert!(!is_streaming(&whole), "a file of a later time is on its way");
        assert!(is_streaming(&CaptureStreamState::default()), "there is no picture yet");
    }

    #[test]
    fn finishing_plugins_again_changes_nothing() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins);
        app.finish();
        for _ in 0..2 {
            finish_plugins(&mut app, LOAD_TIMEOUT).expect("all plugins are ready");
            assert_eq!(app.plugins_state(), PluginsState::Cleaned, "all plugins are finished and cleaned up");
        }
    }
}
