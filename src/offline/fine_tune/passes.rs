//! The passes of training: bind group layouts and pipelines.
//!
//! In: a headless renderer, shader definitions. Out: [`Passes`]; an error if a limit of the device is too low.

use crate::offline::layout::{AdamUniforms, LossUniforms, TiedColors, TrainedScene};
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::{FrameUniforms, InstanceUniforms};
use crate::renderer::{GpuError, Headless, ShaderChecks};

/// Layouts and pipelines of the passes of training.
#[derive(Debug)]
pub(super) struct Passes {
    pub slice_group: wgpu::BindGroupLayout,
    pub slice: wgpu::ComputePipeline,
    pub loss_group: wgpu::BindGroupLayout,
    pub image_group: wgpu::BindGroupLayout,
    pub similarity: wgpu::ComputePipeline,
    pub gradient: wgpu::ComputePipeline,
    pub total: wgpu::ComputePipeline,
    pub blended_group: wgpu::BindGroupLayout,
    pub sums_group: wgpu::BindGroupLayout,
    pub place: wgpu::ComputePipeline,
    pub pairs: wgpu::ComputePipeline,
    pub splats_group: wgpu::BindGroupLayout,
    pub parameters_group: wgpu::BindGroupLayout,
    pub project_backward: wgpu::ComputePipeline,
    pub adam_group: wgpu::BindGroupLayout,
    pub adam: wgpu::ComputePipeline,
    pub tied_group: wgpu::BindGroupLayout,
    pub collect: wgpu::ComputePipeline,
    pub expand: wgpu::ComputePipeline,
}

impl Passes {
    /// Compiles the passes; `definitions` are those of `blend_backward` and `project_backward`.
    pub(super) fn new(headless: &Headless, definitions: &[&str], checks: ShaderChecks) -> Result<Self, GpuError> {
        use Bind::{Read, Texture, Uniform, Write};
        let device = &headless.context().device;
        let limits = device.limits();
        // The arrays of `loss`, which has more than the others; the bindings of `project_backward`.
        let needs = [
            ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, 24_896),
            ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, 12),
        ];
        for (what, found, needed) in needs {
            if found < needed {
                return Err(GpuError::Limit { what, found: found.into(), needed: needed.into() });
            }
        }
        const SCENE: Bind = Uniform(size_of::<TrainedScene>());
        let group = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        let slice_group = group("gs4d slice", &[SCENE, Read, Write, Write]);
        let loss_group = group("gs4d loss", &[Uniform(size_of::<LossUniforms>()), Texture, Write, Write, Write, Write]);
        let image_group = group("gs4d image", &[Read]);
        let frame = Uniform(size_of::<FrameUniforms>());
        let blended_group = group("gs4d blended", &[frame, Read, Read, Read, Read, Read, Read, Texture, Texture]);
        let sums_group = group("gs4d sums", &[Write, Write, Read, Read]);
        let splats_group =
            group("gs4d splats", &[Uniform(size_of::<InstanceUniforms>()), SCENE, Read, Read, Read, Read]);
        let parameters_group = group("gs4d parameters", &[Read, Read, Write, Write, Write]);
        let adam_group = group("gs4d adam", &[Uniform(size_of::<AdamUniforms>()), Write, Write, Write, Write]);
        let tied = [Uniform(size_of::<TiedColors>()), Read, Read, Read, Read, Write, Read, Write];
        let tied_group = group("gs4d tied colors", &tied);
        let slice = SHADERS.module(device, "slice", &[], checks)?;
        let codebooks = SHADERS.module(device, "codebooks", &[], checks)?;
        let loss = SHADERS.module(device, "loss", &[], checks)?;
        let blend_backward = SHADERS.module(device, "blend_backward", definitions, checks)?;
        let project_backward = SHADERS.module(device, "project_backward", definitions, checks)?;
        let adam = SHADERS.module(device, "adam", &[], checks)?;
        let make = |module, entry, groups: &[&wgpu::BindGroupLayout]| {
            let groups: Vec<_> = groups.iter().copied().map(Some).collect();
            pipeline(device, module, entry, &groups)
        };
        let [geometry, list] = headless.capture_layouts();
        Ok(Self {
            slice: make(&slice, "slice", &[&slice_group]),
            similarity: make(&loss, "similarity", &[&loss_group, &image_group]),
            gradient: make(&loss, "gradient", &[&loss_group, &image_group]),
            total: make(&loss, "total", &[&loss_group, &image_group]),
            place: make(&blend_backward, "place", &[&blended_group, &sums_group]),
            pairs: make(&blend_backward, "pairs", &[&blended_group, &sums_group]),
            project_backward: make(
                &project_backward,
                "project_backward",
                &[&splats_group, geometry, list, &parameters_group],
            ),
            adam: make(&adam, "adam", &[&adam_group]),
            collect: make(&codebooks, "collect", &[&tied_group]),
            expand: make(&codebooks, "expand", &[&tied_group]),
            slice_group,
            loss_group,
            image_group,
            blended_group,
            sums_group,
            splats_group,
            parameters_group,
            adam_group,
            tied_group,
        })
    }
}
