//! Pipelines of Bevy's cache, each checked on the GPU before the cache creates it.
//!
//! In: a description of a pipeline for a target. Out: its identifier in the cache; `None` if this GPU refuses it.
//!
//! Bevy's cache creates pipelines on other threads, without error scopes: a refused pipeline would reach the error
//! handler of the app, which ends the app. For each new key, a pipeline with the same layout and targets, and shaders
//! that do nothing, is therefore created in error scopes first. A shader that does not compile is no such error: Bevy
//! logs it, and nothing is drawn with it.

use crate::plugin::render::logged::error_once_each;
use crate::renderer::GpuError;
use crate::renderer::device::memory::catch_known;
use bevy::ecs::resource::Resource;
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::{
    CachedRenderPipelineId, PipelineCache, RenderPipelineDescriptor, SpecializedRenderPipeline,
};
use bevy::render::renderer::RenderDevice;

/// Shaders that do nothing, for any number of vertex buffers and at most one color target.
const SHADER: &str = "
@vertex
fn vertex() -> @builtin(position) vec4<f32> {
    return vec4(0.0);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
    return vec4(0.0);
}
";

/// The pipelines of one kind, by key; `None` for keys that this GPU refuses.
#[derive(Resource)]
pub struct CheckedPipelines<S: SpecializedRenderPipeline<Key: Send + Sync> + 'static>(
    HashMap<S::Key, Option<CachedRenderPipelineId>>,
);

impl<S: SpecializedRenderPipeline<Key: Send + Sync> + 'static> Default for CheckedPipelines<S> {
    fn default() -> Self {
        Self(HashMap::default())
    }
}

impl<S: SpecializedRenderPipeline<Key: Send + Sync> + 'static> CheckedPipelines<S> {
    /// Returns the pipeline of a key; `None` if this GPU refuses it, which is logged once.
    pub fn specialize(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        pipeline: &S,
        key: S::Key,
    ) -> Option<CachedRenderPipelineId> {
        *self.0.entry(key.clone()).or_insert_with(|| {
            let descriptor = pipeline.specialize(key);
            match check(device.wgpu_device(), cache, &descriptor) {
                Ok(()) => Some(cache.queue_render_pipeline(descriptor)),
                Err(failure) => {
                    let name = descriptor.label.as_deref().unwrap_or("gs4d");
                    error_once_each(&format!(
                        "the pass `{name}` is left out for a camera: this GPU refuses its pipeline ({failure}); use \
                         another texture format or number of samples for the camera's target"
                    ));
                    None
                }
            }
        })
    }
}

/// Checks that the device accepts the layout and the targets of a pipeline.
fn check(device: &wgpu::Device, cache: &PipelineCache, descriptor: &RenderPipelineDescriptor) -> Result<(), GpuError> {
    catch_known(device, 0, || {
        let groups: Vec<_> = descriptor.layout.iter().map(|group| cache.get_bind_group_layout(group)).collect();
        let groups: Vec<Option<&wgpu::BindGroupLayout>> = groups.iter().map(|group| Some(group.value())).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("gs4d check"),
            bind_group_layouts: &groups,
            immediate_size: descriptor.immediate_size,
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("gs4d check"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let targets = descriptor.fragment.as_ref().map_or(&[][..], |fragment| &fragment.targets);
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("gs4d check"),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: descriptor.primitive,
            depth_stencil: descriptor.depth_stencil.clone(),
            multisample: descriptor.multisample,
            fragment: (!targets.is_empty()).then(|| wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    })
    .map(drop)
}
