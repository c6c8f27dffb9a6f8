//! Dynamic captures in Bevy games: native 4D Gaussian Splatting, played to the pixel.
//!
//! In: a trained capture, as a trainer's checkpoint (`.pth`) or as a package (`.gs4d`). Out: what it looks like at any moment from
//! any camera, in a Bevy app or in pictures on disk. A game needs the [`prelude`] and nothing else; the rest of this page is the
//! architecture, in the order in which the data travels.
//!
//! # From a file to the GPU: once for each capture
//!
//! ```text
//!  chkpnt30000.pth      capture.gs4d ◀────────┐
//!         │                   │               │
//!         ▼                   ▼               │
//!  codec::checkpoint    codec::package ───────┤ codec::save
//!         └─────────┬─────────┘               │
//!                   ▼                         │
//!         scene::GaussianScene ───────────────┘
//!                   │ into_runtime: gaussian slices every Gaussian
//!                   ▼
//!         scene::RuntimeScene ──────▶ asset::GaussianCapture   (Bevy: shared by entities)
//!                   │                           │ render: upload
//!                   ▼                           ▼
//!            gpu::GpuCapture             gpu::GpuCapture
//! ```
//!
//! 1. [`codec`] reads a file into a scene, or refuses it in plain words: [`codec::checkpoint`] through a restricted unpickler,
//!    [`codec::package`] with a checksum on every byte. [`codec::load`] tells the two apart; [`codec::save`] writes a package.
//! 2. [`scene`] is what a capture is: its Gaussians in the trained, the runtime or the packed form, their colour, an environment map, the
//!    switches it was trained with, and how it is meant to be played.
//! 3. [`gaussian`] is the maths. [`Parameters::slice`](gaussian::Parameters::slice) makes the runtime form, once: a 3D Gaussian in
//!    straight-line motion under an opacity envelope ([`Gaussian`](gaussian::Gaussian), 64 bytes, the record that shaders read too).
//! 4. [`gpu::GpuCapture`] holds that form, or the packed one, in buffers. In Bevy, [`asset`] loads the file in the background and [`render`] uploads it.
//!
//! # From the GPU to pixels: once for each frame and camera
//!
//! ```text
//!      Bevy                                                   without Bevy
//!
//!      Time, a Timeline                                       dataset::CameraFile, an orbit
//!        ▼                                                             │
//!  playback::Playback    cameras, transforms                           │
//!        └───────┬────────────┘                                        │
//!                ▼                                                     ▼
//!  render: extract, prepare ───────▶  gaussian::View  ◀───── gaussian::Camera
//!                │                          │
//!                ▼ once for all cameras     │
//!          gpu: activate ──▶ gpu::ActiveList│
//!                                           ▼
//!          gpu: one compute pass
//!          ┌────────────────────────────────────────────────────────────┐
//!          │ project ─▶ sort ─▶ bin ─▶ sort ─▶ ranges ─▶ blend          │
//!          │ splats     depth   pairs  tile    of tiles  colour, depth  │
//!          └────────────────────────────────────────────────────────────┘
//!                                           │
//!                ┌──────────────────────────┴──────────────────────────┐
//!                ▼                                                     ▼
//!  render: composite into the camera's target              gpu::Headless: frame::Frame
//! ```
//!
//! 1. [`playback`] moves each entity's clock on, or a timeline or a shared clock does; a [`View`](gaussian::View) is one camera at one time. In Bevy [`render`] makes
//!    it from cameras and transforms, elsewhere a [`Camera`](gaussian::Camera) does.
//! 2. [`gpu`] draws views with plain wgpu, on whatever device it is given; it knows nothing of Bevy. `activate` lists what the temporal
//!    filter leaves, only when a capture enters another segment of time. All captures in a view share one compute pass, so that
//!    they interleave by depth. Its size is decided on the GPU: nothing is read back inside a frame.
//! 3. Inside `blend` the depth of opaque meshes cuts the splats, pixel by pixel. The composite lays the result over what the
//!    camera has drawn so far; it and `write_depth` are the passes in Bevy's pipeline cache.
//! 4. [`gpu::Headless`] hands the result over as a [`Frame`](frame::Frame) instead. The `gs4d` command and the tests use it.
//!
//! Each pass from `project` to `blend` has one name everywhere: `shaders/project.wgsl`, the function in [`mod@reference`], the timestamp
//! span (`sort` has two: by depth, by tile), the tests.
//!
//! # Around it, for games
//!
//! [`asset`] tells what became of loading, also of hot reloads. [`picking`] finds the Gaussian under a ray. [`stereo`] gives a head
//! two eyes. `viewer` is a panel that shows and changes all of this, `testing` renders an app to pictures without a window.
//! The guide, `docs/guide.md`, goes through them in the order in which a game meets them.
//!
//! # From a checkpoint to a small capture
//!
//! [`compress`] is the offline half: what each Gaussian is worth ([`compress::score`]), which stay ([`compress::prune`]), which are
//! active when ([`compress::masks`]), how few bytes they need ([`compress::pack`]). `gs4d bake` calls them in order and reports.
//!
//! # How it is known to be right
//!
//! * [`mod@reference`] is the CPU twin of the passes from `project` to `blend`, and of `score`: plain functions over slices. The tests
//!   hold it against the original code's numbers, and the GPU against both.
//! * [`dataset`] reads training views as the trainer does; [`metrics`] are PSNR and SSIM as the original evaluates them, MS-SSIM and
//!   FLIP, over [`picture`]s.
//!
//! # Features
//!
//! | feature | adds |
//! |---|---|
//! | none | `gaussian`, `scene`, `codec`, `compress`, `dataset`, `metrics`, `reference`, `frame`, `picture`: no GPU, no Bevy |
//! | `gpu` | [`gpu`]: the renderer, on wgpu |
//! | `bevy` (default) | [`asset`], [`playback`], [`render`], [`picking`], [`stereo`], [`prelude`]; implies `gpu` |
//! | `cli` | the `gs4d` command; implies `gpu`, never compiles Bevy |
//! | `testing` | `testing`: Bevy apps without a window, drawn into pictures; implies `bevy` |
//! | `viewer` | `viewer`: a panel to watch and steer captures with, and a window and lit meshes for the examples; implies `testing` |
//! | `openxr` | the example `walkthrough` for a headset; implies `viewer` |
#![cfg_attr(
    not(feature = "bevy"),
    expect(rustdoc::broken_intra_doc_links, reason = "the Bevy side is not part of this build")
)]

#[cfg(feature = "cli")]
pub mod cli;
pub mod codec;
pub mod gaussian;
#[cfg(feature = "offline")]
pub mod offline;
#[cfg(feature = "bevy")]
pub mod plugin;
#[cfg(feature = "bevy")]
pub mod prelude;
pub mod reference;
#[cfg(feature = "renderer")]
pub mod renderer;
pub mod scene;
pub mod view;

#[cfg(feature = "bevy")]
#[doc(no_inline)]
pub use plugin::*;

/// The README, whose code must compile.
#[cfg(all(doctest, feature = "bevy"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The guide, likewise.
#[cfg(all(doctest, feature = "bevy"))]
#[doc = include_str!("../docs/guide.md")]
struct Guide;
