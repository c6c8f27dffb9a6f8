//! Composite: draws captures over the camera's target, through Bevy's pipeline cache.
//!
//! In: a view target and a view's captures (color and transmittance). Out: pipeline and bind group for
//! `shaders/composite.wgsl`, created only when one of the inputs has changed.

use super::bindings::{CachedUniform, created};
use crate::renderer::WorkCounters;
use crate::view::BlendSpace;
use bevy::asset::Handle;
use bevy::core_pipeline::FullscreenShader;
use bevy::ecs::resource::Resource;
use bevy::ecs::world::{FromWorld, World};
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource,
    BlendState, ColorTargetState, ColorWrites, FragmentState, MultisampleState, PipelineCache,
    RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureFormat, TextureSampleType, TextureView,
    TextureViewId, VertexState,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::{Shader, ShaderDefVal};
use glam::UVec4;

/// Handles of the shaders of captures, kept in the render world so that the assets stay loaded.
#[derive(Resource)]
pub(in crate::plugin::render) struct CaptureShaders {
    pub(in crate::plugin::render) composite: Handle<Shader>,
    pub(in crate::plugin::render) write_depth: Handle<Shader>,
    pub(in crate::plugin::render) write_motion: Handle<Shader>,
    /// The library that `composite.wgsl` imports. It is never read, but the import resolves only while it is held.
    pub(in crate::plugin::render) _srgb: Handle<Shader>,
}

/// The parts that the pipelines for all targets share.
#[derive(Resource)]
pub(in crate::plugin::render) struct CompositePipeline {
    /// Bindings of the composite in place: captures and viewport.
    layout: BindGroupLayoutDescriptor,
    reading: BindGroupLayoutDescriptor,
    vertex: VertexState,
    shader: Handle<Shader>,
}

/// The properties of a target that its pipeline depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::plugin::render) struct CompositeKey {
    pub(in crate::plugin::render) format: TextureFormat,
    /// Whether the target holds sRGB-encoded values instead of linear ones.
    pub(in crate::plugin::render) encoded: bool,
    /// The space in which captures have been blended, and are blended with the target.
    pub(in crate::plugin::render) blend_space: BlendSpace,
    /// Samples of the target that is written. A texture that is read has one sample.
    pub(in crate::plugin::render) samples: u32,
}

impl CompositeKey {
    /// Returns whether captures are blended in the space of the target, so that hardware blending in place is right.
    /// Otherwise the target is read, and the result is written to another texture.
    pub(in crate::plugin::render) fn blends_in_place(self) -> bool {
        self.encoded == (self.blend_space == BlendSpace::Encoded)
    }

    fn shader_defs(self) -> Vec<ShaderDefVal> {
        let mut definitions: Vec<ShaderDefVal> = match (self.encoded, self.blend_space) {
            (false, BlendSpace::Encoded) => vec!["READ_TARGET".into(), "ENCODE_TARGET".into()],
            (true, BlendSpace::Linear) => vec!["READ_TARGET".into()],
            (false, BlendSpace::Linear) | (true, BlendSpace::Encoded) => return Vec::new(),
        };
        if self.samples > 1 {
            definitions.push("KEEP_SAMPLES".into());
        }
        definitions
    }
}

impl FromWorld for CompositePipeline {
    fn from_world(world: &mut World) -> Self {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let captures = (texture(), uniform_buffer::<UVec4>(false));
        let captures = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, captures);
        let all = (texture(), uniform_buffer::<UVec4>(false), texture());
        let all = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, all);
        Self {
            layout: BindGroupLayoutDescriptor::new("gs4d composite", &captures),
            reading: BindGroupLayoutDescriptor::new("gs4d composite", &all),
            vertex: world.resource::<FullscreenShader>().to_vertex_state(),
            shader: world.resource::<CaptureShaders>().composite.clone(),
        }
    }
}

impl SpecializedRenderPipeline for CompositePipeline {
    type Key = CompositeKey;

    fn specialize(&self, key: CompositeKey) -> RenderPipelineDescriptor {
        let in_place = key.blends_in_place();
        let blend = in_place.then_some(BlendState::PREMULTIPLIED_ALPHA_BLENDING);
        RenderPipelineDescriptor {
            label: Some("gs4d composite".into()),
            layout: vec![self.layout(in_place).clone()],
            vertex: self.vertex.clone(),
            multisample: MultisampleState { count: key.samples, ..MultisampleState::default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: key.shader_defs(),
                entry_point: Some("fragment".into()),
                targets: vec![Some(ColorTargetState { format: key.format, blend, write_mask: ColorWrites::ALL })],
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}

impl CompositePipeline {
    fn layout(&self, in_place: bool) -> &BindGroupLayoutDescriptor {
        if in_place { &self.layout } else { &self.reading }
    }
}

/// The bindings of one view. A view target alternates between two textures, so two bind groups are kept.
#[derive(Default)]
pub(in crate::plugin::render) struct CompositeBindings {
    viewport: CachedUniform<UVec4>,
    groups: Vec<CachedGroup>,
}

struct CachedGroup {
    /// The target texture, if it is read.
    source: Option<TextureViewId>,
    captures: wgpu::TextureView,
    group: BindGroup,
}

impl CompositeBindings {
    /// Releases the bound targets.
    pub(in crate::plugin::render) fn forget(&mut self) {
        self.groups.clear();
    }

    /// Writes the corner and size of the viewport in pixels of the target, if they have changed.
    pub(in crate::plugin::render) fn set_viewport(
        &mut self,
        viewport: UVec4,
        device: &RenderDevice,
        queue: &RenderQueue,
        work: &WorkCounters,
    ) {
        self.viewport.set(viewport, device, queue, work);
    }

    /// Returns the viewport's uniform, for other passes over the same view; `None` before the first
    /// [`set_viewport`](Self::set_viewport).
    pub(in crate::plugin::render) fn viewport(&self) -> Option<BindingResource<'_>> {
        self.viewport.binding()
    }

    /// Returns the bind group that reads `captures` and, unless they are blended in place, the target texture `source`;
    /// `None` before the first [`set_viewport`](Self::set_viewport), and if the GPU refuses the bind group.
    pub(in crate::plugin::render) fn group(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        pipeline: &CompositePipeline,
        source: Option<&TextureView>,
        captures: &wgpu::TextureView,
        work: &WorkCounters,
    ) -> Option<&BindGroup> {
        let id = source.map(TextureView::id);
        let known = self.groups.iter().position(|g| g.source == id && g.captures == *captures);
        let index = match known {
            Some(index) => index,
            None => {
                let layout = cache.get_bind_group_layout(pipeline.layout(source.is_none()));
                let viewport = self.viewport.binding()?;
                let create = |entries: &[BindGroupEntry]| device.create_bind_group("gs4d composite", &layout, entries);
                let group = created(device, || match source {
                    Some(source) => create(&BindGroupEntries::sequential((captures, viewport, source))),
                    None => create(&BindGroupEntries::sequential((captures, viewport))),
                })?;
                work.add_created();
                // Both textures of the target are created together, so a new `captures` makes both bind groups stale.
                if self.groups.len() >= 2 || self.groups.iter().any(|known| known.captures != *captures) {
                    self.groups.clear();
                }
                self.groups.push(CachedGroup { source: id, captures: captures.clone(), group });
                self.groups.len() - 1
            }
        };
        self.groups.get(index).map(|cached| &cached.group)
    }
}
