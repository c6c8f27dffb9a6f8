//! Colliders: closed meshes of the solid parts of a capture.
//!
//! In: a capture. Out: its [`Colliders`](crate::scene::Colliders): a mesh of what never moves, and one for each stretch
//! of time of what moves.
//!
//! | file | subject |
//! |---|---|
//! | `settings` | what the caller chooses |
//! | `clip` | the stretches of time of a capture, and the moments at which it is looked at |
//! | `drawn` | the Gaussians that are drawn at some time, and the box that holds most of them |
//! | `grid` | the cells of a box |
//! | `occupancy` | how opaque each cell is at a moment |
//! | `solid` | sets of cells: gaps are closed, holes are filled, specks are dropped |
//! | `standing` | what never moves, and what else is solid |
//! | `mesh` | the surface of a set of cells, simplified |
//! | `stretches` | all of this over the time of a capture |

mod clip;
mod drawn;
mod error;
mod grid;
mod mesh;
mod occupancy;
mod settings;
mod solid;
mod standing;
mod stretches;

pub use error::CollideError;
pub use settings::CollideSettings;
pub use stretches::{Collided, collide};
