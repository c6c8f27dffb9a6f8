//! The state of every view of a light into which captures are drawn, kept from frame to frame.
//!
//! In: what [`prepare`](super::prepare) finds in the view. Out: [`LightViews`], which drawing reads.

use crate::plugin::render::{Drawn, WriteDepthBindings};
use crate::renderer::{Renderer, ViewRenderer, WorkCounters};
use bevy::ecs::resource::Resource;
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::{CachedRenderPipelineId, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::RetainedViewEntity;
use glam::{UVec2, UVec4};

/// State of every view of a light: a cascade for one camera, a face of a point light, a spot light.
#[derive(Resource, Default)]
pub(super) struct LightViews(pub(super) HashMap<RetainedViewEntity, LightView>);

/// State of one view.
pub(super) struct LightView {
    pub(super) renderer: ViewRenderer,
    /// The map's corner, which is 0, and its size.
    pub(super) viewport: UniformBuffer<UVec4>,
    pub(super) depth_bindings: WriteDepthBindings,
    pub(super) write_depth: CachedRenderPipelineId,
    /// The captures in it this frame; nothing is drawn while this is empty.
    pub(super) drawn: Vec<Drawn>,
    /// Whether Bevy draws it this frame.
    pub(super) live: bool,
    /// Frames since a capture was last in it.
    idle: u32,
}

/// Frames in a row without a capture after which a view releases its GPU memory.
const RELEASE_AFTER_IDLE_FRAMES: u32 = 120;

impl LightView {
    pub(super) fn new(device: &RenderDevice, renderer: &Renderer, write_depth: CachedRenderPipelineId) -> Self {
        Self {
            renderer: ViewRenderer::new(device.wgpu_device(), renderer),
            viewport: UniformBuffer::default(),
            depth_bindings: WriteDepthBindings::default(),
            write_depth,
            drawn: Vec::new(),
            live: true,
            idle: 0,
        }
    }

    /// Writes the size of the map, if it has changed.
    pub(super) fn set_map(&mut self, size: UVec2, device: &RenderDevice, queue: &RenderQueue, work: &WorkCounters) {
        let viewport = UVec4::new(0, 0, size.x, size.y);
        let first = self.viewport.buffer().is_none();
        if first || *self.viewport.get() != viewport {
            self.viewport.set(viewport);
            self.viewport.write_buffer(device, queue);
        }
        if first {
            work.add_created();
        }
    }

    /// Counts a frame with a capture in the view, or without one. After [`RELEASE_AFTER_IDLE_FRAMES`] without one, GPU memory is
    /// released.
    pub(super) fn count_idle_frames(&mut self) {
        if !self.drawn.is_empty() {
            self.idle = 0;
            return;
        }
        self.idle = self.idle.saturating_add(1);
        if self.idle == RELEASE_AFTER_IDLE_FRAMES {
            self.renderer.release();
            self.depth_bindings.forget();
        }
    }
}
