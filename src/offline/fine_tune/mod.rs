//! Fine-tuning: training what pruning has left, so that it makes up for what was removed.
//!
//! In: a scene in the trained form, its training views with their images, [`FineTuneSettings`]. Out: the scene with the best parameters that
//! were found ([`FineTuned`]), and how its quality developed. The number of Gaussians stays.
//!
//! The best step is chosen on validation views, which are not trained on; without validation views, the last step is kept. The loss is `0.9 L1 + 0.1 (1 − SSIM)` unless set otherwise, with further [`Terms`]
//! if these have weights, the optimizer Adam (section 6 of the 4DGS model). Views, backgrounds and rates of a step follow from its number
//! alone, so that a run which is resumed ends as one which was not interrupted.
//! Training from pictures alone (`offline::train`) is the same with [`Growth`]: Gaussians that fade move to others, or, for comparison with the
//! original, Gaussians are cloned, split and removed within a fixed capacity.
//!
//! If the scene is compressed, further steps train codebooks of color with everything else, on request on pictures of rounded geometry.

pub(crate) mod adam;
mod backward;
mod best;
pub(crate) mod cloner;
pub(crate) mod cloning;
mod coding;
pub(crate) mod dropout;
pub(crate) mod environment_backward;
pub(crate) mod exposure;
mod grower;
mod grown;
pub(crate) mod growth;
pub(crate) mod loss;
pub(crate) mod neighbors;
pub(crate) mod noise;
mod obstacle;
mod optimized;
mod outcome;
mod parameters;
mod passes;
mod phases;
mod places;
mod prefetch;
mod preview;
mod random_words;
mod records;
mod regularizer;
pub(crate) mod relocation;
mod resume;
mod room;
mod rounding;
mod run;
pub(crate) mod sample;
mod schedule;
mod settings;
pub(crate) mod state;
mod targets;
pub(crate) mod terms;
mod tied;
pub(crate) mod totals;
mod trained_environment;
mod trained_exposure;
pub(crate) mod trainer;
mod trainer_error;
mod training;
mod view_buffers;

pub(crate) use growth::Cloning;
pub use growth::Growth;
pub(crate) use obstacle::obstacle;
pub use outcome::{CurvePoint, FineTuned};
pub use phases::fine_tune;
pub(crate) use phases::fine_tune_watched;
pub use resume::Resume;
pub(crate) use room::require_room;
pub(crate) use sample::{GpuImage, Sample};
pub use schedule::{Behind, Rates};
pub use settings::FineTuneSettings;
pub use targets::{ImageRoom, TrainingImages};
pub use terms::Terms;
pub(crate) use trainer::Trainer;
pub use trainer_error::TrainerError;
pub(crate) use training::Scene;
pub(crate) use view_buffers::require_bindings;
