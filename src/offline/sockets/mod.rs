//! Sockets: named points that follow what they were placed on.
//!
//! In: a capture, a point in it at a time. Out: a [`Socket`](crate::scene::Socket), whose frame moves with the
//! Gaussians around the point, forward and backward, with an estimate of its error; the times at which it is lost. Of
//! points whose tracks are known: how far from these tracks such sockets are.
//!
//! | file | subject |
//! |---|---|
//! | `neighbors` | the Gaussians that are drawn near a point at a time |
//! | `motion` | the rigid motion that the velocities of neighbors agree on |
//! | `look` | the colors around a point, which tell whether what it was placed on is still there |
//! | `follow` | steps along these motions, over the whole time of a capture |
//! | `known_point` | points of a scene whose tracks are known, on disk |
//! | `compare` | how far from such tracks points are that are followed |

mod compare;
mod error;
#[cfg(test)]
mod fixture;
mod follow;
mod known_point;
mod look;
mod motion;
mod neighbors;

pub use compare::{Compared, Comparison, compare};
pub use error::SocketError;
pub use follow::{Followed, Placement, follow};
pub use known_point::KnownPoint;
