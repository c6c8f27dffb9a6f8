//! The pipeline of the pass `shade`, through Bevy's pipeline cache.
//!
//! In: the kind of a view (its bindings of Bevy, its shadow filter). Out: a pipeline for `shaders/pbr/shade.wgsl` with
//! the view bindings of Bevy's meshes, and a layout for the remaining bindings.

use super::uniform::{GpuSettings, MOST_SHADINGS};
use bevy::asset::Handle;
use bevy::core_pipeline::FullscreenShader;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Commands, Res};
use bevy::pbr::{MeshPipelineKey, MeshPipelineViewLayout, MeshPipelineViewLayoutKey, MeshPipelineViewLayouts};
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, BindGroupLayoutEntries, ColorTargetState, ColorWrites, FragmentState,
    RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureFormat, TextureSampleType, VertexState,
};
use bevy::shader::{Shader, ShaderDefVal};

/// The format of the shaded picture, equal to the format of the captures' picture.
pub(super) const FORMAT: TextureFormat = TextureFormat::Rgba16Float;

/// The handle of the shader, kept in the render world so that the asset stays loaded.
#[derive(Resource)]
pub(super) struct ShadeShader(pub(super) Handle<Shader>);

/// The parts that the pipelines for all views share; absent without Bevy's `PbrPlugin`.
#[derive(Resource)]
pub(super) struct ShadePipeline {
    /// Layout of the captures' picture, their depths and the shading settings.
    pub(super) layout: BindGroupLayoutDescriptor,
    view_layouts: MeshPipelineViewLayouts,
    vertex: VertexState,
    shader: Handle<Shader>,
}

/// Creates the parts that all pipelines share, if the app has the view layouts of Bevy's meshes.
pub(super) fn init_shade_pipeline(
    mut commands: Commands,
    view_layouts: Option<Res<MeshPipelineViewLayouts>>,
    vertex: Res<FullscreenShader>,
    shader: Res<ShadeShader>,
) {
    let Some(view_layouts) = view_layouts else { return };
    let texture = || texture_2d(TextureSampleType::Float { filterable: false });
    let entries = (texture(), texture(), uniform_buffer::<GpuSettings>(false));
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, entries);
    commands.insert_resource(ShadePipeline {
        layout: BindGroupLayoutDescriptor::new("gs4d shade", &entries),
        view_layouts: view_layouts.clone(),
        vertex: vertex.to_vertex_state(),
        shader: shader.0.clone(),
    });
}

impl SpecializedRenderPipeline for ShadePipeline {
    type Key = MeshPipelineKey;

    fn specialize(&self, key: MeshPipelineKey) -> RenderPipelineDescriptor {
        let view = self.view_layouts.get_view_layout(key.into());
        let shader_defs = shader_defs(key, &view);
        RenderPipelineDescriptor {
            label: Some("gs4d shade".into()),
            layout: vec![view.main_layout, view.binding_array_layout, self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs,
                entry_point: Some("fragment".into()),
                targets: vec![Some(ColorTargetState { format: FORMAT, blend: None, write_mask: ColorWrites::ALL })],
            }),
            ..RenderPipelineDescriptor::default()
        }
    }
}

/// Returns the shader definitions with which Bevy's shader libraries declare the bindings of a view.
fn shader_defs(key: MeshPipelineKey, view: &MeshPipelineViewLayout) -> Vec<ShaderDefVal> {
    let filter = key.intersection(MeshPipelineKey::SHADOW_FILTER_METHOD_RESERVED_BITS);
    let filter = if filter == MeshPipelineKey::SHADOW_FILTER_METHOD_TEMPORAL {
        "SHADOW_FILTER_METHOD_TEMPORAL"
    } else if filter == MeshPipelineKey::SHADOW_FILTER_METHOD_GAUSSIAN {
        "SHADOW_FILTER_METHOD_GAUSSIAN"
    } else {
        "SHADOW_FILTER_METHOD_HARDWARE_2X2"
    };
    let mut defs = vec![filter.into(), ShaderDefVal::UInt("MOST_SHADINGS".into(), MOST_SHADINGS as u32)];
    let key = MeshPipelineViewLayoutKey::from(key);
    if key.contains(MeshPipelineViewLayoutKey::DISTANCE_FOG) {
        defs.push("DISTANCE_FOG".into());
    }
    if key.contains(MeshPipelineViewLayoutKey::ENVIRONMENT_MAP) {
        defs.push("ENVIRONMENT_MAP".into());
    }
    // Bindings that depend on the device and on Bevy's features are visible only in the layout: the sampler of soft
    // shadows, and arrays of environment maps.
    if view.main_layout.entries.iter().any(|entry| entry.binding == 4) {
        defs.push("PCSS_SAMPLERS_AVAILABLE".into());
    }
    if view.binding_array_layout.entries.iter().any(|entry| entry.binding == 0 && entry.count.is_some()) {
        defs.push("MULTIPLE_LIGHT_PROBES_IN_ARRAY".into());
    }
    defs
}
