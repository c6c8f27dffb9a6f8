//! Composite: draws captures over what the camera has drawn so far, through Bevy's pipeline cache.
//!
//! In: a view target and a view's captures (colour and transmittance). Out: pipeline and bind group for
//! `shaders/composite.wgsl`, which are created only when something has changed.

use crate::renderer::WorkCounters;
use crate::view::BlendSpace;
use bevy::asset::Handle;
use bevy::core_pipeline::FullscreenShader;
use bevy::ecs::resource::Resource;
use bevy::ecs::world::{FromWorld, World};
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, ColorTargetState,
    ColorWrites, FragmentState, PipelineCache, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline,
    TextureFormat, TextureSampleType, TextureView, TextureViewId, UniformBuffer, VertexState,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::{Shader, ShaderDefVal};
use glam::UVec4;

/// The shaders of this folder, kept alive for the render world.
#[derive(Resource)]
pub(super) struct CaptureShaders {
    pub(super) composite: Handle<Shader>,
    pub(super) write_depth: Handle<Shader>,
    /// The library that composite imports: nothing reads the handle, but the import resolves only as long as it is held.
    pub(super) _srgb: Handle<Shader>,
}

/// The parts that the pipelines for all targets share.
#[derive(Resource)]
pub(super) struct CompositePipeline {
    layout: BindGroupLayoutDescriptor,
    vertex: VertexState,
    shader: Handle<Shader>,
}

/// The properties of a target that its pipeline depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct CompositeKey {
    pub(super) format: TextureFormat,
    /// Whether the target holds sRGB-encoded values instead of linear ones.
    pub(super) encoded: bool,
    /// The space in which captures have been blended, and are blended with the target.
    pub(super) blend_space: BlendSpace,
}

impl CompositeKey {
    fn shader_defs(self) -> Vec<ShaderDefVal> {
        match (self.encoded, self.blend_space) {
            (false, BlendSpace::Encoded) => vec!["ENCODE_TARGET".into()],
            (true, BlendSpace::Linear) => vec!["DECODE_TARGET".into()],
            (false, BlendSpace::Linear) | (true, BlendSpace::Encoded) => Vec::new(),
        }
    }
}

impl FromWorld for CompositePipeline {
    fn from_world(world: &mut World) -> Self {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let entries = (texture(), texture(), uniform_buffer::<UVec4>(false));
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries);
        Self {
            layout: BindGroupLayoutDescriptor::new("gs4d composite", &entries),
            vertex: world.resource::<FullscreenShader>().to_vertex_state(),
            shader: world.resource::<CaptureShaders>().composite.clone(),
        }
    }
}

impl SpecializedRenderPipeline for CompositePipeline {
    type Key = CompositeKey;

    fn specialize(&self, key: CompositeKey) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some("gs4d composite".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: key.shader_defs(),
                entry_point: Some("fragment".into()),
                targets: vec![Some(ColorTargetState { format: key.format, blend: None, write_mask: ColorWrites::ALL })],
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}

/// What one view binds. A view target alternates between two textures, so two bind groups are kept.
#[derive(Default)]
pub(super) struct CompositeBindings {
    viewport: UniformBuffer<UVec4>,
    groups: Vec<CachedGroup>,
}

struct CachedGroup {
    source: TextureViewId,
    captures: wgpu::TextureView,
    group: BindGroup,
}

impl CompositeBindings {
    /// Releases the targets that were bound.
    pub(super) fn forget(&mut self) {
        self.groups.clear();
    }

    /// Writes the corner and size of the viewport, pixels of the target, if they have changed.
    pub(super) fn set_viewport(
        &mut self,
        viewport: UVec4,
        device: &RenderDevice,
        queue: &RenderQueue,
        work: &WorkCounters,
    ) {
        let first = self.viewport.buffer().is_none();
        if first || *self.viewport.get() != viewport {
            self.viewport.set(viewport);
            self.viewport.write_buffer(device, queue);
        }
        if first {
            work.add_created();
        }
    }

    /// Returns the viewport's uniform, for other passes over the same view; `None` before the first
    /// [`set_viewport`](Self::set_viewport).
    pub(super) fn viewport(&self) -> Option<BindingResource<'_>> {
        self.viewport.binding()
    }

    /// Returns the bind group that reads `source`, the target so far, and `captures`; `None` before the first
    /// [`set_viewport`](Self::set_viewport).
    pub(super) fn group(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        pipeline: &CompositePipeline,
        source: &TextureView,
        captures: &wgpu::TextureView,
        work: &WorkCounters,
    ) -> Option<&BindGroup> {
        let known = self.groups.iter().position(|g| g.source == source.id() && g.captures == *captures);
        let index = match known {
            Some(index) => index,
            None => {
                let layout = cache.get_bind_group_layout(&pipeline.layout);
                let entries = BindGroupEntries::sequential((source, captures, self.viewport.binding()?));
                let group = device.create_bind_group("gs4d composite", &layout, &entries);
                work.add_created();
                // Both textures of the target are created together: if one is new, so is the other.
                if self.groups.len() >= 2 || self.groups.iter().any(|known| known.captures != *captures) {
                    self.groups.clear();
                }
                self.groups.push(CachedGroup { source: source.id(), captures: captures.clone(), group });
                self.groups.len() - 1
            }
        };
        self.groups.get(index).map(|cached| &cached.group)
    }
}
