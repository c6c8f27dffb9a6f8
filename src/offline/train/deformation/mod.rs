//! Views between the images of one camera: a capture that deforms, and what it shows at other times from other places.
//!
//! In: training images of which each shows a moment of its own. Out: further [`TrainingView`](crate::offline::dataset::TrainingView)s, whose images are
//! drawn here: the native 4D Gaussians are trained on them beside the images. Where each moment is seen by one camera, nothing else tells native
//! Gaussians, which move on straight lines and independently of each other, what a moment looks like from elsewhere. One set of Gaussians that deforms
//! smoothly learns the shape from all images.
//!
//! | file | subject |
//! |---|---|
//! | `canonical` | the Gaussians in canonical space, and their optimizer |
//! | `nodes` | nodes that move through time on splines |
//! | `skin` | how Gaussians follow nodes |
//! | `rigidity` | the term of the loss that keeps neighboring nodes in place |
//! | `window` | the views that a step sees, from the middle of time outwards |
//! | `fitting` | the training of all of these |
//! | `drawn` | the views that are drawn, and their files |
//! | `native` | native Gaussians that move as the deformation does, to begin with |
//!
//! A step deforms the Gaussians to the moment of its view, has the [`Trainer`](crate::offline::fine_tune::Trainer) draw these and return gradients,
//! and carries the gradients back to canonical Gaussians and nodes on the CPU.

mod canonical;
mod drawn;
mod fitting;
mod native;
mod nodes;
mod rigidity;
mod skin;
mod window;

pub(super) use drawn::{Drawing, Drawn};
pub(super) use fitting::fit;
pub(super) use native::Extent;
