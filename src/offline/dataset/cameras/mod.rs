//! Cameras as files describe them, and the pictures that they take.
//!
//! In: sizes, lenses, poses and times of a file, in double precision and its own coordinates. Out: views in single
//! precision, counted from an origin.

pub(crate) mod axes;
pub(crate) mod camera_options;
pub(crate) mod clock;
pub(crate) mod distortion;
pub(crate) mod drawing;
pub(crate) mod frame;
pub(crate) mod lens;
pub(crate) mod lens_matrix;
pub(crate) mod opencv;
pub(crate) mod origin;
pub(crate) mod placing;
pub(crate) mod pose;
pub(crate) mod resample;
pub(crate) mod size;
