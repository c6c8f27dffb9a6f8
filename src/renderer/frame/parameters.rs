//! The parameters of a frame of a view.
//!
//! In: captures, cameras and surfaces. Out: [`Instance`]s and [`ViewParameters`] for
//! [`ViewRenderer::prepare`](crate::renderer::view::ViewRenderer::prepare).

use crate::renderer::active::{ActiveList, listed_count};
use crate::renderer::capture::GpuCapture;
use crate::renderer::frame::Blending;
use crate::renderer::shaders::ColorPrecision;
use crate::view::{Appearance, Background, BlendSpace, DebugView, View};
use glam::UVec2;

/// A capture in a view. The view includes the transform of the capture and the capture's own time.
#[derive(Debug, Clone, Copy)]
pub struct Instance<'a> {
    /// The capture.
    pub capture: &'a GpuCapture,
    /// The list of the Gaussians that are drawn, prepared for the view's time and recorded before the view. If `None`, all Gaussians are
    /// drawn.
    pub active: Option<&'a ActiveList>,
    /// Camera and time, with the transform of the capture.
    pub view: View,
    /// Opacity, light and crop of the capture.
    pub appearance: Appearance,
}

impl Instance<'_> {
    /// Returns the number of Gaussians of a part that its list has; all without a list.
    pub(in crate::renderer) fn listed(&self, part: usize) -> u32 {
        listed_count(self.capture, part, self.active, None)
    }

    /// Returns the number of Gaussians of a part that are projected: the first ones of those that are
    /// [listed](Self::listed), as many as the thinning needs.
    pub(in crate::renderer) fn drawn(&self, part: usize) -> u32 {
        let prefix = self.capture.prefixes.needed(self.appearance.thinning.least);
        listed_count(self.capture, part, self.active, prefix)
    }

    /// Returns whether one dispatch can draw this instance and the next: of the same capture, which has one part, both draw all Gaussians, or
    /// both have a list, in one buffer.
    pub(in crate::renderer) fn joins(&self, next: &Self) -> bool {
        let reads_alike = match (self.active, next.active) {
            (None, None) => true,
            (Some(active), Some(other)) => active.is_beside(other),
            _ => false,
        };
        std::ptr::eq(self.capture, next.capture) && self.capture.parts.len() == 1 && reads_alike
    }
}

/// The background and the opaque surfaces of a view, and how its captures are shown.
#[derive(Debug, Clone, Copy)]
pub struct ViewParameters<'a> {
    /// The background behind the captures. Default: [`Background::None`].
    pub background: Background,
    /// The opaque surfaces that hide splats. If given, an environment map hides the picture behind it. Default: `None`.
    pub opaque: Option<OpaqueDepth<'a>>,
    /// The space in which the captures are blended. Default: [`BlendSpace::Encoded`].
    pub blend_space: BlendSpace,
    /// The quantity of the captures that is shown. Default: [`DebugView::Color`].
    pub debug: DebugView,
    /// Whether expected and median depth are computed; drawing without depths is faster. Default: `true`.
    pub depths: bool,
    /// Precision of the color target. Default: [`ColorPrecision::Single`].
    pub precision: ColorPrecision,
    /// The view of each instance in the previous frame, in the order of the instances, with camera, transform and time of that frame. An
    /// instance without a previous view, or with another kind of lens in the previous frame, has no motion. If given,
    /// [motions](crate::renderer::view::ViewRenderer::motion) are computed. Default: `None`.
    pub previous: Option<&'a [View]>,
}

impl Default for ViewParameters<'_> {
    fn default() -> Self {
        let (blend_space, debug, precision) = Default::default();
        Self { background: Background::None, opaque: None, blend_space, debug, depths: true, precision, previous: None }
    }
}

impl ViewParameters<'_> {
    /// Returns the variant of `blend_blocks` that these parameters need.
    pub(in crate::renderer) fn blending(&self) -> Blending {
        let samples = self.opaque.map_or(0, |opaque| opaque.samples);
        let color = match self.debug {
            DebugView::Color | DebugView::Active | DebugView::Lifespan | DebugView::Velocity => !self.depths,
            DebugView::Depth | DebugView::Overdraw => false,
        };
        match samples {
            0 if color => Blending::Color,
            1 if color => Blending::ColorBehindSurfaces,
            _ if color => Blending::ColorBehindSamples,
            0 | 1 => Blending::All,
            _ => Blending::AllMultisampled,
        }
    }
}

/// The depth of opaque surfaces that hide splats, pixel by pixel.
#[derive(Debug, Clone, Copy)]
pub struct OpaqueDepth<'a> {
    /// A `Depth32Float` texture, 0 where there is no surface.
    pub texture: &'a wgpu::TextureView,
    /// Number of samples per pixel. A splat is hidden in the fraction of a pixel whose samples are in front of it.
    pub samples: u32,
    /// Corner of the view in the texture, pixels.
    pub origin: UVec2,
    /// From texture depth `d` to camera space: `[a, b, c, e]` in `z = (a + b d) / (c + e d)`. Reverse-z with an infinite far plane is
    /// `[near, 0, 0, 1]`.
    pub distance: [f32; 4],
}
