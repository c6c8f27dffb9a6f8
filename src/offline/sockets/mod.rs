//! Sockets: named points that follow what they were placed on.
//!
//! In: a capture, a point in it at a time. Out: a [`Socket`](crate::scene::Socket), whose frame moves with the
//! Gaussians around the point, forward and backward, with an estimate of its error; the times at which it is lost. Of
//! points whose tracks are known: how far from these tracks such sockets are.
//!
//! | file | subject |
//! |---|---|
//! | `cloud` | the Gaussians of a capture that can be followed |
//! | `moment` | what is there at a time, by place |
//! | `surface` | the surfaces of what is drawn, as they are seen from all around |
//! | `means` | the means of Gaussians, of those that move as what is around them |
//! | `graph` | a deformation graph of what is around a point, which moves as rigidly as it can |
//! | `registration` | how what was drawn at the start is pulled to what is drawn at another time |
//! | `shape` | graph and registration together: what is around a point, moved from time to time |
//! | `small` | a small thing in the air around a point, moved from time to time |
//! | `part` | what a point is on: a small thing or a shape |
//! | `look` | the colors around a point, which tell whether what it was placed on is still there |
//! | `follow` | the track of a point over the whole time of a capture, and the ways back |
//! | `known_point` | points of a scene whose tracks are known, on disk |
//! | `compare` | how far from such tracks points are that are followed |

mod cloud;
mod compare;
mod error;
#[cfg(test)]
mod fixture;
mod follow;
mod graph;
mod known_point;
mod look;
mod means;
mod moment;
mod part;
mod registration;
mod shape;
mod small;
mod surface;

pub use compare::{Compared, Comparison, compare};
pub use error::SocketError;
pub use follow::{Followed, Placement, follow};
pub use known_point::KnownPoint;
