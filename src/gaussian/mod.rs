//! The maths of a native 4D Gaussian.
//!
//! In: trained parameters ([`Parameters`], raw) and a camera at a time ([`View`](crate::view::View)). Out: the runtime
//! form ([`Gaussian`], sliced once) and, per view, a splat: its [`projection`], its color ([`harmonics`]), the tiles
//! that it covers ([`overlap`]) and its opacity at a pixel ([`alpha`]).
//!
//! A native 4D Gaussian is exactly a 3D Gaussian in straight-line motion under a Gaussian opacity envelope. With the 4D
//! covariance `Σ = [[A, c], [cᵀ, v]]`:
//!
//! ```text
//! mean(t)     = μ + (c/v)(t − μ_t)          a constant velocity c/v
//! covariance  = A − c cᵀ/v                  independent of t
//! marginal(t) = exp(−½ (t − μ_t)²/v)        a factor on the opacity
//! ```

pub mod alpha;
pub(crate) mod eigen;
mod gradient;
pub mod harmonics;
mod lifespan;
pub mod overlap;
mod parameters;
pub mod projection;
mod slice;

pub use gradient::{
    GradientMode, GradientSettings, ParameterGradient, SplatGradient, parameter_gradient, slice_gradient,
};
pub use harmonics::{Harmonics, ShDirection};
pub(crate) use lifespan::LIFESPAN;
pub use lifespan::{Lifespan, MARGINAL_CUTOFF};
pub use parameters::{Model, Parameters};
pub use slice::{Gaussian, InvalidGaussian, SliceSettings, rotation_4d};
