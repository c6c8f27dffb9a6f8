//! `write_motion`: writes the motion of captures to the camera's motion vectors, and their depth to the depth of its
//! prepass, for post-processing that follows pixels from frame to frame.
//!
//! In: a view's captures (motions with transmittance, depths) and its lens. Out: pipeline and bind group for
//! `shaders/write_motion.wgsl`, for cameras with Bevy's prepass of motion vectors.

use super::composite::CaptureShaders;
use super::write_depth::nearest;
use bevy::asset::Handle;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::MOTION_VECTOR_PREPASS_FORMAT;
use bevy::ecs::resource::Resource;
use bevy::ecs::world::{FromWorld, World};
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, ColorTargetState,
    ColorWrites, FragmentState, MultisampleState, PipelineCache, RenderPipelineDescriptor, ShaderStages,
    SpecializedRenderPipeline, TextureSampleType, VertexState,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::{Shader, ShaderDefVal};
use glam::{UVec4, Vec4};

/// The parts that the pipelines for all prepasses share.
#[derive(Resource)]
pub(in crate::plugin::render) struct WriteMotionPipeline {
    layout: BindGroupLayoutDescriptor,
    vertex: VertexState,
    shader: Handle<Shader>,
}

/// The properties of a prepass that its pipeline depends on, and the depth to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::plugin::render) struct WriteMotionKey {
    /// Samples of the prepass.
    pub(in crate::plugin::render) samples: u32,
    /// Whether the median depth is written instead of the expected one.
    pub(in crate::plugin::render) median: bool,
    /// Whether the prepass has a depth texture.
    pub(in crate::plugin::render) depth: bool,
}

impl FromWorld for WriteMotionPipeline {
    fn from_world(world: &mut World) -> Self {
        let texture = || texture_2d(TextureSampleType::Float { filterable: false });
        let entries = (texture(), texture(), uniform_buffer::<UVec4>(false), uniform_buffer::<Vec4>(false));
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries);
        Self {
            layout: BindGroupLayoutDescriptor::new("gs4d write_motion", &entries),
            vertex: world.resource::<FullscreenShader>().to_vertex_state(),
            shader: world.resource::<CaptureShaders>().write_motion.clone(),
        }
    }
}

impl SpecializedRenderPipeline for WriteMotionPipeline {
    type Key = WriteMotionKey;

    fn specialize(&self, key: WriteMotionKey) -> RenderPipelineDescriptor {
        let target =
            ColorTargetState { format: MOTION_VECTOR_PREPASS_FORMAT, blend: None, write_mask: ColorWrites::ALL };
        let median = key.median.then(|| ShaderDefVal::from("MEDIAN"));
        let depth = key.depth.then(|| ShaderDefVal::from("DEPTH"));
        RenderPipelineDescriptor {
            label: Some("gs4d write_motion".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            depth_stencil: key.depth.then(nearest),
            multisample: MultisampleState { count: key.samples, ..MultisampleState::default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: median.into_iter().chain(depth).collect(),
                entry_point: Some("fragment".into()),
                targets: vec![Some(target)],
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}

impl WriteMotionPipeline {
    /// Creates the bind group of a view's motions and depths, its viewport and its lens.
    pub(in crate::plugin::render) fn group(
        &self,
        device: &RenderDevice,
        cache: &PipelineCache,
        [motions, depths]: [&wgpu::TextureView; 2],
        [viewport, lens]: [BindingResource<'_>; 2],
    ) -> BindGroup {
        let layout = cache.get_bind_group_layout(&self.layout);
        let entries = BindGroupEntries::sequential((motions, depths, viewport, lens));
        device.create_bind_group("gs4d write_motion", &layout, &entries)
    }
}
