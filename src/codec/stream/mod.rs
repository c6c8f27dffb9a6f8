//! Streaming: which chunk files of a capture are fetched, and which are given up, so that a capture of minutes plays
//! within fixed memory.
//!
//! In: the [`ChunkTable`](crate::scene::ChunkTable) of a capture, the [`Playhead`] of each of its players,
//! [`StreamLimits`], and which files have arrived. Out: a [`StreamPlan`] whenever the host asks for one, [`Coverage`]
//! of a time. There is no I/O here: a host, such as a game engine or a page, fetches files and frees them.
//!
//! ```text
//!  ChunkTable ───▶ StreamSchedule ◀──── arrived, failed ◀───┐
//!                        │                                  │
//!  Playheads,            ▼                                  │
//!  StreamLimits ───▶   plan ───▶ StreamPlan: fetch, give_up ───▶ host
//!                        │
//!                        └─────▶ needed_at, coverage, buffered ───▶ what is drawn
//!
//!                    the player, who plays forwards in a loop
//!                              ▼
//!  stretches of 1 s  │   0   │ ┆ 1   │   2   │   3   │   4   │   urgency
//!  layer 0           ├─────────┆─────────────────────────────┤   0.0 s   drawn now
//!  layer 0                   ├─┆─────┤                           0.0 s   drawn now
//!  layer 0                     ┆     ├───────┤                   0.75 s
//!  layer 1           ├─────────┆─────────────────────────────┤   1.5 s   drawn now
//!  layer 0                     ┆             ├───────┤           1.75 s
//!  layer 0           ├───────┤ ┆                                 3.75 s  behind the end of the loop
//! ```
//!
//! Each file has an urgency in seconds: the time until a player reaches its stretches, and 1.5 s for each layer above
//! the first, or more for a layer that adds less where that was measured (`ChunkTable::delays`), so that the most important Gaussians of the next second come before the least important ones of now. The
//! files of the smallest urgency are fetched; if the memory on the GPU is full, those of a clearly greater urgency are
//! given up for them.
//!
//! `course` is where a player goes; `urgency` follows from the courses of all players; `intervals` finds the files of
//! stretches; `ledger` counts files and bytes, in whole pages for a host whose memory on the GPU is in pages;
//! `deadlines` says when a request has taken too long, `retries` when a file that failed is asked for again; `giving_up`
//! selects files to give up; `schedule` joins them. `throughput` is how fast files arrive, by which a host sets the limits;
//! `obstacle` is why a picture may never be there.

mod course;
mod coverage;
mod deadlines;
#[cfg(test)]
mod fixture;
mod giving_up;
mod intervals;
mod ledger;
mod limits;
mod obstacle;
mod playhead;
#[cfg(test)]
mod random_steps;
mod retries;
#[cfg(test)]
mod rules;
mod schedule;
mod throughput;
mod urgency;

pub use coverage::Coverage;
pub use ledger::FileState;
pub use limits::StreamLimits;
pub use obstacle::Obstacle;
pub use playhead::{Playhead, Turn};
pub use schedule::{StreamPlan, StreamSchedule};
pub use throughput::Throughput;
