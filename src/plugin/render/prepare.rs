//! Prepare: for each camera, the captures it sees and the renderer's working buffers.
//!
//! In: [`ExtractedCaptures`], Bevy's extracted cameras with what they see and their depth textures. Out: [`CaptureViews`], with
//! everything written that drawing needs. In the steady state nothing is created on the GPU.

use super::active::ActiveLists;
use super::composite::{CompositeBindings, CompositeKey, CompositePipeline};
use super::extract::{ExtractedCaptures, ExtractedViewSettings};
use super::statistics::CaptureStatistics;
use super::upload::GpuGaussianCapture;
use super::view::Lens;
use super::write_depth::{WriteDepthBindings, WriteDepthKey, WriteDepthPipeline};
use super::{CaptureViewSettings, DepthWrite};
use crate::plugin::asset::GaussianCapture;
use crate::plugin::component::GaussianCapture3d;
use crate::renderer::{Instance, OpaqueDepth, Renderer, ShaderChecks, ViewParameters, ViewRenderer};
use crate::view::{Appearance, Background, DebugView, View};
use bevy::asset::AssetId;
use bevy::camera::{Camera3d, CompositingSpace, MainPassResolutionOverride};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Query, Res, ResMut, SystemParam};
use bevy::log::{debug_span, error, error_once, warn_once};
use bevy::platform::collections::HashMap;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{CachedRenderPipelineId, PipelineCache, SpecializedRenderPipelines, TextureUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, Msaa, RenderVisibleEntities, ViewDepthTexture};
use glam::{UVec2, UVec4};

/// The renderer's pipelines; absent where this GPU cannot run them.
#[derive(Resource)]
pub struct CaptureRenderer(pub(super) Renderer);

/// State of every camera that may see captures, by its entity in the render world.
#[derive(Resource, Default)]
pub(super) struct CaptureViews(pub(super) HashMap<Entity, CaptureView>);

/// State of one camera.
pub(super) struct CaptureView {
    /// The camera's entity in the main world.
    pub(super) camera: Entity,
    pub(super) renderer: ViewRenderer,
    /// The composite into the camera's target, and what it binds.
    pub(super) composite: CachedRenderPipelineId,
    pub(super) bindings: CompositeBindings,
    /// Writing to the camera's depth buffer, if it is wanted, and what that binds.
    pub(super) write_depth: Option<CachedRenderPipelineId>,
    pub(super) depth_bindings: WriteDepthBindings,
    measured: bool,
    /// Whether it is drawn after transparent meshes even without multisampling.
    pub(super) late: bool,
    /// Frames since it last saw something.
    idle: u32,
    /// What it sees this frame; nothing is drawn where this is empty.
    drawn: Vec<Drawn>,
}

/// One capture, seen by one camera.
struct Drawn {
    entity: MainEntity,
    asset: AssetId<GaussianCapture>,
    view: View,
    appearance: Appearance,
    filtered: bool,
}

/// Frames without anything to be seen until a camera gives memory back.
const RELEASE_AFTER_IDLE_FRAMES: u32 = 120;

/// What there is to be seen.
#[derive(SystemParam)]
pub(super) struct Scene<'w> {
    extracted: Res<'w, ExtractedCaptures>,
    settings: Res<'w, ExtractedViewSettings>,
    captures: Res<'w, RenderAssets<GpuGaussianCapture>>,
    lists: Res<'w, ActiveLists>,
}

/// The pipelines that depend on a camera's target.
#[derive(SystemParam)]
pub(super) struct Pipelines<'w> {
    cache: Res<'w, PipelineCache>,
    composite: Res<'w, CompositePipeline>,
    composites: ResMut<'w, SpecializedRenderPipelines<CompositePipeline>>,
    write_depth: Res<'w, WriteDepthPipeline>,
    depth_writers: ResMut<'w, SpecializedRenderPipelines<WriteDepthPipeline>>,
}

