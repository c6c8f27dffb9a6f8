//! A material of one color, for meshes among captures.
//!
//! In: a color. Out: the material [`Flat`] and its [`FlatPlugin`]. A software driver compiles a pipeline of
//! `StandardMaterial` in seconds, one of this material in a tenth of that; tests of lit, tonemapped or transmissive
//! meshes use `StandardMaterial`.

use bevy::asset::uuid_handle;
use bevy::prelude::*;
use bevy::render::render_resource::AsBindGroup;
use bevy::shader::ShaderRef;

const SHADER: Handle<Shader> = uuid_handle!("2f6d3a57-6b8e-4e0c-9d4c-3f1b8a5c7e21");
const SOURCE: &str = "
#import bevy_pbr::forward_io::VertexOutput

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> color: vec4<f32>;

@fragment
fn fragment(in: VertexOutput) -> @location(0) vec4<f32> {
    return color;
}
";

/// An opaque, unlit material of one color.
#[derive(Asset, TypePath, AsBindGroup, Clone)]
pub struct Flat {
    /// The color in linear light.
    #[uniform(0)]
    pub color: LinearRgba,
}

impl Material for Flat {
    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }
}

/// Adds the material to an app.
pub struct FlatPlugin;

impl Plugin for FlatPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(MaterialPlugin::<Flat>::default());
        let shader = Shader::from_wgsl(SOURCE, file!());
        let inserted = app.world_mut().resource_mut::<Assets<Shader>>().insert(SHADER.id(), shader);
        inserted.expect("no other shader has this identifier");
    }
}
