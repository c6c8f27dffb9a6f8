//! The material of a contact shadow: a standard one that is blended among opaque meshes.
//!
//! In: Bevy's pipeline for an alpha-masked mesh. Out: the same pipeline, blending, without writing depth.
//!
//! Bevy draws alpha-masked meshes after opaque ones and before captures. In the transparent phase the shadow would be drawn over captures.

use bevy::asset::Asset;
use bevy::material::AlphaMode;
use bevy::mesh::MeshVertexBufferLayoutRef;
use bevy::pbr::{
    ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline, StandardMaterial,
};
use bevy::reflect::Reflect;
use bevy::render::render_resource::{AsBindGroup, BlendState, RenderPipelineDescriptor, SpecializedMeshPipelineError};

/// A standard material that is blended among opaque meshes.
pub(super) type ContactShadowMaterial = ExtendedMaterial<StandardMaterial, BlendedEarly>;

/// What makes it so.
#[derive(Asset, AsBindGroup, Reflect, Debug, Clone)]
pub(crate) struct BlendedEarly {}

impl MaterialExtension for BlendedEarly {
    fn alpha_mode() -> Option<AlphaMode> {
        Some(AlphaMode::Mask(0.0))
    }

    fn enable_prepass() -> bool {
        false
    }

    fn enable_shadows() -> bool {
        false
    }

    fn specialize(
        _pipeline: &MaterialExtensionPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        _layout: &MeshVertexBufferLayoutRef,
        _key: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        for target in descriptor.fragment.iter_mut().flat_map(|fragment| &mut fragment.targets).flatten() {
            target.blend = Some(BlendState::ALPHA_BLENDING);
        }
        if let Some(depth) = &mut descriptor.depth_stencil {
            depth.depth_write_enabled = Some(false);
        }
        Ok(())
    }
}
