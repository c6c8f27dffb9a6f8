// Structures of the passes of the offline half, identical to those in src/offline/engine/layout.rs (a test compares
// every offset).
#define_import_path gs4d::training

// The raw parameters of one Gaussian, or their gradients. Quaternions are (w, x, y, z).
struct TrainedRecord {
    // Mean, mean_t.
    mean: vec4<f32>,
    // Logarithms of the scales; w: of the temporal scale.
    log_scale: vec4<f32>,
    rotation_l: vec4<f32>,
    rotation_r: vec4<f32>,
    // Logit of opacity; three unused.
    opacity_logit: vec4<f32>,
}

// The change that packing makes to one Gaussian. Input of `rounding`.
struct RoundingRecord {
    // Added to the mean and to mean_t.
    mean: vec4<f32>,
    // Added to the velocity; w: factor on inverse_sigma_t.
    velocity: vec4<f32>,
    // Columns of the matrix that transforms the covariance. w: added to the variances before that.
    shape_x: vec4<f32>,
    // w: added to the opacity.
    shape_y: vec4<f32>,
    // w: unused.
    shape_z: vec4<f32>,
}

// Settings of one part of the trained scene, and the number of a view.
struct TrainedScene {
    // Number of Gaussians of the part.
    count: u32,
    // 0: static, 1: without 4D rotation, 2: with it.
    model: u32,
    // Added to the temporal variance in the marginal, if positive.
    prefilter_var: f32,
    view: u32,
    // Index of the first Gaussian of the part among all.
    first: u32,
    // Number of all Gaussians.
    total: u32,
}

// Input of `loss` for one view.
struct LossUniforms {
    // Background color behind the image where its coverage is below 1.
    background: vec4<f32>,
    size: vec2<u32>,
    tiles: vec2<u32>,
    // Weight of the view in the loss of the batch.
    share: f32,
    // Weight of SSIM in the loss of the view, from 0 to 1.
    similarity_share: f32,
    // Weight of the opacity mask.
    mask_weight: f32,
    padding: u32,
}

// Input of `exposure` for one view.
struct ExposureUniforms {
    // Background color; w: 1, or 0 if the exposure also applies to the background.
    background: vec4<f32>,
    size: vec2<u32>,
    tiles: vec2<u32>,
    // Weight of the view in the loss of the batch.
    share: f32,
    // Weight of the pull to the identity in the loss of the view.
    pull: f32,
    camera: u32,
    padding: u32,
}

// Input of `codebooks`.
struct TiedColors {
    // Number of Gaussians.
    count: u32,
    // Four-vectors of each Gaussian and of each entry.
    stride: u32,
    // Number of codebooks.
    stages: u32,
    padding: u32,
}

// Input of `adam` for one buffer.
struct AdamUniforms {
    // Learning rates of the first four four-vectors of each Gaussian, and of all others.
    rates: array<vec4<f32>, 5>,
    // 1 / (1 - decay^step) of the first moment, and the square root of this value of the second moment.
    correction: vec2<f32>,
    count: u32,
    // Four-vectors of each Gaussian.
    stride: u32,
    // Number of values of each Gaussian that are updated.
    values: u32,
    padding: u32,
    end: vec2<u32>,
}

// Input of `noise` for one step.
struct NoiseUniforms {
    count: u32,
    // Seed of the step.
    seed: u32,
    // Factor on the variance along an axis that gives the deviation of the noise of a fully transparent Gaussian along
    // it.
    strength: f32,
    // Least logarithm of the temporal scale.
    least_log_scale_t: f32,
}

// Input of `dropout` for one step and one part.
struct DropoutUniforms {
    // Number of Gaussians of the part.
    count: u32,
    // Seed of the step.
    seed: u32,
    // Gaussians whose random word is below this number are hidden.
    below: u32,
    // Index of the first Gaussian of the part among all.
    first: u32,
}

// Input of `relocate` for one part.
struct RelocationUniforms {
    // Number of moves.
    moves: u32,
    // Four-vectors of the color of each Gaussian.
    stride: u32,
    // 1: sources keep their moments.
    keeps: u32,
    // Index of the first Gaussian of the part among all.
    first: u32,
    // Number of Gaussians of the part.
    count: u32,
}
