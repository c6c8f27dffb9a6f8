//! Tests of the renderer without Bevy, and of individual shaders.
//!
//! In: scenes and buffers made by the tests, `tests/golden/`, the files of `shaders/`. Out: one test binary. The header
//! of each module describes its tests. Tests that need a device are skipped if there is neither a GPU nor a software
//! driver.

mod appearance;
mod bake;
mod crowds;
mod depths_alone;
mod designs;
mod detail;
mod filter;
mod fine_tune;
mod fine_tune_run;
mod flipbook;
mod golden;
mod hidden;
mod layout;
#[cfg(target_os = "linux")]
mod memory;
mod motion;
mod packed;
mod pages;
mod passes;
mod render;
mod score;
mod shaders;
mod thin;
mod tile_bins;
mod train;
mod train_parts;
mod train_repair;
mod train_standing;
mod uniformity;

#[path = "../support"]
mod support {
    pub mod blob;
    pub mod capture;
    pub mod composed;
    pub mod dataset;
    pub mod depth_texture;
    pub mod golden;
    pub mod gpu;
    pub mod interrupting;
    pub mod limited_device;
    pub mod no_gpu;
    #[cfg(target_os = "linux")]
    pub mod own_process;
    pub mod packed_scene;
    pub mod passes;
    pub mod random;
    pub mod skip;
    pub mod surfaces;
    pub mod texture_bytes;
    pub mod thin;
    pub mod trained;
    pub mod training;
}
