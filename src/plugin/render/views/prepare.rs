//! Prepare: collects the captures that each camera sees and prepares the renderer's working buffers.
//!
//! In: [`ExtractedCaptures`], [`CaptureCut`], Bevy's extracted cameras with their visible entities and depth textures. Out:
//! [`CaptureViews`], with all inputs of drawing written to the GPU. In the steady state no GPU object is created.
//!
//! Errors of the GPU are caught, view by view. If there is no room for the captures that a camera sees, it draws the
//! captures that it has drawn before, and tries the others again some frames later.

use super::capture_views::{CaptureView, CaptureViews, Drawn, group_copies};
use super::fault::CameraFault;
use super::publish::publish_statistics;
use super::shade_requests::ShadeRequests;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::render::captures::active::ActiveLists;
use crate::plugin::render::captures::back_off::BackOff;
use crate::plugin::render::captures::budget::CaptureCut;
use crate::plugin::render::captures::detail::CaptureLevels;
use crate::plugin::render::captures::extract::{ExtractedCaptures, ExtractedViewSettings};
use crate::plugin::render::captures::previous::{CameraPose, PreviousCaptures};
use crate::plugin::render::captures::upload::GpuGaussianCapture;
use crate::plugin::render::captures::view::CameraLens;
use crate::plugin::render::logged::{error_once_each, warn_once_each};
use crate::plugin::render::renderer::CaptureRenderer;
use crate::plugin::render::settings::{CaptureViewSettings, DepthWrite};
use crate::plugin::render::statistics::CaptureStatistics;
use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
use crate::plugin::render::targets::composite::{CompositeKey, CompositePipeline};
use crate::plugin::render::targets::depth_readers::DepthReaders;
use crate::plugin::render::targets::write_depth::{WriteDepthKey, WriteDepthPipeline, WrittenDepth};
use crate::plugin::render::targets::write_motion::{WriteMotionKey, WriteMotionPipeline};
use crate::renderer::device::memory::{catch, catch_known};
use crate::renderer::{ColorPrecision, GpuError, Measured, OpaqueDepth, ViewParameters};
use crate::view::{Appearance, Background, DebugView, View};
use bevy::camera::{Camera3d, CompositingSpace, MainPassResolutionOverride};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::entity::{Entities, Entity};
use bevy::ecs::query::{ROQueryItem, With};
use bevy::ecs::system::{Query, Res, ResMut, SystemParam};
use bevy::log::debug_span;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{CachedRenderPipelineId, PipelineCache, TextureUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::{ExtractedView, Msaa, RenderVisibleEntities, ViewDepthTexture};
use glam::{UVec2, UVec4};

/// The captures of this frame, and the settings that decide how they are drawn.
#[derive(SystemParam)]
pub(in crate::plugin::render) struct Scene<'w> {
    extracted: Res<'w, ExtractedCaptures>,
    settings: Res<'w, ExtractedViewSettings>,
    shade: Res<'w, ShadeRequests>,
    captures: Res<'w, RenderAssets<GpuGaussianCapture>>,
    lists: Res<'w, ActiveLists>,
    previous: ResMut<'w, PreviousCaptures>,
    depth_readers: Res<'w, DepthReaders>,
    levels: Res<'w, CaptureLevels>,
    cut: Res<'w, CaptureCut>,
}

/// The pipelines that depend on a camera's target.
#[derive(SystemParam)]
pub(in crate::plugin::render) struct Pipelines<'w> {
    device: Res<'w, RenderDevice>,
    cache: Res<'w, PipelineCache>,
    composite: Res<'w, CompositePipeline>,
    composites: ResMut<'w, CheckedPipelines<CompositePipeline>>,
    write_depth: Res<'w, WriteDepthPipeline>,
    depth_writers: ResMut<'w, CheckedPipelines<WriteDepthPipeline>>,
    write_motion: Res<'w, WriteMotionPipeline>,
    motion_writers: ResMut<'w, CheckedPipelines<WriteMotionPipeline>>,
}

