//! Prepare: collects the captures that each camera sees and prepares the renderer's working buffers.
//!
//! In: [`ExtractedCaptures`], Bevy's extracted cameras with their visible entities and depth textures. Out: [`CaptureViews`], with all
//! inputs of drawing written to the GPU. In the steady state no GPU object is created.

use super::active::ActiveLists;
use super::capture_views::{CaptureView, CaptureViews, Drawn, group_copies};
use super::composite::{CompositeKey, CompositePipeline};
use super::depth_readers::DepthReaders;
use super::detail::CaptureLevels;
use super::extract::{ExtractedCaptures, ExtractedViewSettings};
use super::fault::CameraFault;
use super::previous::{CameraPose, PreviousCaptures};
use super::publish::publish_statistics;
use super::renderer::CaptureRenderer;
use super::settings::{CaptureViewSettings, DepthWrite};
use super::shade_requests::ShadeRequests;
use super::statistics::CaptureStatistics;
use super::upload::GpuGaussianCapture;
use super::view::CameraLens;
use super::write_depth::{WriteDepthKey, WriteDepthPipeline};
use super::write_motion::{WriteMotionKey, WriteMotionPipeline};
use crate::plugin::component::GaussianCapture3d;
use crate::renderer::{ColorPrecision, OpaqueDepth, ViewParameters};
use crate::view::{Background, DebugView, View};
use bevy::camera::{Camera3d, CompositingSpace, MainPassResolutionOverride};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::system::{Query, Res, ResMut, SystemParam};
use bevy::log::{debug_span, error_once, warn_once};
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{CachedRenderPipelineId, PipelineCache, SpecializedRenderPipelines, TextureUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::{ExtractedView, Msaa, RenderVisibleEntities, ViewDepthTexture};
use glam::{UVec2, UVec4};

/// The captures of this frame, and the settings that decide how they are drawn.
#[derive(SystemParam)]
pub(super) struct Scene<'w> {
    extracted: Res<'w, ExtractedCaptures>,
    settings: Res<'w, ExtractedViewSettings>,
    shade: Res<'w, ShadeRequests>,
    captures: Res<'w, RenderAssets<GpuGaussianCapture>>,
    lists: Res<'w, ActiveLists>,
    previous: ResMut<'w, PreviousCaptures>,
    depth_readers: Res<'w, DepthReaders>,
    levels: Res<'w, CaptureLevels>,
}

/// The pipelines that depend on a camera's target.
#[derive(SystemParam)]
pub(super) struct Pipelines<'w> {
    cache: Res<'w, PipelineCache>,
    composite: Res<'w, CompositePipeline>,
    composites: ResMut<'w, SpecializedRenderPipelines<CompositePipeline>>,
    write_depth: Res<'w, WriteDepthPipeline>,
    depth_writers: ResMut<'w, SpecializedRenderPipelines<WriteDepthPipeline>>,
    write_motion: Res<'w, WriteMotionPipeline>,
    motion_writers: ResMut<'w, SpecializedRenderPipelines<WriteMotionPipeline>>,
}

impl Scene<'_> {
    /// Appends the captures that a camera sees to `drawn`, in the order of Bevy's list, with copies of one level grouped.
    fn collect(
        &self,
        viewer: Entity,
        lens: &CameraLens,
        view: &ExtractedView,
        size: UVec2,
        visible: &RenderVisibleEntities,
        drawn: &mut Vec<Drawn>,
    ) {
        let camera = view.world_from_view.affine();
        let Some(visible) = visible.get::<GaussianCapture3d>() else { return };
        drawn.extend(visible.iter_visible().filter_map(|(_, entity)| {
            let placed = self.extracted.0.get(entity).filter(|placed| !placed.is_faded_out())?;
            let capture = self.captures.get(placed.asset)?;
            let time = capture.time_at(placed.seconds)?;
            let level = self.levels.of(viewer, *entity);
            let trained_pixel = capture.antialias_pixel(level, placed.antialias);
            let view = lens.view(size, time, camera, placed.world_from_capture)?.antialiased(trained_pixel);
            let (asset, appearance, filtered) = (placed.asset, placed.appearance, placed.filtered);
            Some(Drawn { entity: *entity, asset, view, appearance, filtered, level })
        }));
        group_copies(drawn);
    }

    /// Returns the view of each drawn capture in the previous frame, when the camera had this pose.
    fn previous_views(&self, drawn: &[Drawn], pose: &CameraPose) -> Vec<View> {
        let before = |one: &Drawn| {
            let Some(placed) = self.extracted.0.get(&one.entity) else { return one.view };
            let time_at = |seconds| self.captures.get(one.asset)?.time_at(seconds);
            self.previous.view(&one.entity, placed, &one.view, pose, time_at)
        };
        drawn.iter().map(before).collect()
    }
}

