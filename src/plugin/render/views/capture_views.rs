//! The state of every camera that may see captures, kept from frame to frame.
//!
//! In: the captures that [`prepare`](super::prepare) finds for each camera. Out: [`CaptureViews`].

use crate::plugin::component::GaussianCapture;
use crate::plugin::render::captures::active::ActiveLists;
use crate::plugin::render::captures::previous::CameraPose;
use crate::plugin::render::captures::upload::GpuGaussianCapture;
use crate::plugin::render::targets::bindings::{CachedGroup, IdleFrames};
use crate::plugin::render::targets::composite::CompositeBindings;
use crate::plugin::render::targets::write_depth::WriteDepthBindings;
use crate::renderer::device::memory::Caught;
use crate::renderer::{Instance, Renderer, ViewRenderer};
use crate::view::{Appearance, View};
use bevy::asset::AssetId;
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::Res;
use bevy::platform::collections::HashMap;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::CachedRenderPipelineId;
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::MainEntity;

/// State of every camera that may see captures, by its entity in the render world.
#[derive(Resource, Default)]
pub(crate) struct CaptureViews(pub(crate) HashMap<Entity, CaptureView>);

/// Returns whether other systems change the captures' picture of any camera before it reaches the target.
pub(in crate::plugin::render) fn any_shaded(views: Res<CaptureViews>) -> bool {
    views.0.values().any(|view| view.is_shaded)
}

/// State of one camera.
pub(crate) struct CaptureView {
    /// The camera's entity in the main world.
    pub(in crate::plugin::render) camera: Entity,
    pub(crate) renderer: ViewRenderer,
    /// The pipeline of the composite into the camera's target; `None` if the GPU refuses it. Nothing is drawn then.
    pub(in crate::plugin::render) composite: Option<CachedRenderPipelineId>,
    /// The composite into every sample of a multisampled target.
    pub(in crate::plugin::render) composite_samples: Option<CachedRenderPipelineId>,
    /// Whether the composite blends in place by hardware, instead of reading the target.
    pub(in crate::plugin::render) in_place: bool,
    pub(in crate::plugin::render) bindings: CompositeBindings,
    /// The pipeline that writes to the camera's depth buffer, if the camera requests it.
    pub(in crate::plugin::render) write_depth: Option<CachedRenderPipelineId>,
    pub(in crate::plugin::render) depth_bindings: WriteDepthBindings,
    /// The pipeline that writes to the camera's motion vectors, if the camera has them.
    pub(in crate::plugin::render) write_motion: Option<CachedRenderPipelineId>,
    pub(in crate::plugin::render) motion_group: CachedGroup,
    /// The camera's pose in the previous frame.
    pub(in crate::plugin::render) pose: Option<CameraPose>,
    /// Whether other systems change the captures' picture before it reaches the target, in
    /// [`CaptureSystems::Shade`](crate::plugin::render::CaptureSystems).
    pub(crate) is_shaded: bool,
    /// The changed picture, which the composite uses instead of the renderer's color.
    pub(crate) shaded: Option<wgpu::TextureView>,
    idle: IdleFrames,
    /// The captures that the camera sees this frame; nothing is drawn while this is empty.
    pub(crate) drawn: Vec<Drawn>,
    /// The captures of the last frame in which the GPU had room for all captures in view.
    shown: Vec<MainEntity>,
    /// Number of remaining frames in which only the captures in `shown` are drawn, for lack of room for the others.
    left_out: u32,
    /// Error scopes of this view's objects, without results yet, as in browsers. Nothing is drawn until these arrive.
    pub(in crate::plugin::render) pending: Option<Caught>,
}

/// Number of frames after which captures for which there was no room are tried again: about a second.
const LEFT_OUT_FRAMES: u32 = 60;

/// One capture, seen by one camera or light.
pub(crate) struct Drawn {
    pub(crate) entity: MainEntity,
    pub(crate) asset: AssetId<GaussianCapture>,
    pub(crate) view: View,
    pub(crate) appearance: Appearance,
    /// Whether the capture's temporal filter is used.
    pub(crate) filtered: bool,
    /// The level of detail; 0 is all Gaussians.
    pub(crate) level: usize,
}

/// Moves the copies of each capture at one level next to the first copy, so that one dispatch draws copies whose lists of
/// active Gaussians are in one buffer, or that have none. The order is otherwise kept, since it decides between splats of the same depth.
pub(crate) fn group_copies(drawn: &mut [Drawn]) {
    // Two captures are always adjacent.
    if drawn.len() < 3 {
        return;
    }
    let copies = |one: &Drawn| (one.asset, one.level);
    let mut groups = HashMap::new();
    for one in &*drawn {
        let next = groups.len();
        groups.entry(copies(one)).or_insert(next);
    }
    drawn.sort_by_key(|one| groups.get(&copies(one)).copied());
}