impl CaptureView {
    fn new(device: &RenderDevice, camera: Entity, composite: CachedRenderPipelineId) -> Self {
        Self {
            camera,
            renderer: ViewRenderer::new(device.wgpu_device()),
            composite,
            bindings: CompositeBindings::default(),
            write_depth: None,
            depth_bindings: WriteDepthBindings::default(),
            measured: false,
            late: false,
            idle: 0,
            drawn: Vec::new(),
        }
    }

    /// Whether it draws anything this frame.
    pub(super) fn sees_something(&self) -> bool {
        !self.drawn.is_empty()
    }

    /// What is drawn this frame, in the renderer's terms.
    pub(super) fn instances<'a>(
        &self,
        captures: &'a RenderAssets<GpuGaussianCapture>,
        lists: &'a ActiveLists,
    ) -> Vec<Instance<'a>> {
        let instance = |drawn: &Drawn| {
            let capture = captures.get(drawn.asset)?.capture()?;
            let list = if drawn.filtered { lists.0.get(&drawn.entity) } else { None };
            Some(Instance {
                capture,
                active: list.map(|placed| &placed.list),
                view: drawn.view,
                appearance: drawn.appearance,
            })
        };
        self.drawn.iter().filter_map(instance).collect()
    }

    /// Collects what this camera sees, in the order of Bevy's list, which is always the same.
    fn collect(
        &mut self,
        lens: &Lens,
        view: &ExtractedView,
        size: UVec2,
        visible: &RenderVisibleEntities,
        scene: &Scene<'_>,
    ) {
        let camera = view.world_from_view.affine();
        let Some(visible) = visible.get::<GaussianCapture3d>() else { return };
        self.drawn.extend(visible.iter_visible().filter_map(|(_, entity)| {
            let placed = scene.extracted.0.get(entity)?;
            scene.captures.get(placed.asset)?.capture()?;
            let view = lens.view(size, placed.time, camera, placed.world_from_capture)?;
            let (asset, appearance, filtered) = (placed.asset, placed.appearance, placed.filtered);
            Some(Drawn { entity: *entity, asset, view, appearance, filtered })
        }));
    }

    /// Counts a frame in which it sees nothing. After many its memory is given back.
    fn rest(&mut self) {
        self.idle = self.idle.saturating_add(1);
        if self.idle == RELEASE_AFTER_IDLE_FRAMES {
            self.renderer.release();
            self.bindings.forget();
            self.depth_bindings.forget();
        }
    }

    fn measure(&mut self, on: bool, device: &RenderDevice, queue: &RenderQueue) {
        if self.measured != on {
            self.measured = on;
            self.renderer.measure(device.wgpu_device(), queue, on);
        }
    }
}

impl Pipelines<'_> {
    fn composite(
        &mut self,
        view: &ExtractedView,
        camera: &ExtractedCamera,
        settings: CaptureViewSettings,
    ) -> CachedRenderPipelineId {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = CompositeKey { format: view.target_format, encoded, blend_space: settings.blend_space };
        self.composites.specialize(&self.cache, &self.composite, key)
    }

    fn write_depth(&mut self, msaa: Msaa, median: bool) -> CachedRenderPipelineId {
        let key = WriteDepthKey { samples: msaa.samples(), median };
        self.depth_writers.specialize(&self.cache, &self.write_depth, key)
    }
}

/// Compiles the renderer's pipelines; shaders check their bounds in debug builds.
pub(super) fn init_renderer(mut commands: Commands, device: Res<RenderDevice>, statistics: Res<CaptureStatistics>) {
    let checks = if cfg!(debug_assertions) { ShaderChecks::On } else { ShaderChecks::Off };
    match Renderer::new(device.wgpu_device(), checks) {
        Ok(renderer) => {
            statistics.set_renderer_missing(None);
            commands.insert_resource(CaptureRenderer(renderer));
        }
        Err(failure) => {
            error!("captures are not drawn: {failure}");
            statistics.set_renderer_missing(Some(failure.to_string()));
            commands.remove_resource::<CaptureRenderer>();
        }
    }
}

/// Lets the renderer read the depth of opaque meshes.
pub(super) fn make_depth_readable(mut cameras: Query<&mut Camera3d>) {
    for mut camera in &mut cameras {
        camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
    }
}

