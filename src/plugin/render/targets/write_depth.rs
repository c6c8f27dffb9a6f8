//! `write_depth`: writes the depth of captures to a depth buffer, for later passes.
//!
//! In: a view's captures (color, transmittance, depths) and its lens. Out: pipeline and bind group for
//! `shaders/write_depth.wgsl`, for cameras that request it with [`DepthWrite`](crate::plugin::render::DepthWrite), and for the shadow
//! maps of lights.

use super::bindings::{CachedGroup, CachedUniform};
use super::composite::CaptureShaders;
use crate::renderer::WorkCounters;
use bevy::asset::Handle;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::ecs::resource::Resource;
use bevy::ecs::world::{FromWorld, World};
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, CompareFunction,
    DepthBiasState, DepthStencilState, FragmentState, MultisampleState, PipelineCache, RenderPipelineDescriptor,
    ShaderStages, ShaderType, SpecializedRenderPipeline, StencilState, TextureSampleType, VertexState,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::Shader;
use glam::{UVec4, Vec4};

/// The parts that the pipelines for all depth buffers share.
#[derive(Resource)]
pub(crate) struct WriteDepthPipeline {
    layout: BindGroupLayoutDescriptor,
    vertex: VertexState,
    shader: Handle<Shader>,
}

/// The properties of a depth buffer that its pipeline depends on, and the depth to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct WriteDepthKey {
    /// Samples of the depth buffer.
    pub(crate) samples: u32,
    pub(crate) depth: WrittenDepth,
}

/// The depth that is written, of the depths of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum WrittenDepth {
    /// The expected depth.
    Expected,
    /// The median depth.
    Median,
    /// The farther of the two, for shadow maps. On a slanted surface the median is the depth of the center of a splat,
    /// which may lie in front of the surface; the expected depth, a mean of several splats, is nearer to it. In front
    /// of a surface a faint splat makes the expected depth too small, but not the median.
    Farther,
}

impl FromWorld for WriteDepthPipeline {
    fn from_world(world: &mut World) -> Self {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let entries = (texture(), texture(), uniform_buffer::<UVec4>(false), uniform_buffer::<DepthLens>(false));
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries);
        Self {
            layout: BindGroupLayoutDescriptor::new("gs4d write_depth", &entries),
            vertex: world.resource::<FullscreenShader>().to_vertex_state(),
            shader: world.resource::<CaptureShaders>().write_depth.clone(),
        }
    }
}

impl SpecializedRenderPipeline for WriteDepthPipeline {
    type Key = WriteDepthKey;

    fn specialize(&self, key: WriteDepthKey) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some("gs4d write_depth".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            depth_stencil: Some(nearest()),
            multisample: MultisampleState { count: key.samples, ..MultisampleState::default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: match key.depth {
                    WrittenDepth::Expected => Vec::new(),
                    WrittenDepth::Median => vec!["MEDIAN".into()],
                    WrittenDepth::Farther => vec!["FARTHER".into()],
                },
                entry_point: Some("fragment".into()),
                targets: Vec::new(),
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}

/// Conversion of the captures' depths. Mirrors `Lens` in `shaders/write_depth.wgsl`.
#[derive(ShaderType, Debug, Default, Clone, Copy, PartialEq)]
struct DepthLens {
    distance: Vec4,
    scale: u32,
}

/// The bindings of one view.
#[derive(Default)]
pub(crate) struct WriteDepthBindings {
    lens: CachedUniform<DepthLens>,
    group: CachedGroup,
}

impl WriteDepthBindings {
    /// Writes how the lens maps depth, `n0 n1 m0 m1` as in [`OpaqueDepth`](crate::renderer::OpaqueDepth), and the side
    /// of a pixel of the captures in pixels of the depth buffer, if they have changed.
    pub(crate) fn set_lens(
        &mut self,
        distance: Vec4,
        scale: u32,
        device: &RenderDevice,
        queue: &RenderQueue,
        work: &WorkCounters,
    ) {
        self.lens.set(DepthLens { distance, scale }, device, queue, work);
    }

    /// Returns the lens's uniform, for other passes over the same view; `None` before the first
    /// [`set_lens`](Self::set_lens).
    pub(in crate::plugin::render) fn lens(&self) -> Option<BindingResource<'_>> {
        self.lens.binding()
    }

    /// Releases the bound targets.
    pub(crate) fn forget(&mut self) {
        self.group.forget();
    }

    /// Returns the bind group for the targets of a view; `None` before the first [`set_lens`](Self::set_lens).
    pub(crate) fn group(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        pipeline: &WriteDepthPipeline,
        viewport: BindingResource<'_>,
        [colors, depths]: [&wgpu::TextureView; 2],
        work: &WorkCounters,
    ) -> Option<&BindGroup> {
        let lens = &self.lens;
        self.group.of(device, [colors, depths], work, || {
            let layout = cache.get_bind_group_layout(&pipeline.layout);
            let entries = BindGroupEntries::sequential((colors, depths, viewport, lens.binding()?));
            Some(device.create_bind_group("gs4d write_depth", &layout, &entries))
        })
    }
}

/// Returns the depth state that writes captures only where they are nearest.
pub(crate) fn nearest() -> DepthStencilState {
    DepthStencilState {
        format: CORE_3D_DEPTH_FORMAT,
        depth_write_enabled: Some(true),
        // Reverse-z: nearer is greater.
        depth_compare: Some(CompareFunction::GreaterEqual),
        stencil: StencilState::default(),
        bias: DepthBiasState::default(),
    }
}
