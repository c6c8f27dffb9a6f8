//! What the last pass of a frame writes.
//!
//! In: the targets and the opaque surfaces of a view. Out: [`Blending`], and the shader definitions of `blend` and `blend_blocks`.

/// The outputs of the last pass and the opaque surfaces that it supports. If several variants can draw a picture, the results are the same;
/// the first is the fastest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Blending {
    /// Color, without opaque surfaces.
    Color,
    /// Color, hidden by opaque surfaces.
    ColorBehindSurfaces,
    /// Color, hidden by opaque surfaces with several samples per pixel.
    ColorBehindSamples,
    /// Color and depths, opaque surfaces, every debug view.
    #[default]
    All,
    /// Color and depths, multisampled opaque surfaces, every debug view.
    AllMultisampled,
}

impl Blending {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Color, Self::ColorBehindSurfaces, Self::ColorBehindSamples, Self::All, Self::AllMultisampled];

    /// Returns the definitions of the last pass.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Color => &[],
            Self::ColorBehindSurfaces => &["OPAQUE"],
            Self::ColorBehindSamples => &["OPAQUE", "MULTISAMPLED"],
            Self::All => &["DEPTHS"],
            Self::AllMultisampled => &["DEPTHS", "MULTISAMPLED"],
        }
    }

    /// Returns whether depths are written.
    pub(in crate::renderer) fn writes_depths(self) -> bool {
        matches!(self, Self::All | Self::AllMultisampled)
    }

    /// Returns whether splats that opaque surfaces hide are left out before they are sorted.
    pub(in crate::renderer) fn leaves_out_hidden(self) -> bool {
        matches!(self, Self::ColorBehindSurfaces | Self::ColorBehindSamples)
    }

    /// Returns whether the opaque depth is multisampled.
    pub(in crate::renderer) fn is_multisampled(self) -> bool {
        matches!(self, Self::ColorBehindSamples | Self::AllMultisampled)
    }
}