impl Pipelines<'_> {
    /// Returns the composite pipeline for a camera's target, the one for its samples if it is multisampled, and whether they blend in
    /// place.
    fn composite(
        &mut self,
        view: &ExtractedView,
        camera: &ExtractedCamera,
        msaa: Msaa,
        settings: CaptureViewSettings,
    ) -> (CachedRenderPipelineId, Option<CachedRenderPipelineId>, bool) {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = CompositeKey { format: view.target_format, encoded, blend_space: settings.blend_space, samples: 1 };
        let composite = self.composites.specialize(&self.cache, &self.composite, key);
        let multisampled = (msaa != Msaa::Off).then(|| CompositeKey { samples: msaa.samples(), ..key });
        let composite_samples = multisampled.map(|key| self.composites.specialize(&self.cache, &self.composite, key));
        (composite, composite_samples, key.blends_in_place())
    }

    fn write_depth(&mut self, msaa: Msaa, median: bool) -> CachedRenderPipelineId {
        let key = WriteDepthKey { samples: msaa.samples(), median };
        self.depth_writers.specialize(&self.cache, &self.write_depth, key)
    }

    fn write_motion(&mut self, msaa: Msaa, median: bool, depth: bool) -> CachedRenderPipelineId {
        let key = WriteMotionKey { samples: msaa.samples(), median, depth };
        self.motion_writers.specialize(&self.cache, &self.write_motion, key)
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
    Option<&'static ViewPrepassTextures>,
);

