//! Dynamic captures in Bevy games: native 4D Gaussian Splatting.
//!
//! In: a trained capture, as a trainer's checkpoint (`.pth`) or as a package (`.gs4d`). Out: its picture at any time
//! from any camera, in a Bevy app or in files. A game needs the [`prelude`] and nothing else; the rest of this page is
//! the architecture: the data paths, and which module may use which.
//!
//! # From a file to the GPU: once for each capture
//!
//! ```text
//!  chkpnt30000.pth      capture.gs4d ◀────────┐
//!         │                   │               │
//!         ▼                   ▼               │
//!  codec::checkpoint    codec::package ───────┤ offline::work::save
//!         └─────────┬─────────┘               │
//!                   ▼                         │
//!         scene::GaussianScene ───────────────┘
//!                   │ into_runtime: gaussian slices every Gaussian
//!                   ▼
//!         scene::RuntimeScene ──────▶ component::GaussianCapture   (Bevy: shared by entities)
//!                   │                           │ render: upload
//!                   ▼                           ▼
//!         renderer::GpuCapture        renderer::GpuCapture
//! ```
//!
//! 1. [`codec`] reads a file into a scene, or returns an error that names the fault: [`codec::checkpoint`] through a
//!    restricted unpickler, [`codec::package`] with checksums over every byte, files of other programs (PLY, SPZ, SOG,
//!    glTF and so on) through `codec::import`, which lists what is lost. [`codec::load`] recognizes the format by the
//!    contents of the file; [`offline::work::save()`] writes a file whole or not at all, and `codec::export` writes for
//!    other programs.
//! 2. [`scene`] is a capture in memory: Gaussians and their colors in the trained, the sliced or the packed form, an
//!    environment map, a temporal filter, levels of detail, the settings of the training, and hints for playback.
//! 3. [`gaussian`] is the math. [`Parameters::slice`](gaussian::Parameters::slice) makes the runtime form, once: a 3D
//!    Gaussian in straight-line motion under an opacity envelope ([`Gaussian`](gaussian::Gaussian), 64 bytes, as in the
//!    GPU buffer).
//! 4. [`renderer::GpuCapture`] holds that form, or the packed one, in buffers. In Bevy, [`asset`] loads the file in the
//!    background and [`render`] uploads it.
//!
//! # From the GPU to pixels: once for each frame and camera
//!
//! ```text
//!      Bevy                                                   without Bevy
//!
//!      Time, a Timeline                                       offline::dataset, an orbit
//!        ▼                                                             │
//!  playback::Playback    cameras, transforms                           │
//!        └───────┬────────────┘                                        │
//!                ▼                                                     ▼
//!  render: extract, prepare ─────────▶ view::View ◀─────────── view::Camera
//!                │                          │
//!                ▼ once for all cameras     │
//!     renderer: activate ─▶ ActiveList ────▶│
//!                                           ▼
//!          renderer: one compute pass, of tile bins
//!          ┌────────────────────────────────────────────────────────────┐
//!          │ project_bin ────▶ sort_bins, colors ────▶ blend_blocks     │
//!          │ splats, in bins   lists of tiles          color, depth     │
//!          └────────────────────────────────────────────────────────────┘
//!          or, on software drivers and in browsers, of the global sort
//!          ┌────────────────────────────────────────────────────────────┐
//!          │ project ─▶ sort ─▶ bin ─▶ sort ─▶ ranges ─▶ blend          │
//!          │ splats     depth   pairs  tile    of tiles  color, depth   │
//!          └────────────────────────────────────────────────────────────┘
//!                                           │
//!                ┌──────────────────────────┴──────────────────────────┐
//!                ▼                                                     ▼
//!  render: composite into the camera's target              renderer::Headless: view::Frame
//! ```
//!
//! 1. [`playback`] advances each entity's time, or a timeline or a shared clock does; a [`View`](view::View) is one
//!    camera at one time. In Bevy [`render`] makes it from cameras and transforms, elsewhere [`view::Camera`] does.
//! 2. [`renderer`] draws views with wgpu, on any device, without Bevy. `activate` lists the Gaussians that the temporal
//!    filter leaves, only when a capture enters another segment of time. All captures in a view share one compute pass,
//!    so that they interleave by depth. The GPU sizes its dispatches: nothing is read back inside a frame.
//! 3. Inside `blend` and `blend_blocks` the depth of opaque meshes cuts the splats, pixel by pixel; before
//!    `project_bin`, `find_surfaces` finds the farthest mesh of each tile, behind which splats are left out, and of the
//!    picture, behind which Gaussians are not projected. The composite draws the result over the camera's picture so
//!    far; `composite`, `write_depth` and `write_motion` are the passes in Bevy's pipeline cache.
//! 4. [`renderer::Headless`] returns the result as a [`Frame`](view::Frame) instead. The `gs4d` command and the tests
//!    use it.
//!
//! Each pass has one name everywhere: its shader (`shaders/tile_bins/project_bin.wgsl`), its pipeline and its recording
//! (`src/renderer/tile_bins/`), its timestamp span (`sort` has two: by depth, by tile), its tests. The functions in
//! [`mod@reference`] are those of the global sort; tile bins draw the same pictures. Each rule that several passes use
//! has a file in `shaders/shared/` and one in [`gaussian`]: the tiles that a splat covers (`gaussian::overlap`), its
//! alpha at a pixel (`gaussian::alpha`), its importance, by which a [`CaptureBudget`](render::CaptureBudget) thins
//! captures (`gaussian::importance`).
//!
//! # The rings
//!
//! The modules form rings. Each may use those inside it and none outside; a test reads the paths in the source and
//! fails on a path that points outwards.
//!
//! ```text
//!                          ┌──▶ codec ───────┐                ┌──▶ offline ──▶ cli
//! view ─▶ gaussian ─▶ scene                  ├──▶ renderer ───┤
//!                          └──▶ reference ───┘                └──▶ plugin
//! ```
//!
//! | ring | subject | feature |
//! |---|---|---|
//! | [`view`] | cameras, times, appearance, pictures | |
//! | [`gaussian`] | one native 4D Gaussian: slice, projection, color, the rules of overlap, alpha and importance | |
//! | [`scene`] | a capture in memory: its forms, bounds, filter, origin; picking, edits | |
//! | [`codec`] | files | |
//! | [`mod@reference`] | the renderer's passes on the CPU, as plain functions over slices | |
//! | [`renderer`] | wgpu: buffers, pipelines, one frame of a view | `renderer` |
//! | [`offline`] | training views, metrics, scores, pruning, quantization, levels of detail, reports: from a checkpoint to a small capture | `offline` |
//! | `plugin` | Bevy | `bevy` |
//! | [`cli`] | the `gs4d` command: options and printing over [`offline`] | `cli` |
//!
//! Each of the last four rings is a feature of the crate. [`codec`] and [`mod@reference`] are independent of each
//! other, as are `plugin` and [`offline`]: a game compiles neither datasets nor metrics. Code that two rings need is in
//! a ring inside both.
//!
//! * `plugin` has rings of its own, `component ▶ asset ▶ playback ▶ render, sound ▶ stream ▶ pbr, picker, stereo ▶
//!   picking_backend, inspector, testing`, of which `pbr`, `picking_backend` (feature `picking`), `inspector` and `testing` are
//!   features. The crate root re-exports them: a game writes `bevy_gs4d::playback`.
//! * A picture is a [`Picture`](view::Picture), not an `Image`: Bevy and the crate `image` have an `Image` each, and
//!   one file may need all three.
//! * `internal`, hidden here, is outside all rings: it re-exports private items for the tests and benchmarks of this
//!   crate.
//! * `score` is a pass of the offline half, not of a frame: its CPU reference and its pipelines are in
//!   [`mod@offline::score`], a client of the renderer.
//!
//! # Modules for games
//!
//! [`asset`] loads and reloads files, and reports their states. [`picker`] finds the Gaussian that a ray hits.
//! [`sound`] plays what is heard beside captures, [`stereo`] has two eyes on one head, [`stream`] plays captures of
//! minutes in fixed memory. [`inspector`] is a panel that shows and edits captures, [`testing`] renders an app to
//! pictures without a window. `docs/guide.md` is the guide for games, `docs/command.md` the guide of the
//! command, `docs/filming.md` the chapter from several cameras to a capture.
//!
//! [`GaussianCapturePlugins`] is a group: `GaussianCapturePlugins.build().disable::<CapturePbrPlugin>()` leaves a part
//! out. All components and resources are reflected and registered by their public paths, for scene files.
//!
//! | component | on | inserted by |
//! |---|---|---|
//! | [`GaussianCapture3d`] | a capture in the world | the game |
//! | [`CaptureState`](asset::CaptureState), [`Playback`](playback::Playback), [`CaptureSettings`](render::CaptureSettings) | captures; `Playback` also timelines | the plugins, unless the game does |
//! | [`Upright`] | captures | the game; it requires [`UprightTurn`] |
//! | [`Markers`](playback::Markers), [`FollowsClock`](playback::FollowsClock) | captures; `FollowsClock` also timelines | the game |
//! | [`CaptureStreamSettings`](stream::CaptureStreamSettings), [`CaptureStreamState`](stream::CaptureStreamState) | captures in chunk files | the game; the plugins |
//! | [`CaptureSocket`](playback::CaptureSocket), [`SocketState`](playback::SocketState) | children of captures | the game; the first requires the second |
//! | [`CaptureCollider`](playback::CaptureCollider), [`ColliderState`](playback::ColliderState) | children of captures | the game; the first requires the second |
//! | [`CaptureSound`](sound::CaptureSound), [`SoundState`](sound::SoundState) | captures; `SoundState` also sounds of timelines | the game; the plugins |
//! | [`PlaybackClock`](playback::PlaybackClock) | an entity of its own; timelines | the game; the plugins on timelines |
//! | [`TimelinePlayer`](playback::TimelinePlayer) | a timeline in the world | the game |
//! | [`TimelineTrack`](playback::TimelineTrack), [`ClipFade`](playback::ClipFade) | children of timelines | the plugins, or the game |
//! | [`TimelineSound`](sound::TimelineSound) | children of timelines | the plugins |
//! | [`CastsShadows`](pbr::CastsShadows), [`ReceivesShadows`](pbr::ReceivesShadows), [`CaptureLight`](pbr::CaptureLight), [`CaptureContactShadow`](pbr::CaptureContactShadow) | captures | the game |
//! | [`CaptureViewSettings`](render::CaptureViewSettings), [`CapturePickingCamera`](picking_backend::CapturePickingCamera) | cameras | the game |
//! | [`StereoRig`](stereo::StereoRig) | a head | [`spawn_stereo`](stereo::spawn_stereo) |
//! | [`Eye`](stereo::Eye), [`SideBySide`](stereo::SideBySide) | cameras of a head | [`spawn_stereo`](stereo::spawn_stereo) |
//!
//! | set of systems | schedule | what its systems do |
//! |---|---|---|
//! | [`CaptureAssetSystems`](asset::CaptureAssetSystems) | `PreUpdate`, after Bevy's `AssetTrackingSystems` | turn captures upright, update their states and send [`CaptureReady`](asset::CaptureReady) and [`CaptureFailed`](asset::CaptureFailed) |
//! | Bevy's `PickingSystems::Backend` | `PreUpdate` | find the captures under pointers |
//! | [`PlaybackSystems::Clocks`](playback::PlaybackSystems::Clocks) | `Update` | advance clocks |
//! | [`PlaybackSystems::Timelines`](playback::PlaybackSystems::Timelines) | `Update`, after `Clocks` | advance timelines, set up their tracks |
//! | [`PlaybackSystems::Advance`](playback::PlaybackSystems::Advance) | `Update`, after `Timelines` | advance captures; send the messages about playing |
//! | [`CaptureSoundSystems`](sound::CaptureSoundSystems) | `Update`, after `Advance` | update the states of sounds |
//! | [`CaptureStreamSystems`](stream::CaptureStreamSystems) | `Update`, after `Advance`, before `Colliders` | load and give up chunk files; send the messages about streaming |
//! | [`PlaybackSystems::Colliders`](playback::PlaybackSystems::Colliders) | `Update`, after `Advance` | give entities with colliders the mesh of the time; send [`CaptureColliderChanged`](playback::CaptureColliderChanged) |
//! | [`PlaybackSystems::Sockets`](playback::PlaybackSystems::Sockets) | `PostUpdate`, after Bevy's `AnimationSystems`, before `TransformSystems::Propagate` | move entities with sockets |
//! | Bevy's `VisibilitySystems::CalculateBounds` | `PostUpdate` | update the `Aabb` of captures |
//! | [`CaptureSystems`](render::CaptureSystems) | `Core3d`, in the render world | draw captures into the target of a camera |
//!
//! # From a checkpoint to a small capture
//!
//! [`offline`] scores the contribution of each Gaussian to the training views ([`mod@offline::score`]), selects the
//! Gaussians to keep (`offline::prune::select`), makes the masks of the temporal filter
//! (`offline::filter::temporal_filter`), and quantizes ([`mod@offline::compress`]). `gs4d bake` runs these stages in
//! order and writes a report.
//!
//! # Verification
//!
//! * [`mod@reference`] is the CPU reference of the passes of a frame. The tests compare it with the numbers of the
//!   original code, and the GPU with both.
//! * [`offline::dataset`] reads training views as the trainer does; [`offline::measure`] has PSNR and SSIM as
//!   the original evaluates them, MS-SSIM and FLIP.
//!
//! # Features
//!
//! | feature | adds | implies |
//! |---|---|---|
//! | none | [`view`], [`gaussian`], [`scene`], [`codec`], [`mod@reference`]: no GPU, no Bevy | |
//! | `renderer` | [`renderer`], on wgpu | |
//! | `offline` | [`offline`] | `renderer`, `sound` |
//! | `bevy` (default) | `plugin`: [`asset`], [`playback`], [`render`], [`sound`], [`stream`], [`picker`], [`stereo`]; [`prelude`] | `renderer` |
//! | `pbr` (default) | [`pbr`]: captures among Bevy's lit meshes | `bevy` |
//! | `picking` (default) | pointer events on captures | `bevy` |
//! | `sound` | decoding of sound files ([`codec::sound`]) | |
//! | `bevy_audio` | sounds are heard through Bevy's audio | `bevy`, `sound` |
//! | `http_ranges` | captures in one file from servers, read in parts ([`stream::HttpRangesPlugin`]) | `bevy` |
//! | `fourdgs` | reading and writing `.4dgs` files | |
//! | `cli` | [`cli`], the `gs4d` command; never compiles Bevy | `offline`, `fourdgs` |
//! | `inspector` | [`inspector`]: a panel that shows and edits captures | `bevy` |
//! | `testing` | [`testing`]: Bevy apps without a window, drawn into pictures | `bevy` |
//! | `viewer` | what the examples need: a window, lit meshes | `pbr`, `picking`, `inspector`, `sound`, `http_ranges`, `testing` |
//! | `openxr` | the example `walkthrough` for a headset, untried | `viewer` |
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(
    not(all(feature = "cli", feature = "http_ranges", feature = "inspector", feature = "testing")),
    expect(rustdoc::broken_intra_doc_links, reason = "this page describes modules that are not part of this build")
)]
#![cfg_attr(
    not(feature = "renderer"),
    expect(dead_code, reason = "the core has private items that only the offline half or the plugin uses")
)]
#![cfg_attr(
    all(feature = "renderer", not(feature = "cli")),
    expect(
        dead_code,
        unused_imports,
        reason = "the renderer and the offline half have private items that only the command, or only the offline half, uses"
    )
)]
#![cfg_attr(all(feature = "cli", feature = "viewer"), warn(unreachable_pub))]

#[cfg(feature = "cli")]
pub mod cli;
pub mod codec;
pub mod gaussian;
#[doc(hidden)]
pub mod internal;
#[cfg(feature = "offline")]
pub mod offline;
#[cfg(feature = "bevy")]
mod plugin;
#[cfg(feature = "bevy")]
pub mod prelude;
pub mod reference;
#[cfg(feature = "renderer")]
pub mod renderer;
pub mod scene;
pub mod view;

#[cfg(feature = "bevy")]
pub use plugin::*;

/// The README, whose code must compile.
#[cfg(all(doctest, feature = "bevy"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The guide, likewise.
#[cfg(all(doctest, feature = "bevy"))]
#[doc = include_str!("../docs/guide.md")]
struct Guide;

/// The guide of the command, likewise.
#[cfg(all(doctest, feature = "bevy"))]
#[doc = include_str!("../docs/command.md")]
struct CommandGuide;
