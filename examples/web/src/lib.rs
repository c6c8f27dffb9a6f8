//! What the two players of a page have in common: a file that is opened in steps, and what the page is told about its
//! capture.
//!
//! In: the name and the bytes of a file. Out: a scene ready to draw, and an [`About`]. The players are
//! `src/bin/player.rs`, the renderer alone, and `src/bin/player_bevy.rs`, a Bevy app.

mod about;
mod faults;
mod opening;
mod pose;

pub use about::About;
pub use faults::{Faults, panic_message, report_panics};
pub use opening::{Opening, OpeningStep};
pub use pose::view;
