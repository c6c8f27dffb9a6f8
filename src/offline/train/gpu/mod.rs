//! The buffers and passes on the GPU that every training has.
//!
//! In: a scene in the trained form, images with their views. Out: the [`Workspace`] of the trainer and its optional
//! parts; the buffers of a view, and commands of the passes after its picture.

pub(crate) mod backward;
pub(crate) mod optimized;
pub(crate) mod parameters;
pub(crate) mod passes;
pub(crate) mod records;
pub(crate) mod sample;
pub(crate) mod totals;
pub(crate) mod view_buffers;
pub(crate) mod workspace;

pub(crate) use backward::Backward;
pub(crate) use optimized::{Optimized, Quantity};
pub(crate) use parameters::ParameterChunk;
pub(crate) use sample::{GpuImage, Sample};
pub(crate) use totals::{Faults, Totals};
pub(crate) use view_buffers::{RecordedView, require_bindings};
pub(crate) use workspace::Workspace;
