//! What the uniforms of an instance have from its capture.
//!
//! In: a scene. Out: [`InstanceUniforms`] with the settings of color and time, and zero in place of all others.

use super::buffers;
use crate::gaussian::ShDirection;
use crate::gaussian::harmonics::evaluated;
use crate::renderer::layout::InstanceUniforms;
use crate::scene::packed::MAX_STAGES;
use crate::scene::{CodedColors, ColorDegrees, RuntimeScene};

/// Returns the color and time settings of a scene as uniforms, with zero in place of all others.
pub(super) fn settings(scene: &RuntimeScene) -> InstanceUniforms {
    let (trained_with, colors) = (&scene.trained_with, scene.form.coded_colors());
    let ColorDegrees { degree, degree_t, .. } = scene.form.color_degrees();
    InstanceUniforms {
        degree,
        degree_t: if degree == 3 { degree_t } else { 0 },
        stride: colors.map_or_else(|| stride(scene), buffers::entry_words) as u32,
        stages: colors.map_or(0, |colors| colors.codebooks.entries.len() as u32),
        first_entries: colors.map(first_entries).unwrap_or_default(),
        displaced: u32::from(trained_with.sh_direction == ShDirection::Displaced),
        time_span: trained_with.period_of_colors(),
        marginal_cutoff: trained_with.marginal_cutoff,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Returns the number of four-vectors of color coefficients per Gaussian.
pub(super) fn stride(scene: &RuntimeScene) -> usize {
    let ColorDegrees { degree, degree_t, .. } = scene.form.color_degrees();
    (evaluated(degree, degree_t) * 3).div_ceil(4)
}

/// Returns the index of the first entry of each codebook among all entries.
fn first_entries(colors: &CodedColors) -> [u32; MAX_STAGES] {
    std::array::from_fn(|stage| colors.codebooks.entries.iter().take(stage).sum())
}
