//! Tests that need neither a GPU nor Bevy: files, scenes, maths and the CPU reference; with the feature `offline` also
//! datasets, metrics, scores and quantization.
//!
//! In: scenes, files and pictures made here, `tests/golden/`, and the trained captures if `GS4D_DATA` names their
//! folder. Out: one test binary. The header of each module describes its tests.

mod antialias;
mod beginning;
mod checkpoint;
mod checkpoint_poison;
#[cfg(feature = "offline")]
mod dataset;
mod exports;
mod formats_ply;
#[cfg(feature = "fourdgs")]
mod fourdgs;
mod golden;
mod gradients;
mod grow;
#[cfg(feature = "offline")]
mod identical_views;
mod import_motion;
mod import_pictures;
mod kinds_of_files;
#[cfg(feature = "offline")]
mod loading;
#[cfg(feature = "offline")]
mod memory_limits;
#[cfg(feature = "offline")]
mod metrics;
mod other_checkpoints;
mod package;
mod pick;
#[cfg(feature = "offline")]
mod quantize;
mod rings;
#[cfg(feature = "offline")]
mod scale;
mod scene_parts;
#[cfg(feature = "offline")]
mod score;
#[cfg(feature = "offline")]
mod score_formula;
mod sog;
#[cfg(feature = "sound")]
mod sounds;
mod splatv;
mod spz_and_gltf;
mod thin;
mod thinning;

#[path = "../support"]
mod support {
    #[cfg(feature = "offline")]
    pub mod allocations;
    pub mod blob;
    pub mod bundled;
    pub mod coded_scene;
    pub mod data;
    pub mod golden;
    pub mod golden_gradients;
    pub mod gray;
    pub mod gzip;
    #[cfg(feature = "offline")]
    pub mod npy;
    #[cfg(feature = "sound")]
    pub mod ogg;
    pub mod other_makes;
    #[cfg(feature = "offline")]
    pub mod own_process;
    pub mod package_parts;
    #[cfg(feature = "offline")]
    pub mod packed_scene;
    pub mod psnr;
    pub mod pth;
    pub mod random;
    pub mod skip;
    pub mod thin;
    pub mod trained;
    #[cfg(feature = "sound")]
    pub mod wave;
}
