//! Prepare: for each camera, the captures it sees and the renderer's working buffers.
//!
//! In: [`ExtractedCaptures`], Bevy's extracted cameras and their depth textures. Out: [`CaptureViews`], with everything written that
//! drawing needs. In the steady state nothing is created on the GPU.

use super::composite::{CompositeBindings, CompositeKey, CompositePipeline};
use super::extract::ExtractedCaptures;
use super::upload::GpuGaussianCapture;
use super::view::Lens;
use crate::asset::GaussianCapture;
use crate::frame::Background;
use crate::gaussian::View;
use crate::gpu::{Instance, OpaqueDepth, Renderer, ShaderChecks, ViewRenderer};
use bevy::asset::AssetId;
use bevy::camera::{Camera3d, CompositingSpace};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Query, Res, ResMut};
use bevy::log::{error, error_once, warn_once};
use bevy::platform::collections::HashMap;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{CachedRenderPipelineId, PipelineCache, SpecializedRenderPipelines, TextureUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::{ExtractedView, Msaa, ViewDepthTexture};
use glam::UVec2;

/// The renderer's pipelines; absent where this GPU cannot run them.
#[derive(Resource)]
pub struct CaptureRenderer(pub(super) Renderer);

/// State of every camera that may see captures, by its entity in the render world.
#[derive(Resource, Default)]
pub(super) struct CaptureViews(pub(super) HashMap<Entity, CaptureView>);

/// State of one camera.
pub(super) struct CaptureView {
    pub(super) renderer: ViewRenderer,
    pub(super) bindings: CompositeBindings,
    /// The composite pipeline for the camera's target.
    pub(super) pipeline: CachedRenderPipelineId,
    /// What it sees this frame; nothing is drawn where this is empty.
    drawn: Vec<Drawn>,
}

/// One capture, seen by one camera.
struct Drawn {
    asset: AssetId<GaussianCapture>,
    view: View,
    filtered: bool,
}

impl CaptureView {
    /// What is drawn this frame, in the renderer's terms.
    pub(super) fn instances<'a>(&self, captures: &'a RenderAssets<GpuGaussianCapture>) -> Vec<Instance<'a>> {
        let instance = |drawn: &Drawn| {
            let capture = captures.get(drawn.asset)?.capture()?;
            Some(Instance { capture, view: drawn.view, filtered: drawn.filtered })
        };
        self.drawn.iter().filter_map(instance).collect()
    }

    /// Collects what this camera sees.
    fn look(
        &mut self,
        lens: &Lens,
        view: &ExtractedView,
        extracted: &ExtractedCaptures,
        captures: &RenderAssets<GpuGaussianCapture>,
    ) {
        let size = UVec2::new(view.viewport.z, view.viewport.w);
        let camera = view.world_from_view.affine();
        let is_uploaded =
            |asset: AssetId<GaussianCapture>| captures.get(asset).is_some_and(|capture| capture.capture().is_some());
        self.drawn.extend(extracted.0.iter().filter(|capture| is_uploaded(capture.asset)).filter_map(|capture| {
            let view = lens.view(size, capture.time, camera, capture.world_from_capture)?;
            Some(Drawn { asset: capture.asset, view, filtered: capture.filtered })
        }));
    }
}

/// Compiles the renderer's pipelines; shaders check their bounds in debug builds.
pub(super) fn init_renderer(mut commands: Commands, device: Res<RenderDevice>) {
    let checks = if cfg!(debug_assertions) { ShaderChecks::On } else { ShaderChecks::Off };
    match Renderer::new(device.wgpu_device(), checks) {
        Ok(renderer) => commands.insert_resource(CaptureRenderer(renderer)),
        Err(failure) => {
            error!("captures are not drawn: {failure}");
            commands.remove_resource::<CaptureRenderer>();
        }
    }
}

/// Lets the renderer read the depth of opaque meshes.
pub(super) fn make_depth_readable(mut cameras: Query<(&mut Camera3d, &Msaa)>) {
    for (mut camera, msaa) in &mut cameras {
        if *msaa == Msaa::Off {
            camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
        }
    }
}

type CameraView = (Entity, &'static ExtractedView, &'static ExtractedCamera, &'static ViewDepthTexture, &'static Msaa);

pub(super) fn prepare_views(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    extracted: Res<ExtractedCaptures>,
    captures: Res<RenderAssets<GpuGaussianCapture>>,
    composite: Res<CompositePipeline>,
    pipelines: Res<PipelineCache>,
    mut specialized: ResMut<SpecializedRenderPipelines<CompositePipeline>>,
    mut views: ResMut<CaptureViews>,
    cameras: Query<CameraView, With<Camera3d>>,
) {
    let Some(renderer) = renderer else { return };
    views.0.retain(|&camera, _| cameras.contains(camera));
    for (entity, view, camera, depth, &msaa) in &cameras {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = CompositeKey { format: view.target_format, encoded };
        // Before there is anything to draw: it is compiled while captures load.
        let pipeline = specialized.specialize(&pipelines, &composite, key);
        let state = views.0.entry(entity).or_insert_with(|| CaptureView {
            renderer: ViewRenderer::new(device.wgpu_device()),
            bindings: CompositeBindings::default(),
            pipeline,
            drawn: Vec::new(),
        });
        state.pipeline = pipeline;
        state.drawn.clear();
        let Some(lens) = drawable_lens(view, camera) else { continue };
        state.look(&lens, view, &extracted, &captures);
        if state.drawn.is_empty() {
            continue;
        }
        state.bindings.set_viewport(view.viewport, &device, &queue);
        let opaque = opaque_depth(&lens, view, depth, msaa);
        let instances = state.instances(&captures);
        let surrounded = instances.iter().any(|instance| instance.capture.has_environment());
        let background = if surrounded { Background::Environment } else { Background::None };
        let prepared =
            state.renderer.prepare(device.wgpu_device(), &queue, &renderer.0, &instances, background, opaque);
        if let Err(failure) = prepared {
            error_once!("captures are not drawn: {failure}");
            state.drawn.clear();
        }
    }
}

/// The lens of a camera that captures can be drawn for; others are named once.
fn drawable_lens(view: &ExtractedView, camera: &ExtractedCamera) -> Option<Lens> {
    if camera.compositing_space == Some(CompositingSpace::Oklab) {
        warn_once!("captures are not drawn for a camera with CompositingSpace::Oklab: use Srgb or Linear");
        return None;
    }
    let lens = Lens::of(&view.clip_from_view);
    if lens.is_none() {
        warn_once!("captures are drawn for perspective cameras only, not for orthographic, skewed or mirrored ones");
    }
    lens
}

/// The depth of opaque meshes, where it can be read.
fn opaque_depth<'a>(
    lens: &Lens,
    view: &ExtractedView,
    depth: &'a ViewDepthTexture,
    msaa: Msaa,
) -> Option<OpaqueDepth<'a>> {
    if msaa != Msaa::Off {
        warn_once!("captures are drawn over meshes, not behind them, for a multisampled camera: add Msaa::Off to it");
        return None;
    }
    let Some(near) = lens.near else {
        warn_once!("captures are drawn over meshes, not behind them, for a camera with its own near clip plane");
        return None;
    };
    // Another camera on the same target may have made the texture without it.
    if !depth.texture.usage().contains(TextureUsages::TEXTURE_BINDING) {
        return None;
    }
    Some(OpaqueDepth { texture: depth.view(), origin: UVec2::new(view.viewport.x, view.viewport.y), near })
}
