//! Bindings of the passes of a view, kept from frame to frame and written or created again only after a change.
//!
//! In: a value, or two textures, of this frame. Out: a uniform buffer with the value, [`CachedUniform`]; a bind group of
//! the textures, [`CachedGroup`]; the number of frames without a drawn capture, [`IdleFrames`].

use crate::plugin::render::logged::error_once_each;
use crate::renderer::WorkCounters;
use crate::renderer::device::memory::catch_known;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::{BindGroup, BindingResource, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// A uniform buffer.
#[derive(Default)]
pub(crate) struct CachedUniform<T: ShaderType + Default>(UniformBuffer<T>);

impl<T: ShaderType + WriteInto + Default + PartialEq> CachedUniform<T> {
    /// Writes the value if it has changed.
    pub(crate) fn set(&mut self, value: T, device: &RenderDevice, queue: &RenderQueue, work: &WorkCounters) {
        let first = self.0.buffer().is_none();
        if first || *self.0.get() != value {
            self.0.set(value);
            self.0.write_buffer(device, queue);
        }
        if first {
            work.add_created();
        }
    }

    /// Returns the buffer; `None` before the first [`set`](Self::set).
    pub(crate) fn binding(&self) -> Option<BindingResource<'_>> {
        self.0.binding()
    }
}

/// A bind group of two textures and of buffers that do not change.
#[derive(Default)]
pub(crate) struct CachedGroup(Option<([wgpu::TextureView; 2], BindGroup)>);

impl CachedGroup {
    /// Releases the textures.
    pub(crate) fn forget(&mut self) {
        self.0 = None;
    }

    /// Returns the bind group of these textures. If the textures have changed, `create` makes a new one; `None` if
    /// `create` fails, or if the GPU refuses the bind group, which is logged.
    pub(crate) fn of(
        &mut self,
        device: &RenderDevice,
        textures: [&wgpu::TextureView; 2],
        work: &WorkCounters,
        create: impl FnOnce() -> Option<BindGroup>,
    ) -> Option<&BindGroup> {
        if self.0.as_ref().is_none_or(|(known, _)| known.each_ref() != textures) {
            let group = created(device, create)??;
            work.add_created();
            self.0 = Some((textures.map(Clone::clone), group));
        }
        self.0.as_ref().map(|(_, group)| group)
    }
}

/// Creates objects of a pass; `None` if the GPU refuses them, which is logged. The pass is then left out.
pub(crate) fn created<T>(device: &RenderDevice, create: impl FnOnce() -> T) -> Option<T> {
    let created = catch_known(device.wgpu_device(), 0, create);
    created.inspect_err(|failure| error_once_each(&format!("a pass over captures is left out: {failure}"))).ok()
}

/// Consecutive frames in which a view has drawn no capture.
#[derive(Debug, Default)]
pub(crate) struct IdleFrames(u32);

impl IdleFrames {
    /// After this many frames, a view releases its GPU memory.
    const MOST: u32 = 120;

    /// Counts a frame. Returns whether the view should release its memory now.
    pub(crate) fn count(&mut self, draws: bool) -> bool {
        self.0 = if draws { 0 } else { self.0.saturating_add(1) };
        self.0 == Self::MOST
    }

    /// Returns whether the view has released its memory.
    #[cfg(feature = "pbr")]
    pub(crate) fn is_over(&self) -> bool {
        self.0 >= Self::MOST
    }
}
