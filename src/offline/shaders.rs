//! The shaders of scoring and training.
//!
//! In: the name of a pass. Out: its WGSL text, or a wgpu shader module. They import the libraries of the renderer, so that they repeat no rule of
//! its passes.

use crate::renderer::shaders::ShaderSet;

/// Libraries by name.
const LIBRARIES: &[(&str, &str)] = &[
    ("training", include_str!("../../shaders/offline/shared/training.wgsl")),
    ("random", include_str!("../../shaders/offline/shared/random.wgsl")),
    ("trained", include_str!("../../shaders/offline/shared/trained.wgsl")),
    ("slice_backward", include_str!("../../shaders/offline/shared/slice_backward.wgsl")),
    ("pairs", include_str!("../../shaders/offline/shared/pairs.wgsl")),
];

/// Passes by name.
const PASSES: &[(&str, &str)] = &[
    ("score", include_str!("../../shaders/offline/score.wgsl")),
    ("slice", include_str!("../../shaders/offline/slice.wgsl")),
    ("rounding", include_str!("../../shaders/offline/rounding.wgsl")),
    ("loss", include_str!("../../shaders/offline/loss.wgsl")),
    ("blend_backward", include_str!("../../shaders/offline/blend_backward.wgsl")),
    ("environment_backward", include_str!("../../shaders/offline/environment_backward.wgsl")),
    ("exposure", include_str!("../../shaders/offline/exposure.wgsl")),
    ("project_backward", include_str!("../../shaders/offline/project_backward.wgsl")),
    ("regularize", include_str!("../../shaders/offline/regularize.wgsl")),
    ("codebooks", include_str!("../../shaders/offline/codebooks.wgsl")),
    ("adam", include_str!("../../shaders/offline/adam.wgsl")),
    ("dropout", include_str!("../../shaders/offline/dropout.wgsl")),
    ("noise", include_str!("../../shaders/offline/noise.wgsl")),
    ("statistics", include_str!("../../shaders/offline/statistics.wgsl")),
    ("relocate", include_str!("../../shaders/offline/relocate.wgsl")),
];

/// The passes of scoring and training.
pub static SHADERS: ShaderSet = ShaderSet::new(PASSES, LIBRARIES);

/// Definitions of `blend_backward` and `project_backward` that reproduce the gradients of the original, including its deviations.
pub const COMPAT: &[&str] = &["COMPAT"];

/// Like [`COMPAT`], for captures whose color does not depend on time.
pub const COMPAT_WITHOUT_TIME: &[&str] = &["COMPAT", "WITHOUT_TIME"];

/// The definition of `project_backward` for captures with the filter of Mip-Splatting, whose gradient it includes.
pub const MIP_FILTER: &[&str] = &["MIP_FILTER"];
