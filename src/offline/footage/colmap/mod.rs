//! Poses and points by the installed COLMAP.
//!
//! In: pictures of cameras that stand still, one a camera for each moment. Out: the cameras with their poses and lenses
//! (`poses`), or, if these are known, the points that the matches of a moment show (`triangulate`).
//!
//! | file | subject |
//! |---|---|
//! | `program` | finds the command line of COLMAP, 3.8 to 4, and runs its steps |
//! | `package` | the Python package `pycolmap`, which has no command line, in its place |
//! | `matches` | the folder of a moment: pictures, features, matches |
//! | `poses`, `triangulate` | what is made of the matches |

mod error;
mod matches;
mod package;
mod poses;
mod program;
#[cfg(test)]
mod tests;
mod triangulate;

pub use error::ColmapError;
pub(crate) use poses::calibrate;
pub(crate) use program::Program;
pub(crate) use triangulate::triangulated;
