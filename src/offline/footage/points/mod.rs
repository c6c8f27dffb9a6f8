//! Points with colors, times and velocities, with which a 4D training begins.
//!
//! In: standing cameras, the pictures and motion masks of every moment, the background plates. Out: [`TakePoints`] and
//! their PLY file.
//!
//! | file | subject |
//! |---|---|
//! | `projection` | the pixel of a place and the place of a pixel |
//! | `backdrop` | what stands before a camera, and hides what moves behind it |
//! | `cells` | sets of cubes in Morton order: subdivision, surface, clusters |
//! | `moving_hull` | the visual hull of the motion masks of a moment |
//! | `hull_colors` | the colors of a hull |
//! | `surface_points` | the points of the surface of a hull, in clusters, and fewer of them |
//! | `neighbors` | the nearest of many points |
//! | `velocity` | the velocities of points, from the moments before and after |
//! | `sweep` | depths of a picture that its neighbors agree with, as points |
//! | `filling` | depths between those that are known |
//! | `patch` | the correlation of two pictures where a plane shows in both |
//! | `cloud` | all of this for a take |
//! | `ply_file` | the file |

mod backdrop;
mod cells;
mod cloud;
mod filling;
#[cfg(test)]
mod fixture;
mod hull_colors;
mod moving_hull;
mod neighbors;
mod patch;
mod ply_file;
mod projection;
mod surface_points;
mod sweep;
mod velocity;

pub(crate) use backdrop::Backdrop;
pub(crate) use cloud::{Masked, TakePoints, moving_points};
pub(crate) use ply_file::write;
pub(crate) use sweep::{Plate, Standing, standing};
