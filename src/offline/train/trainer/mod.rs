//! The trainer: one step of training on the GPU, with the optional parts that a run asks for.
//!
//! In: a scene in the trained form, images with their views. Out: the scene after some steps, its gradients, its state.
//!
//! | file | subject |
//! |---|---|
//! | `step` | the passes of a step, in their order |
//! | `scene` | pictures of the scene, the scene and its gradients |
//! | `state` | what a resumed run goes on from |
//! | `repair` | Gaussians that are replaced or hidden between steps |
//! | `results` | losses and faults, and results of optional parts that are not in the scene |

mod repair;
mod results;
mod scene;
pub(crate) mod state;
pub(crate) mod step;

pub(crate) use state::TrainerState;
pub(crate) use step::Trainer;
