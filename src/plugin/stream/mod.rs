//! Captures of minutes, streamed: only what is played next is in memory.
//!
//! In: a capture whose file is the index of chunk files beside it or after it in one file, as `gs4d split` writes it,
//! from any Bevy asset source; the [`Playback`](crate::playback::Playback) of its entities; a [`StreamBudget`]. Out:
//! the Gaussians of the time that is played, drawn; [`CaptureStreamState`], and messages.
//!
//! ```text
//! index.gs4d ──▶ GaussianCapture with a table of files
//!                       │                     Playback, cameras, StreamBudget
//!                       ▼                                │
//!  chunk files ──▶ fetch_files ◀─────────────────────────┘        which files are there: codec::stream
//!                       │
//!                       ▼
//!                  show_pictures ──▶ StreamedPicture: the time that is drawn, CaptureStreamState, messages
//!                       │
//!                       └──────────▶ Stall: time waits
//! ```
//!
//! A game spawns the index as any other capture, plays it and seeks in it. Each file has the Gaussians that are only
//! drawn within some stretches of time, and of these one layer: the most important ones are loaded first, so that a
//! picture is coarse before it is whole, and black only while nothing has been loaded.
//! [`crate::codec::stream`] decides which files are loaded and given up; it has no I/O, and players without Bevy use it
//! as well.

mod faults;
mod heads;
#[cfg(feature = "http_ranges")]
mod http_ranges;
#[cfg(feature = "http_ranges")]
mod http_request;
mod messages;
mod pictures;
mod plugin;
mod settings;
mod shares;
mod state;
mod streams;

#[cfg(feature = "http_ranges")]
pub use http_ranges::HttpRangesPlugin;
pub use messages::{CaptureBuffered, CaptureBuffering, CaptureStalled};
pub use plugin::{CaptureStreamPlugin, CaptureStreamSystems};
pub use settings::{CaptureStreamSettings, OnUnderrun, StreamBudget};
pub use state::CaptureStreamState;
