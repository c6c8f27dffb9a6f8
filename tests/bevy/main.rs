//! The Bevy plugin, in apps without a window, and the examples as programs.
//!
//! In: scenes made here, `assets/`, and the trained captures where `GS4D_DATA` names their folder. Out: one test
//! binary. The header of each module describes its tests. Tests that draw are skipped without a GPU; a software driver
//! is enough.

mod animation;
mod app;
mod assets;
mod budget;
mod colliders;
mod composition;
mod detail;
mod edited_file;
mod examples;
mod failures;
mod film;
mod frame_time;
mod glass;
mod golden;
mod imports;
mod inactive;
mod inspector;
mod late_hits;
mod loading;
mod motion;
mod one_file;
mod own_shadows;
mod picker;
mod picking_backend;
mod playback;
mod plugins;
mod processed;
mod reflection;
mod released;
mod replaced_file;
mod scenes;
mod shade;
mod shadows;
mod sockets;
mod sound;
mod steady;
mod stereo;
mod stream;
mod testing;
mod timeline;
mod views;
mod walkthrough;

#[path = "../support"]
mod support {
    pub mod asset_app;
    pub mod blob;
    pub mod byte_range;
    pub mod cpu_reference;
    pub mod data;
    pub mod event_log;
    pub mod fixtures;
    pub mod flat;
    pub mod gated_files;
    pub mod gpu;
    pub mod gray;
    pub mod limited_app;
    pub mod logged;
    pub mod no_gpu;
    pub mod npy;
    pub mod npz;
    pub mod offscreen_app;
    pub mod pipelines;
    pub mod playback_app;
    pub mod pth;
    pub mod random;
    pub mod range_server;
    pub mod skip;
    pub mod spans;
    pub mod split;
    pub mod waiting;
    pub mod warning_layer;
    pub mod wave;
}
