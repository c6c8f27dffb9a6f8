//! The passes that every training has: bind group layouts and pipelines.
//!
//! In: a headless renderer, shader definitions. Out: [`Passes`]; an error if a limit of the device is too low.

use crate::offline::engine::layout::{AdamUniforms, LossUniforms, TrainedScene};
use crate::offline::engine::shaders::SHADERS;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::layout::{FrameUniforms, InstanceUniforms};
use crate::renderer::{GpuError, Headless, ShaderChecks};

/// Layouts and pipelines of the passes that every training has. Optional parts have their own.
#[derive(Debug)]
pub(crate) struct Passes {
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
}

impl Passes {
    /// Compiles the passes; `definitions` are those of `blend_backward` and `project_backward`.
    pub(crate) fn new(headless: &Headless, definitions: &[&str], checks: ShaderChecks) -> Result<Self, GpuError> {
        use Bind::{Read, Texture, Uniform, Write};
        let device = &headless.context().device;
        require_limits(&device.limits())?;
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
        let slice = SHADERS.module(device, "slice", &[], checks)?;
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
            slice_group,
            loss_group,
            image_group,
            blended_group,
            sums_group,
            splats_group,
            parameters_group,
            adam_group,
        })
    }
}

/// Checks the limits that the passes need: the arrays of `loss`, which has more than the others, and the bindings of
/// `project_backward`.
fn require_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let needs: [(&str, u32, u32); 2] = [
        ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, 24_896),
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, 12),
    ];
    match needs.into_iter().find(|(_, found, needed)| found < needed) {
        Some((what, found, needed)) => Err(GpuError::Limit { what, found: found.into(), needed: needed.into() }),
        None => Ok(()),
    }
}
