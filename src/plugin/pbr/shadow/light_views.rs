//! The state of every view of a light into which captures are drawn, kept from frame to frame.
//!
//! In: the captures that [`prepare`](super::prepare) finds in each view. Out: [`LightViews`], read by drawing.

use crate::plugin::render::targets::bindings::{CachedUniform, IdleFrames};
use crate::plugin::render::{Drawn, WriteDepthBindings};
use crate::renderer::{Renderer, ViewRenderer, WorkCounters};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::Res;
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::CachedRenderPipelineId;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::RetainedViewEntity;
use glam::{UVec2, UVec4};

/// State of every view of a light: a cascade for one camera, a face of a point light, a spot light.
#[derive(Resource, Default)]
pub(super) struct LightViews(pub(super) HashMap<RetainedViewEntity, LightView>);

/// Returns whether any view of a light has state.
pub(super) fn any_light_view(views: Res<LightViews>) -> bool {
    !views.0.is_empty()
}

/// State of one view.
pub(super) struct LightView {
    pub(super) renderer: ViewRenderer,
    /// Corner (0) and size of the map.
    pub(super) viewport: CachedUniform<UVec4>,
    pub(super) depth_bindings: WriteDepthBindings,
    /// `None` if the GPU refuses the pipeline. Nothing is drawn then.
    pub(super) write_depth: Option<CachedRenderPipelineId>,
    /// The captures in the view this frame; nothing is drawn while this is empty.
    pub(super) drawn: Vec<Drawn>,
    /// Whether Bevy draws the view this frame.
    pub(super) live: bool,
    idle: IdleFrames,
}

impl LightView {
    pub(super) fn new(device: &RenderDevice, renderer: &Renderer, write_depth: Option<CachedRenderPipelineId>) -> Self {
        Self {
            // Shadow maps have depths alone.
            renderer: ViewRenderer::new(device.wgpu_device(), renderer).without_colors(),
            viewport: CachedUniform::default(),
            depth_bindings: WriteDepthBindings::default(),
            write_depth,
            drawn: Vec::new(),
            live: true,
            idle: IdleFrames::default(),
        }
    }

    /// Writes the size of the map, if it has changed.
    pub(super) fn set_map(&mut self, size: UVec2, device: &RenderDevice, queue: &RenderQueue, work: &WorkCounters) {
        let viewport = UVec4::new(0, 0, size.x, size.y);
        self.viewport.set(viewport, device, queue, work);
    }

    /// Returns whether the state is dropped: Bevy has not drawn the view for many frames. A light or a camera that is
    /// switched off for a frame keeps it.
    pub(super) fn is_over(&self) -> bool {
        !self.live && self.idle.is_over()
    }

    /// Counts a frame, with or without a capture in the view. After many frames without one, releases the GPU memory.
    pub(super) fn count_idle_frames(&mut self) {
        if self.idle.count(!self.drawn.is_empty()) {
            self.renderer.release();
            self.depth_bindings.forget();
        }
    }
}