impl Drawn {
    /// Returns the capture as input of the renderer; `None` if the capture is no longer on the GPU.
    pub(crate) fn instance<'a>(
        &self,
        captures: &'a RenderAssets<GpuGaussianCapture>,
        lists: &'a ActiveLists,
    ) -> Option<Instance<'a>> {
        let capture = captures.get(self.asset)?.level(self.level)?;
        // Levels of detail have no filter. A capture in chunk files is drawn by its list.
        let is_listed = self.level == 0 && (self.filtered || capture.paged_bytes().is_some());
        let active = lists.placed.get(&self.entity).filter(|_| is_listed).map(|placed| &placed.list);
        Some(Instance { capture, active, view: self.view, appearance: self.appearance })
    }
}

impl CaptureView {
    pub(in crate::plugin::render) fn new(device: &RenderDevice, renderer: &Renderer, camera: Entity) -> Self {
        Self {
            camera,
            renderer: ViewRenderer::new(device.wgpu_device(), renderer),
            composite: None,
            composite_samples: None,
            in_place: false,
            bindings: CompositeBindings::default(),
            write_depth: None,
            depth_bindings: WriteDepthBindings::default(),
            write_motion: None,
            motion_group: CachedGroup::default(),
            pose: None,
            is_shaded: false,
            shaded: None,
            idle: IdleFrames::default(),
            drawn: Vec::new(),
            shown: Vec::new(),
            left_out: 0,
            pending: None,
        }
    }

    /// Returns whether the camera draws a capture this frame.
    pub(crate) fn sees_something(&self) -> bool {
        !self.drawn.is_empty()
    }

    /// Returns the captures drawn this frame, as input of the renderer.
    pub(in crate::plugin::render) fn instances<'a>(
        &self,
        captures: &'a RenderAssets<GpuGaussianCapture>,
        lists: &'a ActiveLists,
    ) -> Vec<Instance<'a>> {
        self.drawn.iter().filter_map(|drawn| drawn.instance(captures, lists)).collect()
    }

    /// Counts a frame, with or without a visible capture. After many frames without one, releases the GPU memory.
    pub(in crate::plugin::render) fn count_idle_frames(&mut self) {
        if self.idle.count(self.sees_something()) {
            self.release();
        }
    }

    /// Releases the GPU memory; the next frame with a visible capture creates it again.
    pub(in crate::plugin::render) fn release(&mut self) {
        self.renderer.release();
        self.bindings.forget();
        self.depth_bindings.forget();
        self.motion_group.forget();
    }

    /// Counts a frame in which Bevy does not draw the camera. The view is kept, since the camera may be active again.
    pub(in crate::plugin::render) fn pass_over(&mut self) {
        self.drawn.clear();
        (self.is_shaded, self.shaded) = (false, None);
        self.pose = None;
        self.count_idle_frames();
    }

    /// Removes the captures for which there was no room some frames ago.
    pub(in crate::plugin::render) fn leave_out(&mut self) {
        if self.left_out > 0 && !self.retain_shown() {
            self.left_out = 0;
        }
        self.left_out = self.left_out.saturating_sub(1);
    }

    /// Removes the captures that are not in `shown`. Returns whether fewer remain, which can be prepared instead.
    pub(in crate::plugin::render) fn leave_out_new(&mut self) -> bool {
        let count = self.drawn.len();
        let fewer = self.retain_shown() && self.drawn.len() < count;
        if fewer {
            self.left_out = LEFT_OUT_FRAMES;
        }
        fewer
    }

    /// Removes the captures that are not in `shown`. Returns false, and removes none, if none is in `shown`.
    fn retain_shown(&mut self) -> bool {
        let Self { drawn, shown, .. } = self;
        let any = drawn.iter().any(|one| shown.contains(&one.entity));
        if any {
            drawn.retain(|one| shown.contains(&one.entity));
        }
        any
    }

    /// Records that there is room for the captures of this frame.
    pub(in crate::plugin::render) fn note_room(&mut self) {
        if self.left_out == 0 {
            self.shown.clear();
            self.shown.extend(self.drawn.iter().map(|one| one.entity));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::uuid::Uuid;
    use bevy::ecs::entity::Entity;
    use glam::{Mat4, UVec2, Vec2, Vec4};

    #[test]
    fn copies_are_grouped_and_the_order_is_otherwise_kept() {
        let view = View::new(UVec2::ONE, 0.0, Mat4::IDENTITY, Vec4::ONE, Vec2::ONE);
        let one = |(number, (asset, level)): (u32, (u128, usize))| Drawn {
            entity: Entity::from_raw_u32(number).expect("a small number").into(),
            asset: AssetId::Uuid { uuid: Uuid::from_u128(asset) },
            view,
            appearance: Appearance::default(),
            filtered: true,
            level,
        };
        // The second asset has the smaller identifier; the first asset occurs at two levels.
        let assets = [(9, 0), (4, 0), (9, 1), (9, 0), (7, 0), (4, 0), (9, 1), (9, 0)];
        let mut drawn: Vec<Drawn> = (0..).zip(assets).map(one).collect();
        group_copies(&mut drawn);
        let order: Vec<u32> = drawn.iter().map(|one| one.entity.id().index_u32()).collect();
        assert_eq!(order, [0, 3, 7, 1, 5, 2, 6, 4], "copies follow the first copy in their original order");
    }
}