impl Scene<'_> {
    /// Appends the captures that a camera sees to `drawn`, in the order of Bevy's list except for [`group_copies`].
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
            let optics = capture.optics(level, placed.antialias)?;
            let view = lens.view(size, time, camera, placed.world_from_capture)?.with_optics(optics);
            let thinning = self.cut.seen(&view, &capture.thinned(level)?, placed.priority);
            let (asset, appearance) = (placed.asset, Appearance { thinning, ..placed.appearance });
            let filtered = placed.filtered;
            Some(Drawn { entity: *entity, asset, view, appearance, filtered, level })
        }));
        group_copies(drawn);
    }

    /// Returns the view of each drawn capture in the previous frame, when the camera had this pose.
    fn previous_views(&self, drawn: &[Drawn], pose: &CameraPose) -> Vec<View> {
        let before = |one: &Drawn| {
            let capture = self.captures.get(one.asset);
            let optics = capture.and_then(|capture| capture.optics(one.level, false));
            let Some((placed, optics)) = self.extracted.0.get(&one.entity).zip(optics) else { return one.view };
            let time_at = |seconds| capture?.time_at(seconds);
            self.previous.view(&one.entity, placed, &one.view, pose, optics, time_at)
        };
        drawn.iter().map(before).collect()
    }
}

impl Pipelines<'_> {
    /// Returns the composite pipeline for a camera's target, the one for its samples if it is multisampled, and whether
    /// they blend in place. There is no pipeline if the GPU refuses one of them.
    fn composite(
        &mut self,
        view: &ExtractedView,
        camera: &ExtractedCamera,
        msaa: Msaa,
        settings: CaptureViewSettings,
    ) -> (Option<CachedRenderPipelineId>, Option<CachedRenderPipelineId>, bool) {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = CompositeKey { format: view.target_format, encoded, blend_space: settings.blend_space, samples: 1 };
        let mut specialize = |key| self.composites.specialize(&self.device, &self.cache, &self.composite, key);
        let composite = specialize(key);
        if msaa == Msaa::Off {
            return (composite, None, key.blends_in_place());
        }
        let composite_samples = specialize(CompositeKey { samples: msaa.samples(), ..key });
        (composite.filter(|_| composite_samples.is_some()), composite_samples, key.blends_in_place())
    }

    fn write_depth(&mut self, msaa: Msaa, median: bool) -> Option<CachedRenderPipelineId> {
        let depth = if median { WrittenDepth::Median } else { WrittenDepth::Expected };
        let key = WriteDepthKey { samples: msaa.samples(), depth };
        self.depth_writers.specialize(&self.device, &self.cache, &self.write_depth, key)
    }

    fn write_motion(&mut self, msaa: Msaa, median: bool, depth: bool) -> Option<CachedRenderPipelineId> {
        let key = WriteMotionKey { samples: msaa.samples(), median, depth };
        self.motion_writers.specialize(&self.device, &self.cache, &self.write_motion, key)
    }
}

/// Lets the renderer read the depth of opaque meshes.
pub(in crate::plugin::render) fn make_depth_readable(mut cameras: Query<&mut Camera3d>) {
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

type CameraItem<'a> = ROQueryItem<'a, 'a, CameraView>;

/// Prepares the view of every camera: the captures it sees, its pipelines and its working buffers.
pub(in crate::plugin::render) fn prepare_views(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    mut scene: Scene,
    mut pipelines: Pipelines,
    statistics: Res<CaptureStatistics>,
    mut views: ResMut<CaptureViews>,
    mut back_off: ResMut<BackOff<Entity>>,
    cameras: Query<CameraView, With<Camera3d>>,
    entities: &Entities,
) {
    let _span = debug_span!("gs4d/prepare").entered();
    let Some(renderer) = renderer else { return publish_statistics(&statistics, &views, &scene.captures) };
    back_off.count_frame();
    views.0.retain(|&camera, _| entities.contains_spawned(camera));
    for (_, view) in views.0.iter_mut().filter(|(camera, _)| !cameras.contains(**camera)) {
        view.pass_over();
    }
    let mut preparation = Preparation {
        device: &device,
        queue: &queue,
        renderer: &renderer,
        scene: &scene,
        pipelines: &mut pipelines,
        measured: statistics.measured(),
    };
    for camera in &cameras {
        let entity = camera.0;
        // Requested even without captures, so that the pipeline is compiled while captures load.
        let composites = preparation.composites(&camera);
        if back_off.contains(&entity) {
            continue;
        }
        let main = camera.1.retained_view_entity.main_entity.id();
        let known = views
            .0
            .remove(&entity)
            .map_or_else(|| catch_known(device.wgpu_device(), 0, || CaptureView::new(&device, &renderer.0, main)), Ok);
        let prepared = known.and_then(|mut state| {
            (state.composite, state.composite_samples, state.in_place) = composites;
            preparation.prepare(&mut state, &camera).map(|()| state)
        });
        match prepared {
            Ok(state) => {
                views.0.insert(entity, state);
            }
            // Objects of the view are invalid, so it is dropped.
            Err(failure) => {
                error_once_each(&format!("captures are not drawn for camera {main}: {failure}"));
                back_off.begin(entity);
            }
        }
    }
    scene.previous.keep(&scene.extracted);
    publish_statistics(&statistics, &views, &scene.captures);
}

/// The resources of preparing the view of one camera.
struct Preparation<'a, 's, 'p> {
    device: &'a RenderDevice,
    queue: &'a RenderQueue,
    renderer: &'a CaptureRenderer,
    scene: &'a Scene<'s>,
    pipelines: &'a mut Pipelines<'p>,
    measured: Measured,
}

