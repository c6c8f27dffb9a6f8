//! The `gs4d` command, run as a user runs it.
//!
//! In: command lines, scenes and datasets made here, and the trained captures if `GS4D_DATA` names their folder. Out:
//! one test binary. The header of each module names the verbs that it tests.

mod bad_footage;
mod bake;
mod collide;
mod command;
mod compare;
mod compress;
mod dataset;
mod detail;
mod edit;
mod eval;
mod export;
// Faults need `/dev/full` and the limits of a shell, which Linux has.
#[cfg(target_os = "linux")]
mod faults;
mod fine_tune;
mod fleet;
mod footage;
mod imports;
mod join;
#[cfg(target_os = "linux")]
mod kills;
mod options;
mod outputs;
#[cfg(target_os = "linux")]
mod plan;
mod prune;
mod remedies;
mod render;
#[cfg(target_os = "linux")]
mod shards;
#[cfg(target_os = "linux")]
mod signals;
// The limit of the address space is set by a shell and read from `/proc`.
#[cfg(target_os = "linux")]
mod sizes;
mod socket;
mod sound;
mod train;

#[path = "../support"]
mod support {
    pub mod capture;
    pub mod command;
    pub mod data;
    pub mod dataset;
    pub mod folders;
    pub mod no_gpu;
    pub mod npy;
    pub mod npz;
    pub mod package_parts;
    pub mod pth;
    #[cfg(target_os = "linux")]
    pub mod random;
    pub mod skip;
    #[cfg(target_os = "linux")]
    pub mod small_capture;
    pub mod wave;
}
