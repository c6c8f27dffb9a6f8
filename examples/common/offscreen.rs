//! A Bevy app without a window, rendered into pictures.
//!
//! In: an app made by [`app`] whose camera has [`Offscreen::target`]. Out: pictures, each at an exact time: time stands still but
//! for the steps asked for.

use bevy::app::PluginsState;
use bevy::asset::{LoadState, UnapprovedPathMode};
use bevy::camera::RenderTarget;
use bevy::log::{DEFAULT_FILTER, LogPlugin};
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache, TextureFormat, TextureUsages};
use bevy::render::settings::{Backends, RenderCreation, WgpuSettings};
use bevy::render::{RenderApp, RenderPlugin};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::render::GaussianCapture3d;
use image::RgbaImage;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The picture that the camera draws into.
#[derive(Resource, Clone)]
pub struct Offscreen {
    pub image: Handle<Image>,
    pub size: UVec2,
}

impl Offscreen {
    /// Goes on the camera.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.image.clone().into())
    }
}

/// How long assets may take to load.
const PATIENCE: Duration = Duration::from_secs(120);
/// Updates until everything shows: uploads, pipelines, and buffers that grow by what a frame before counted.
const SETTLING: usize = 3;
/// Updates that a read-back may take.
const READBACK: usize = 100;

/// `DefaultPlugins` without a window, with time standing still.
pub fn app(size: UVec2) -> App {
    let settings = WgpuSettings { backends: Some(backends()), ..default() };
    let plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        // A read-back that nobody waits for any more is no news.
        .set(LogPlugin { filter: format!("{DEFAULT_FILTER},bevy_render::gpu_readback=error"), ..default() })
        .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() })
        .set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..default()
        })
        .disable::<WinitPlugin>()
        // Main and render world take turns, so that a picture belongs to the update that made it.
        .disable::<PipelinedRenderingPlugin>();
    let mut app = App::new();
    app.add_plugins(plugins).insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    // Steps longer than Bevy's quarter of a second are wanted, too.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::MAX);
    let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    app.insert_resource(Offscreen { image, size });
    app
}

/// Without DX12 among them wgpu needs no extra dispatch to validate each indirect one.
fn backends() -> Backends {
    if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY }
}

/// What a runner does before the first update.
fn start(app: &mut App) {
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    if app.plugins_state() != PluginsState::Cleaned {
        app.finish();
        app.cleanup();
    }
}

/// Runs the app until every capture has been loaded and everything shows.
pub fn settle(app: &mut App) -> Result {
    start(app);
    let start = Instant::now();
    update(app)?;
    while !(captures_are_loaded(app)? && pipelines_are_ready(app)?) {
        if start.elapsed() > PATIENCE {
            return Err("the capture was not loaded in time".into());
        }
        std::thread::sleep(Duration::from_millis(2));
        update(app)?;
    }
    for _ in 0..SETTLING {
        update(app)?;
    }
    pipelines_are_ready(app)?;
    Ok(())
}

/// Lets `step` go by and takes the picture of that moment.
pub fn picture(app: &mut App, step: Duration) -> Result<RgbaImage> {
    settle(app)?;
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let stepped = update(app);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    stepped?;
    settle(app)?;
    let Offscreen { image, size } = app.world().resource::<Offscreen>().clone();
    let arrived = Arc::new(Mutex::new(None));
    let sink = arrived.clone();
    let store = move |event: On<ReadbackComplete>| {
        *sink.lock().unwrap_or_else(PoisonError::into_inner) = Some(event.data.clone());
    };
    let readback = app.world_mut().spawn(Readback::texture(image)).observe(store).id();
    for _ in 0..READBACK {
        update(app)?;
        let data: Option<Vec<u8>> = arrived.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(data) = data {
            app.world_mut().despawn(readback);
            return RgbaImage::from_raw(size.x, size.y, unpadded(&data, size)).ok_or("an incomplete picture".into());
        }
    }
    Err("the picture did not come back from the GPU".into())
}

/// A texture is read back in rows padded to a multiple of 256 bytes.
fn unpadded(data: &[u8], size: UVec2) -> Vec<u8> {
    let row = size.x as usize * 4;
    data.chunks(row.next_multiple_of(256)).flat_map(|padded| padded.iter().take(row).copied()).collect()
}

/// One update; what went wrong in drawing is an error.
fn update(app: &mut App) -> Result {
    app.update();
    match app.should_exit() {
        Some(_) => Err("rendering stopped; the log says why".into()),
        None => Ok(()),
    }
}

fn captures_are_loaded(app: &mut App) -> Result<bool> {
    let world = app.world_mut();
    let captures: Vec<_> = world.query::<&GaussianCapture3d>().iter(world).map(|capture| capture.0.clone()).collect();
    let server = world.resource::<AssetServer>();
    for capture in &captures {
        if let Some(LoadState::Failed(failure)) = server.get_load_state(capture.id()) {
            return Err(failure.to_string().into());
        }
    }
    let loaded = world.resource::<Assets<GaussianCapture>>();
    Ok(captures.iter().all(|capture| loaded.contains(capture.id())))
}

fn pipelines_are_ready(app: &App) -> Result<bool> {
    let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
    for pipeline in cache.pipelines() {
        if let CachedPipelineState::Err(failure) = &pipeline.state {
            return Err(format!("a pipeline failed: {failure}").into());
        }
    }
    Ok(cache.waiting_pipelines().count() == 0)
}
