//! Pictures of a scene.
//!
//! In: a scene, its cameras or their number on an [`orbit()`]. Out: cameras with times ([`Shot`]), pictures.
//!
//! | file | subject |
//! |---|---|
//! | `orbit` | cameras around a scene |
//! | `render` | draws many views while earlier pictures are still being written |

mod error;
pub(crate) mod orbit;
pub(crate) mod render;

pub use error::DrawError;
pub use orbit::{Shot, orbit};
