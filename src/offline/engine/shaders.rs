//! The shaders of scoring and of the passes that every training has.
//!
//! In: the name of a pass. Out: its WGSL text, or a wgpu shader module. They import the libraries of the renderer, so
//! that they repeat no rule of its passes.

use crate::renderer::shaders::ShaderSet;

/// Libraries by name.
pub(crate) const LIBRARIES: &[(&str, &str)] = &[
    ("training", include_str!("../../../shaders/offline/shared/training.wgsl")),
    ("random", include_str!("../../../shaders/offline/shared/random.wgsl")),
    ("trained", include_str!("../../../shaders/offline/shared/trained.wgsl")),
    ("slice_backward", include_str!("../../../shaders/offline/shared/slice_backward.wgsl")),
    ("pairs", include_str!("../../../shaders/offline/shared/pairs.wgsl")),
];

/// Passes by name.
const PASSES: &[(&str, &str)] = &[
    ("score", include_str!("../../../shaders/offline/score.wgsl")),
    ("slice", include_str!("../../../shaders/offline/slice.wgsl")),
    ("loss", include_str!("../../../shaders/offline/loss.wgsl")),
    ("blend_backward", include_str!("../../../shaders/offline/blend_backward.wgsl")),
    ("project_backward", include_str!("../../../shaders/offline/project_backward.wgsl")),
    ("adam", include_str!("../../../shaders/offline/adam.wgsl")),
];

/// The passes of scoring, and those that every training has.
pub static SHADERS: ShaderSet = ShaderSet::new(PASSES, LIBRARIES);

/// Definitions of `blend_backward` and `project_backward` that reproduce the gradients of the original, including its
/// deviations.
pub const COMPAT: &[&str] = &["COMPAT"];

/// Like [`COMPAT`], for captures whose color does not depend on time.
pub const COMPAT_WITHOUT_TIME: &[&str] = &["COMPAT", "WITHOUT_TIME"];

/// The definition of `project_backward` for captures with the filter of Mip-Splatting, whose gradient it includes.
pub const MIP_FILTER: &[&str] = &["MIP_FILTER"];
