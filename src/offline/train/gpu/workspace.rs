//! A scene that is trained, on the GPU.
//!
//! In: a scene in the trained form. Out: [`Workspace`]: the capture that is drawn, the parameters and the pipelines of
//! training, which the trainer and its optional parts share.

use super::parameters::ParameterBuffers;
use super::passes::Passes;
use super::records::records;
use crate::gaussian::{GradientMode, Model};
use crate::offline::engine::shaders::{COMPAT, COMPAT_WITHOUT_TIME, MIP_FILTER};
use crate::offline::train::memory::{bytes, require_gaussians, stride};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::memory::with_room;
use crate::renderer::{GpuCapture, GpuError, Headless, ShaderChecks};
use crate::scene::{GaussianScene, SceneForm, TrainedWith};

/// What the trainer and its optional parts work on.
#[derive(Debug)]
pub(crate) struct Workspace<'a> {
    pub headless: &'a mut Headless,
    pub passes: Passes,
    pub capture: GpuCapture,
    pub parameters: ParameterBuffers,
    /// The scene before the first step, but for its temporal filter, which is the current one: what is not trained is
    /// read from it.
    pub scene: GaussianScene,
}

impl<'a> Workspace<'a> {
    /// Uploads a scene in the trained form, and compiles the passes that every training has.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn, a scene that does not fit one binding of the device, a limit that is too low.
    pub(crate) fn new(
        headless: &'a mut Headless,
        mut scene: GaussianScene,
        mode: GradientMode,
    ) -> Result<Self, TrainerError> {
        // Levels of detail are of the Gaussians before training.
        scene.levels.clear();
        let SceneForm::Trained(trained) = &scene.form else { return Err(TrainerError::NotTrained) };
        let model = trained.parameters.model();
        let records = records(&trained.parameters);
        let runtime = scene.clone().into_runtime()?;
        let definitions = definitions(mode, model, &scene.trained_with);
        let passes = Passes::new(headless, &definitions, ShaderChecks::Off)?;
        let degrees = runtime.form.color_degrees();
        let stride = stride(degrees.degree, degrees.degree_t);
        let count = runtime.len() as u32;
        require_gaussians(headless, count.into())?;
        if count == 0 {
            return Err(TrainerError::Empty);
        }
        let settings = (model, scene.trained_with.prefilter_var);
        let (capture, parameters) = with_room(&headless.context().device, bytes(count.into(), stride), || {
            let capture = headless.upload(&runtime)?;
            let parameters = ParameterBuffers::new(headless, &passes, settings, &records, stride, capture.writable());
            Ok::<_, GpuError>((capture, parameters))
        })??;
        Ok(Self { headless, passes, capture, parameters, scene })
    }

    /// Returns the queue of the device.
    pub(crate) fn queue(&self) -> &wgpu::Queue {
        &self.headless.context().queue
    }

    /// Returns a new encoder.
    pub(crate) fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        let label = wgpu::CommandEncoderDescriptor { label: Some(label) };
        self.headless.context().device.create_command_encoder(&label)
    }

    /// Submits one compute pass.
    pub(crate) fn submit(&self, label: &str, record: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
        let mut encoder = self.encoder(label);
        record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
        self.queue().submit([encoder.finish()]);
    }

    /// Slices the parameters, which the next views are drawn with; `then` records what follows in the same compute
    /// pass.
    pub(crate) fn slice(&self, then: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
        self.parameters.write_scene(self.queue(), 0);
        self.submit("gs4d slice", |pass| {
            self.parameters.record_slice(pass, &self.passes);
            then(pass);
        });
    }
}

/// Returns the definitions of the backward passes.
fn definitions(mode: GradientMode, model: Model, trained_with: &TrainedWith) -> Vec<&'static str> {
    let is_timeless = model == Model::Static3d || trained_with.force_sh_3d;
    let compat = match mode {
        GradientMode::Exact => &[][..],
        GradientMode::Compat if is_timeless => COMPAT_WITHOUT_TIME,
        GradientMode::Compat => COMPAT,
    };
    let filter = if trained_with.mip_filter { MIP_FILTER } else { &[] };
    [compat, filter].concat()
}
