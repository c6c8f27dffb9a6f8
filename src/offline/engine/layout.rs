//! Mirrors of the structures in `shaders/offline/shared/training.wgsl`, byte for byte (a test compares every offset).
//!
//! In: settings and parameters of a trained scene. Out: plain data for uniform and storage buffers.

use bytemuck::{Pod, Zeroable};

/// The raw parameters of one Gaussian, or their gradients. Quaternions are (w, x, y, z).
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct TrainedRecord {
    /// Mean.
    pub mean: [f32; 3],
    /// Temporal mean.
    pub mean_t: f32,
    /// Logarithms of the scales.
    pub log_scale: [f32; 3],
    /// Logarithm of the temporal scale.
    pub log_scale_t: f32,
    /// Left rotation.
    pub rotation_l: [f32; 4],
    /// Right rotation.
    pub rotation_r: [f32; 4],
    /// Logit of opacity; three unused.
    pub opacity_logit: [f32; 4],
}

/// The change that packing makes to one Gaussian. Input of `rounding`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct RoundingRecord {
    /// Offset of the mean and of the temporal mean.
    pub mean: [f32; 4],
    /// Offset of the velocity; factor on the reciprocal of the temporal deviation.
    pub velocity: [f32; 4],
    /// Column x of the matrix that transforms the covariance; offset of the variances before that.
    pub shape_x: [f32; 4],
    /// Column y; offset of the opacity.
    pub shape_y: [f32; 4],
    /// Column z; one unused.
    pub shape_z: [f32; 4],
}

/// Settings of one part of the trained scene, and the number of a view.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TrainedScene {
    /// Number of Gaussians of the part.
    pub count: u32,
    /// 0: static, 1: without 4D rotation, 2: with it.
    pub model: u32,
    /// Added to the temporal variance in the marginal, if positive.
    pub prefilter_var: f32,
    /// Number of the view.
    pub view: u32,
    /// Index of the first Gaussian of the part among all.
    pub first: u32,
    /// Number of all Gaussians.
    pub total: u32,
}

/// Input of `loss` for one view.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LossUniforms {
    /// Background color behind the image where its coverage is below 1.
    pub background: [f32; 4],
    /// Picture size, pixels.
    pub size: [u32; 2],
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// Weight of the view in the loss of the batch.
    pub share: f32,
    /// Weight of SSIM in the loss of the view, from 0 to 1.
    pub similarity_share: f32,
    /// Weight of the opacity mask.
    pub mask_weight: f32,
    /// Unused.
    pub padding: u32,
}

/// Input of `exposure` for one view.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ExposureUniforms {
    /// Background color; 1, or 0 if what is behind the Gaussians is exposed too.
    pub background: [f32; 4],
    /// Picture size, pixels.
    pub size: [u32; 2],
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// Weight of the view in the loss of the batch.
    pub share: f32,
    /// Weight of the pull to the identity in the loss of the view.
    pub pull: f32,
    /// Number of the camera.
    pub camera: u32,
    /// Unused.
    pub padding: u32,
}

/// Input of `codebooks`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TiedColors {
    /// Number of Gaussians.
    pub count: u32,
    /// Four-vectors of each Gaussian and of each entry.
    pub stride: u32,
    /// Number of codebooks.
    pub stages: u32,
    /// Unused.
    pub padding: u32,
}

/// Input of `adam` for one buffer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct AdamUniforms {
    /// Learning rates of the first four four-vectors of each Gaussian, and of all others.
    pub rates: [[f32; 4]; 5],
    /// `1 / (1 - decay^step)` of the first moment, and the square root of this value of the second moment.
    pub correction: [f32; 2],
    /// Number of Gaussians.
    pub count: u32,
    /// Four-vectors of each Gaussian.
    pub stride: u32,
    /// Number of values of each Gaussian that are updated; the values after these keep their value.
    pub values: u32,
    /// Unused.
    pub padding: u32,
    /// Unused.
    pub end: [u32; 2],
}

/// Index of the first Gaussian in the `notes` of `project_backward`, after three words about gradients that are not
/// finite.
pub const FIRST_SEEN: u32 = 3;

/// Input of `noise` for one step.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NoiseUniforms {
    /// Number of Gaussians.
    pub count: u32,
    /// Seed of the step.
    pub seed: u32,
    /// Factor on the variance along an axis that gives the deviation of the noise of a fully transparent Gaussian along
    /// it.
    pub strength: f32,
    /// Least logarithm of the temporal scale.
    pub least_log_scale_t: f32,
}

/// Input of `dropout` for one step and one part.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct DropoutUniforms {
    /// Number of Gaussians of the part.
    pub count: u32,
    /// Seed of the step.
    pub seed: u32,
    /// Gaussians whose random word is below this number are hidden.
    pub below: u32,
    /// Index of the first Gaussian of the part among all.
    pub first: u32,
}

/// Input of `relocate` for one part.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct RelocationUniforms {
    /// Number of moves.
    pub moves: u32,
    /// Four-vectors of the color of each Gaussian.
    pub stride: u32,
    /// 1: Gaussians that others get their colors from keep their moments.
    pub keeps: u32,
    /// Index of the first Gaussian of the part among all.
    pub first: u32,
    /// Number of Gaussians of the part.
    pub count: u32,
}
