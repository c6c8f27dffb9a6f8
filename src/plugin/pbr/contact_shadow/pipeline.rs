//! The pipeline of the pass `contact_shadow`, through Bevy's pipeline cache.
//!
//! In: the kind of a camera's target. Out: a pipeline for `shaders/pbr/contact_shadow.wgsl`, which has no bind group:
//! its only input is one vertex buffer of [`GpuEllipse`]s.

use crate::plugin::render::nearest;
use bevy::asset::Handle;
use bevy::ecs::resource::Resource;
use bevy::ecs::world::{FromWorld, World};
use bevy::mesh::VertexBufferLayout;
use bevy::render::render_resource::{
    BlendState, ColorTargetState, ColorWrites, DepthStencilState, Face, FragmentState, FrontFace, MultisampleState,
    PrimitiveState, PrimitiveTopology, RenderPipelineDescriptor, SpecializedRenderPipeline, TextureFormat,
    VertexFormat, VertexState, VertexStepMode,
};
use bevy::shader::Shader;
use bytemuck::{Pod, Zeroable};

/// One contact shadow in the clip space of one camera. Mirrors the vertex input of `shaders/pbr/contact_shadow.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GpuEllipse {
    /// The axes x and z of the unit disk and its center, in clip space.
    pub(super) axes: [[f32; 4]; 3],
    /// Strength and softness, from 0 to 1.
    pub(super) look: [f32; 2],
}

impl GpuEllipse {
    const FORMATS: [VertexFormat; 4] =
        [VertexFormat::Float32x4, VertexFormat::Float32x4, VertexFormat::Float32x4, VertexFormat::Float32x2];
}

/// The handle of the shader, kept in the render world so that the asset stays loaded.
#[derive(Resource)]
pub(super) struct ContactShadowShader(pub(super) Handle<Shader>);

/// The shader that the pipelines for all targets share.
#[derive(Resource)]
pub(super) struct ContactShadowPipeline(Handle<Shader>);

/// The properties of a camera that its pipeline depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct ContactShadowKey {
    /// Format and samples of the target.
    pub(super) format: TextureFormat,
    pub(super) samples: u32,
    /// Whether the camera's projection mirrors the picture.
    pub(super) mirrored: bool,
}

impl FromWorld for ContactShadowPipeline {
    fn from_world(world: &mut World) -> Self {
        Self(world.resource::<ContactShadowShader>().0.clone())
    }
}

impl SpecializedRenderPipeline for ContactShadowPipeline {
    type Key = ContactShadowKey;

    fn specialize(&self, key: ContactShadowKey) -> RenderPipelineDescriptor {
        let instances = VertexBufferLayout::from_vertex_formats(VertexStepMode::Instance, GpuEllipse::FORMATS);
        let target = ColorTargetState {
            format: key.format,
            blend: Some(BlendState::ALPHA_BLENDING),
            write_mask: ColorWrites::ALL,
        };
        RenderPipelineDescriptor {
            label: Some("gs4d contact_shadow".into()),
            vertex: VertexState {
                shader: self.0.clone(),
                entry_point: Some("vertex".into()),
                buffers: vec![instances],
                ..VertexState::default()
            },
            primitive: PrimitiveState {
                topology: PrimitiveTopology::TriangleStrip,
                front_face: if key.mirrored { FrontFace::Cw } else { FrontFace::Ccw },
                cull_mode: Some(Face::Back),
                ..PrimitiveState::default()
            },
            depth_stencil: Some(DepthStencilState { depth_write_enabled: Some(false), ..nearest() }),
            multisample: MultisampleState { count: key.samples, ..MultisampleState::default() },
            fragment: Some(FragmentState {
                shader: self.0.clone(),
                entry_point: Some("fragment".into()),
                targets: vec![Some(target)],
                ..FragmentState::default()
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}
