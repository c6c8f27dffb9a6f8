//! The app without a window.
//!
//! In: the size of a picture. Out: an app with Bevy's default plugins that draws into a picture, and in which time stands still.

use super::window::add_window;
use crate::renderer::GpuContext;
use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, PluginGroupBuilder};
use bevy::asset::{AssetPlugin, Assets, Handle, UnapprovedPathMode};
use bevy::camera::RenderTarget;
use bevy::ecs::resource::Resource;
use bevy::image::Image;
use bevy::log::{DEFAULT_FILTER, LogPlugin};
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::render::settings::{Backends, RenderCreation, WgpuSettings};
use bevy::time::{Time, TimeUpdateStrategy, Virtual};
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use glam::UVec2;
use std::sync::OnceLock;
use std::time::Duration;

/// A picture that cameras draw into. [`app`] inserts one as a resource, for all cameras whose target is the primary window.
#[derive(Resource, Debug, Clone)]
pub struct Offscreen {
    /// The picture on the GPU: RGBA, 8 bits each, sRGB-encoded; or in [HDR](Self::hdr).
    pub image: Handle<Image>,
    /// Its width and height in pixels.
    pub size: UVec2,
}

impl Offscreen {
    /// Creates another picture, for apps that draw into more than one; [`read`](super::read) returns it. `size` is in
    /// pixels; 0 counts as 1.
    pub fn new(images: &mut Assets<Image>, size: UVec2) -> Self {
        Self::of(images, size, TextureFormat::Rgba8UnormSrgb)
    }

    /// Creates a picture in HDR: RGBA in linear light, 16 bits of float each, as bright as the camera makes it;
    /// [`read_hdr`](super::read_hdr) returns it. Cameras that draw into it need [`Hdr`](bevy::camera::Hdr). `size` as in
    /// [`new`](Self::new).
    ///
    /// # Examples
    ///
    /// ```no_run
    /// # use bevy::camera::Hdr;
    /// # use bevy::prelude::*;
    /// # use bevy_gs4d::testing::{self, Offscreen};
    /// let mut app = testing::app(UVec2::new(320, 240));
    /// let bright = Offscreen::hdr(&mut app.world_mut().resource_mut::<Assets<Image>>(), UVec2::new(320, 240));
    /// app.world_mut().spawn((Camera3d::default(), Hdr, bright.target()));
    /// testing::settle(&mut app)?;
    /// let picture = testing::read_hdr(&mut app, &bright)?;
    /// assert!(picture.pixels().all(|pixel| pixel.0[0].is_finite()), "no light is infinite");
    /// # Ok::<(), testing::TestingError>(())
    /// ```
    pub fn hdr(images: &mut Assets<Image>, size: UVec2) -> Self {
        Self::of(images, size, TextureFormat::Rgba16Float)
    }

    fn of(images: &mut Assets<Image>, size: UVec2, format: TextureFormat) -> Self {
        let size = size.max(UVec2::ONE);
        let mut image = Image::new_target_texture(size.x, size.y, format, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        Self { image: images.add(image), size }
    }

    /// Returns the target for cameras, beside their `Camera3d`. Cameras of the primary window get that of the app's own picture
    /// automatically.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.image.clone().into())
    }
}

/// Returns whether this machine has a GPU adapter; a software driver counts.
pub fn has_gpu() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    *FOUND.get_or_init(|| !GpuContext::adapters().is_empty())
}

/// Returns an app with Bevy's `DefaultPlugins`, without a window, with time standing still, and with an [`Offscreen`] of `size` pixels.
///
/// Add plugins, resources and systems to it as to any app; [`picture`](super::picture) runs it. Cameras whose target is the primary window
/// draw into the picture, one over the other in their order: a user interface, or a `Camera2d` over the scene, is in it, too. The window
/// is an entity that no display shows. Without a GPU nothing is drawn and everything else works.
pub fn app(size: UVec2) -> App {
    app_with(size, |plugins| plugins)
}

/// Like [`app`], for games that set or disable some of the `DefaultPlugins`: `adjust` gets the group as [`app`] would add it.
pub fn app_with(size: UVec2, adjust: impl FnOnce(PluginGroupBuilder) -> PluginGroupBuilder) -> App {
    let settings = WgpuSettings { backends: has_gpu().then(backends), ..WgpuSettings::default() };
    let plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..WindowPlugin::default() })
        // Bevy logs a read-back that is abandoned as a warning.
        .set(LogPlugin { filter: format!("{DEFAULT_FILTER},bevy_render::gpu_readback=error"), ..LogPlugin::default() })
        .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..AssetPlugin::default() })
        .set(RenderPlugin {
            render_creation: RenderCreation::Automatic(Box::new(settings)),
            synchronous_pipeline_compilation: true,
            ..RenderPlugin::default()
        })
        .disable::<WinitPlugin>()
        // Without pipelining, a picture belongs to the update that drew it.
        .disable::<PipelinedRenderingPlugin>();
    let mut app = App::new();
    app.add_plugins(adjust(plugins)).insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    // Bevy's default would cut steps to a quarter of a second.
    app.world_mut().get_resource_or_init::<Time<Virtual>>().set_max_delta(Duration::MAX);
    let offscreen = Offscreen::new(&mut app.world_mut().get_resource_or_init::<Assets<Image>>(), size);
    add_window(&mut app, &offscreen);
    app.insert_resource(offscreen);
    app
}

/// Returns the backends to use. Without DX12 among them, wgpu needs no extra dispatch to validate each indirect one.
fn backends() -> Backends {
    if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY }
}
