//! The math of a native 4D Gaussian.
//!
//! In: trained parameters ([`Parameters`], raw) and a camera at a time ([`View`](crate::view::View)). Out: the runtime
//! form ([`Gaussian`], sliced once) and, per view, a splat: its `projection`, its color (`harmonics`), the tiles that
//! it covers (`overlap`) and its opacity at a pixel (`alpha`); its `importance` for pictures.
//!
//! A native 4D Gaussian is exactly a 3D Gaussian in straight-line motion under a Gaussian opacity envelope. With the 4D
//! covariance `Σ = [[A, c], [cᵀ, v]]`:
//!
//! ```text
//! mean(t)     = μ + (c/v)(t − μ_t)          a constant velocity c/v
//! covariance  = A − c cᵀ/v                  independent of t
//! marginal(t) = exp(−½ (t − μ_t)²/v)        a factor on the opacity
//! ```

pub(crate) mod alpha;
pub(crate) mod axes;
pub(crate) mod conic;
pub(crate) mod eigen;
pub(crate) mod gradient;
pub(crate) mod harmonics;
pub(crate) mod importance;
mod lifespan;
pub(crate) mod outer;
pub(crate) mod overlap;
mod parameters;
pub(crate) mod projection;
pub(crate) mod rotate_harmonics;
pub(crate) mod slice;

pub use gradient::GradientMode;
pub(crate) use gradient::{GradientSettings, ParameterGradient, SplatGradient, parameter_gradient};
pub use harmonics::{Harmonics, ShDirection};
pub(crate) use lifespan::lifespan_reach;
pub use lifespan::{Lifespan, MARGINAL_CUTOFF, SMALLEST_CUTOFF};
pub use parameters::{Model, Parameters};
pub(crate) use slice::rotation_4d;
pub use slice::{Gaussian, InvalidGaussian, SliceSettings};