/// Prepares the view of every camera: the captures it sees, its pipelines and its working buffers.
pub(super) fn prepare_views(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    mut scene: Scene,
    mut pipelines: Pipelines,
    statistics: Res<CaptureStatistics>,
    mut views: ResMut<CaptureViews>,
    cameras: Query<CameraView, With<Camera3d>>,
) {
    let _span = debug_span!("gs4d/prepare").entered();
    let Some(renderer) = renderer else { return publish_statistics(&statistics, &views, &scene.captures) };
    let measure = statistics.is_measuring();
    views.0.retain(|&camera, _| cameras.contains(camera));
    for (entity, view, camera, depth, &msaa, visible, resolution, prepass) in &cameras {
        // Meshes may be drawn at a lower resolution than the camera's, to be scaled up later.
        let size = resolution.map_or(UVec2::new(view.viewport.z, view.viewport.w), |smaller| smaller.0);
        let main = view.retained_view_entity.main_entity;
        let mut settings = scene.settings.0.get(&main).copied().unwrap_or_default();
        settings.depth = scene.depth_readers.resolve(&main, settings.depth);
        // Requested even without captures, so that the pipeline is compiled while captures load.
        let (composite, composite_samples, in_place) = pipelines.composite(view, camera, msaa, settings);
        let state =
            views.0.entry(entity).or_insert_with(|| CaptureView::new(&device, &renderer.0, main.id(), composite));
        (state.composite, state.composite_samples, state.in_place) = (composite, composite_samples, in_place);
        state.set_design(&renderer.0, settings.design);
        state.measure(measure, &device, &queue, &renderer.0);
        state.drawn.clear();
        (state.is_shaded, state.shaded) = (false, None);
        let lens = drawable_lens(view, camera);
        if let Some(lens) = &lens {
            scene.collect(entity, lens, view, size, visible, &mut state.drawn);
        }
        state.count_idle_frames();
        let pose = lens.map(|lens| CameraPose { lens, world_from_camera: view.world_from_view.affine() });
        let previous_pose = std::mem::replace(&mut state.pose, pose).or(pose);
        let Some(lens) = lens.filter(|_| state.sees_something()) else { continue };
        // Debug views do not show light, so they are not shaded.
        state.is_shaded = settings.debug == DebugView::Color && scene.shade.want(main, &state.drawn);
        let viewport = UVec4::new(view.viewport.x, view.viewport.y, size.x, size.y);
        state.bindings.set_viewport(viewport, &device, &queue, renderer.0.work());
        let instances = state.instances(&scene.captures, &scene.lists);
        let surrounded = instances.iter().any(|instance| instance.capture.has_environment());
        let opaque = opaque_depth(&lens, view, depth, msaa);
        let motion = prepass.filter(|prepass| prepass.motion_vectors.is_some() && lens.distance.is_some());
        let has_motion = motion.is_some();
        let previous_pose = previous_pose.filter(|_| has_motion);
        let previous = previous_pose.map(|pose| scene.previous_views(&state.drawn, &pose));
        let parameters = ViewParameters {
            // Without depth, an environment map would hide every mesh.
            background: if surrounded && opaque.is_some() { Background::Environment } else { Background::None },
            opaque,
            blend_space: settings.blend_space,
            debug: settings.debug,
            depths: settings.depth != DepthWrite::None || state.is_shaded || has_motion,
            // Bevy's own targets have no higher precision.
            precision: ColorPrecision::Half,
            previous: previous.as_deref(),
        };
        let prepared = state.renderer.prepare(device.wgpu_device(), &queue, &renderer.0, &instances, &parameters);
        if let Err(failure) = prepared {
            error_once!("captures are not drawn: {failure}");
            state.drawn.clear();
        } else if state.renderer.is_short_of_room() {
            warn_once!(
                "captures are drawn whole but slowly: a camera has more pairs of splats and tiles than fit on this GPU; draw \
                 fewer or smaller Gaussians, or a smaller picture"
            );
        }
        let median = writes_median(&settings, surrounded);
        let written = lens.distance.filter(|_| median.is_some() || has_motion);
        state.write_depth = written.and(median).map(|median| pipelines.write_depth(msaa, median));
        state.write_motion =
            motion.map(|prepass| pipelines.write_motion(msaa, median.unwrap_or(false), prepass.depth.is_some()));
        if let Some(distance) = written {
            state.depth_bindings.set_lens(distance, 1, &device, &queue, renderer.0.work());
        }
    }
    scene.previous.keep(&scene.extracted);
    publish_statistics(&statistics, &views, &scene.captures);
}

/// Returns whether the depth that a camera requests is the median depth; `None` if it requests no depth.
fn writes_median(settings: &CaptureViewSettings, surrounded: bool) -> Option<bool> {
    match settings.depth {
        // `Auto` has been resolved by [`DepthReaders`].
        DepthWrite::Auto | DepthWrite::None => None,
        // Expected depths are divided by the captures' opacity, which an environment map and some debug views hide.
        DepthWrite::Expected => Some(surrounded || hides_opacity(settings.debug)),
        DepthWrite::Median => Some(true),
    }
}

/// Returns whether a debug view replaces the opacity of captures.
fn hides_opacity(debug: DebugView) -> bool {
    match debug {
        DebugView::Overdraw => true,
        DebugView::Color | DebugView::Depth | DebugView::Active | DebugView::Lifespan | DebugView::Velocity => false,
    }
}

/// Returns the lens of a camera; `None` if captures cannot be drawn for it. Each fault is logged once.
fn drawable_lens(view: &ExtractedView, camera: &ExtractedCamera) -> Option<CameraLens> {
    let fault = CameraFault::of(&view.clip_from_view, camera.compositing_space);
    // `warn_once!` logs once per statement, so each fault has its own.
    match fault {
        Some(CameraFault::Oklab) => warn_once!("{}", CameraFault::Oklab),
        Some(CameraFault::Projection) => warn_once!("{}", CameraFault::Projection),
        Some(CameraFault::NearPlane) => warn_once!("{}", CameraFault::NearPlane),
        None => {}
    }
    CameraLens::of(&view.clip_from_view).filter(|_| fault != Some(CameraFault::Oklab))
}

/// Returns the depth texture of opaque meshes; `None` if it cannot be read.
fn opaque_depth<'a>(
    lens: &CameraLens,
    view: &ExtractedView,
    depth: &'a ViewDepthTexture,
    msaa: Msaa,
) -> Option<OpaqueDepth<'a>> {
    // Another plugin may have created the texture.
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