impl Preparation<'_, '_, '_> {
    /// Returns the settings of a camera, with the depth that it writes.
    fn settings(&self, view: &ExtractedView) -> CaptureViewSettings {
        let main = view.retained_view_entity.main_entity;
        let settings = self.scene.settings.0.get(&main).copied().unwrap_or_default();
        let depth = self.scene.depth_readers.resolve(&main, settings.depth);
        CaptureViewSettings { depth, ..settings }
    }

    /// Returns the pipelines of the composite, as [`Pipelines::composite`] does.
    fn composites(
        &mut self,
        &(_, view, camera, _, &msaa, ..): &CameraItem<'_>,
    ) -> (Option<CachedRenderPipelineId>, Option<CachedRenderPipelineId>, bool) {
        let settings = self.settings(view);
        self.pipelines.composite(view, camera, msaa, settings)
    }

    /// Prepares the captures that a camera sees. If there is no room for all of them, prepares the captures drawn
    /// before. Nothing is drawn while the camera's settings do not allow it, or there is no room for any of them.
    ///
    /// # Errors
    /// When the GPU refuses an object, or has no memory for it. The view must be dropped.
    fn prepare(&mut self, state: &mut CaptureView, camera: &CameraItem<'_>) -> Result<(), GpuError> {
        if let Some(pending) = &mut state.pending {
            match pending.poll() {
                None => {
                    state.drawn.clear();
                    return Ok(());
                }
                Some(result) => {
                    state.pending = None;
                    result?;
                }
            }
        }
        let pose = self.collect(state, camera);
        let previous = std::mem::replace(&mut state.pose, pose).or(pose);
        let (Some(pose), Some(previous)) = (pose, previous) else { return Ok(()) };
        if state.composite.is_none() {
            state.drawn.clear();
        }
        if !state.sees_something() {
            return Ok(());
        }
        let poses = [pose, previous];
        match self.prepare_drawn(state, camera, poses) {
            Ok(()) => state.note_room(),
            Err(failure) if state.leave_out_new() => {
                error_once_each(&format!(
                    "captures that came into view of camera {} are not drawn: {failure}. Captures drawn before are \
                     still drawn",
                    state.camera
                ));
                if failure.is_of_device() {
                    state.release();
                }
                self.prepare_drawn(state, camera, poses)?;
            }
            Err(failure) if failure.is_of_device() => return Err(failure),
            Err(failure) => {
                error_once_each(&format!("captures are not drawn for camera {}: {failure}", state.camera));
                state.drawn.clear();
            }
        }
        Ok(())
    }

    /// Collects the captures that a camera sees. Returns its pose; `None` if captures cannot be drawn for it.
    fn collect(&self, state: &mut CaptureView, camera: &CameraItem<'_>) -> Option<CameraPose> {
        let &(entity, view, extracted, .., visible, _, _) = camera;
        state.drawn.clear();
        (state.is_shaded, state.shaded) = (false, None);
        let lens = drawable_lens(view, extracted);
        if let Some(lens) = &lens {
            self.scene.collect(entity, lens, view, size(camera), visible, &mut state.drawn);
        }
        state.leave_out();
        state.count_idle_frames();
        lens.map(|lens| CameraPose { lens, world_from_camera: view.world_from_view.affine() })
    }

    /// Prepares the collected captures, in error scopes. `poses` are the camera's, in this and in the previous frame.
    fn prepare_drawn(
        &mut self,
        state: &mut CaptureView,
        camera: &CameraItem<'_>,
        poses: [CameraPose; 2],
    ) -> Result<(), GpuError> {
        let bytes = state.renderer.statistics().all_bytes();
        let device = self.device.wgpu_device();
        let (prepared, mut caught) = catch(device, bytes, || self.write(state, camera, poses));
        match caught.poll() {
            Some(result) => result?,
            // Only if memory was allocated, nothing is drawn until the result arrives.
            None if state.renderer.statistics().all_bytes() != bytes => state.pending = Some(caught),
            None => {}
        }
        prepared?;
        if state.renderer.is_short_of_room() {
            warn_once_each(
                "captures are drawn whole but slowly: a camera has more pairs of splats and tiles than fit on this \
                 GPU; draw fewer or smaller Gaussians, or a smaller picture",
            );
        }
        if state.pending.is_some() {
            state.drawn.clear();
        }
        Ok(())
    }

    /// Writes the inputs of drawing to the GPU.
    fn write(
        &mut self,
        state: &mut CaptureView,
        camera: &CameraItem<'_>,
        [CameraPose { lens, .. }, previous_pose]: [CameraPose; 2],
    ) -> Result<(), GpuError> {
        let Self { device, queue, renderer, scene, measured, .. } = *self;
        let &(_, view, _, depth, &msaa, _, _, prepass) = camera;
        let main = view.retained_view_entity.main_entity;
        let (settings, size) = (self.settings(view), size(camera));
        state.renderer.set_design(&renderer.0, settings.design);
        state.renderer.measure(device.wgpu_device(), queue, &renderer.0, measured);
        // Debug views do not show light, so they are not shaded.
        state.is_shaded = settings.debug == DebugView::Color && scene.shade.want(main, &state.drawn);
        let viewport = UVec4::new(view.viewport.x, view.viewport.y, size.x, size.y);
        state.bindings.set_viewport(viewport, device, queue, renderer.0.work());
        let instances = state.instances(&scene.captures, &scene.lists);
        let surrounded = instances.iter().any(|instance| instance.capture.has_environment());
        let opaque = opaque_depth(&lens, view, depth, msaa);
        let motion = prepass.filter(|prepass| prepass.motion_vectors.is_some() && lens.distance.is_some());
        let has_motion = motion.is_some();
        let previous = has_motion.then(|| scene.previous_views(&state.drawn, &previous_pose));
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
        state.renderer.prepare(device.wgpu_device(), queue, &renderer.0, &instances, &parameters)?;
        let median = writes_median(&settings, surrounded);
        let written = lens.distance.filter(|_| median.is_some() || has_motion);
        let pipelines = &mut *self.pipelines;
        state.write_depth = written.and(median).and_then(|median| pipelines.write_depth(msaa, median));
        state.write_motion =
            motion.and_then(|prepass| pipelines.write_motion(msaa, median.unwrap_or(false), prepass.depth.is_some()));
        if let Some(distance) = written {
            state.depth_bindings.set_lens(distance, 1, device, queue, renderer.0.work());
        }
        Ok(())
    }
}

/// Returns the size of the picture of a camera, which may be smaller than its target, to be scaled up later.
fn size(&(_, view, .., resolution, _): &CameraItem<'_>) -> UVec2 {
    resolution.map_or(UVec2::new(view.viewport.z, view.viewport.w), |smaller| smaller.0)
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
    if let Some(fault) = fault {
        warn_once_each(&fault.to_string());
    }
    let lens = CameraLens::of(&view.clip_from_view).filter(|_| fault != Some(CameraFault::Oklab))?;
    Some(camera.viewport.as_ref().map_or(lens, |viewport| lens.in_depth_range(&viewport.depth)))
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
        warn_once_each(
            "captures are drawn over meshes: a camera's depth texture cannot be read; add TEXTURE_BINDING to it",
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