type CameraView = (
    Entity,
    &'static ExtractedView,
    &'static ExtractedCamera,
    &'static ViewDepthTexture,
    &'static Msaa,
    &'static RenderVisibleEntities,
    Option<&'static MainPassResolutionOverride>,
);

pub(super) fn prepare_views(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    scene: Scene,
    mut pipelines: Pipelines,
    statistics: Res<CaptureStatistics>,
    mut views: ResMut<CaptureViews>,
    cameras: Query<CameraView, With<Camera3d>>,
) {
    let _span = debug_span!("gs4d/prepare").entered();
    let Some(renderer) = renderer else { return };
    let measure = statistics.is_measuring();
    views.0.retain(|&camera, _| cameras.contains(camera));
    for (entity, view, camera, depth, &msaa, visible, resolution) in &cameras {
        // Meshes may be drawn smaller than the camera says, to be scaled up later.
        let size = resolution.map_or(UVec2::new(view.viewport.z, view.viewport.w), |smaller| smaller.0);
        let main = view.retained_view_entity.main_entity;
        let settings = scene.settings.0.get(&main).copied().unwrap_or_default();
        // Before there is anything to draw: it is compiled while captures load.
        let composite = pipelines.composite(view, camera, settings);
        let state = views.0.entry(entity).or_insert_with(|| CaptureView::new(&device, main.id(), composite));
        state.composite = composite;
        state.late = settings.late;
        state.measure(measure, &device, &queue);
        state.drawn.clear();
        let Some(lens) = drawable_lens(view, camera) else { continue };
        state.collect(&lens, view, size, visible, &scene);
        if state.drawn.is_empty() {
            state.rest();
            continue;
        }
        state.idle = 0;
        let viewport = UVec4::new(view.viewport.x, view.viewport.y, size.x, size.y);
        state.bindings.set_viewport(viewport, &device, &queue);
        let instances = state.instances(&scene.captures, &scene.lists);
        let surrounded = instances.iter().any(|instance| instance.capture.has_environment());
        let opaque = opaque_depth(&lens, view, depth, msaa);
        let parameters = ViewParameters {
            // Without depth a map would hide every mesh.
            background: if surrounded && opaque.is_some() { Background::Environment } else { Background::None },
            opaque,
            blend_space: settings.blend_space,
            debug: settings.debug,
        };
        let prepared = state.renderer.prepare(device.wgpu_device(), &queue, &renderer.0, &instances, &parameters);
        if let Err(failure) = prepared {
            error_once!("captures are not drawn: {failure}");
            state.drawn.clear();
        }
        // Expected depths are divided by the captures' opacity, which a map around them and overdraw hide.
        let median = settings.depth == DepthWrite::Median || surrounded || settings.debug == DebugView::Overdraw;
        let distance = lens.distance.filter(|_| settings.depth != DepthWrite::None);
        state.write_depth = distance.map(|_| pipelines.write_depth(msaa, median));
        if let Some(distance) = distance {
            state.depth_bindings.set_distance(distance, &device, &queue);
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
    match &lens {
        None => warn_once!(
            "captures are not drawn for a camera whose projection is skewed, mirrored or not reversed in depth: use Bevy's \
             perspective or orthographic projection, or Projection::custom with a matrix like theirs"
        ),
        Some(lens) if lens.distance.is_none() => warn_once!(
            "captures are drawn over meshes, not behind them, and write no depth, for a camera with its own near clip plane: \
             leave PerspectiveProjection::near_clip_plane as it is, or draw captures with another camera"
        ),
        Some(_) => {}
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
    // Another plugin may have made the texture.
    if !depth.texture.usage().contains(TextureUsages::TEXTURE_BINDING) {
        warn_once!(
            "captures are drawn over meshes: a camera's depth texture cannot be read; add TEXTURE_BINDING to it"
        );
        return None;
    }
    Some(OpaqueDepth {
        texture: depth.view(),
        samples: msaa.samples(),
        origin: UVec2::new(view.viewport.x, view.viewport.y),
        distance: lens.distance?.to_array(),
    })
}
