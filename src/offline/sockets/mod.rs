//! Sockets: named points that follow what they were placed on.
//!
//! In: a capture, a point in it at a time. Out: a [`Socket`](crate::scene::Socket), whose frame moves with the
//! Gaussians around the point, forward and backward, with an estimate of its error; the times at which it is lost.
//!
//! | file | subject |
//! |---|---|
//! | `neighbors` | the Gaussians that are drawn near a point at a time |
//! | `motion` | the rigid motion that the velocities of neighbors agree on |
//! | `look` | the colors around a point, which tell whether what it was placed on is still there |
//! | `follow` | steps along these motions, over the whole time of a capture |

mod error;
mod follow;
mod look;
mod motion;
mod neighbors;

pub use error::SocketError;
pub use follow::{Followed, Placement, follow};
