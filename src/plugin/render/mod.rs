//! Captures in Bevy's frame.
//!
//! In: entities with a [`GaussianCapture3d`](crate::GaussianCapture3d) and `Camera3d`s, perspective or orthographic. Out: pixels in
//! every such camera's target, of the captures that it sees. The drawing itself is [`crate::renderer`], which is independent of Bevy;
//! this module connects the two:
//!
//! ```text
//! renderer     compiles the pipelines                                once per device
//! visibility   a capture's bounds at this time -> its Aabb           main world
//! extract      captures, their times, poses and settings             main world -> render world
//! upload       a loaded capture -> buffers on the GPU                once per asset, over several frames
//! detail       how many Gaussians by the size on the screen          once per camera, placed capture and frame
//! active       which Gaussians are active                            once per placed capture and segment, before all cameras
//! prepare      a camera's lens and every capture's pose -> views     once per camera and frame, kept in capture_views
//! draw         one compute pass, composite, write_depth              Core3d, after opaque meshes, before or after transparent ones
//! publish      counts, times, memory -> statistics                   render world -> main world
//! ```
//!
//! # The order of a frame
//!
//! | | `Msaa::Off` | multisampled |
//! |---|---|---|
//! | 1 | opaque and alpha-masked meshes, skybox | opaque and alpha-masked meshes, skybox |
//! | 2 | **captures**, cut by the depth of 1 | transmissive and transparent meshes, cut by the depth of 1 |
//! | 3 | **captures' depth**, if asked for | **captures**, cut by the depth of 1 |
//! | 4 | transparent meshes and gizmos, cut by the depth of 1 (and of 3) | **captures' depth**, if asked for |
//! | 5 | post-processing, tonemapping | post-processing, tonemapping |
//!
//! So without multisampling everything in Bevy's transparent phase (blended materials, gizmos) is drawn over captures, whether it is in
//! front of them or behind; with [`DepthWrite`] captures cut what is behind them, pixel by pixel. A multisampled target can only be
//! read once all meshes are in it: captures are then drawn over everything in the transparent phase, whether it is in front of them or
//! behind, and only opaque and alpha-masked meshes hide them, each by as many samples of a pixel as it covers. At such an edge the mean
//! of the pixel's samples shows through a capture. Wireframes are drawn later, resolve the samples again, and overwrite captures. If any
//! of this matters, use `Msaa::Off`: captures need no multisampling.
//!
//! Bevy orders its transmissive meshes only between opaque and transparent ones: order [`CaptureSystems::Draw`] against
//! `main_transmissive_pass_3d`, in the render world's `Core3d` schedule, to see captures through glass. Its atmosphere cannot be ordered
//! against: cameras with one need [`CaptureViewSettings::late`], which draws captures in the order of multisampled cameras.
//! Prepasses come first and do not contain captures; effects that read the depth prepass (screen-space ambient occlusion and reflections)
//! ignore captures. Effects that read the depth buffer after the main pass (depth of field, volumetric fog) read the depths that
//! [`DepthWrite`] wrote.
//!
//! A perspective camera whose depth can be read draws the environment map of a capture behind everything; of several maps in one view, it
//! draws that of one capture. Entities with `NoCpuCulling` are not drawn: captures are culled on the CPU.
//!
//! # Colour
//!
//! Blending happens in the space captures were trained in, sRGB-encoded values, unless the camera's [`CaptureViewSettings`] ask for
//! linear light. On cameras with `Hdr` tonemapping comes afterwards and applies to captures as to everything else; with
//! `Tonemapping::None` captures keep their trained colours. Without `Hdr` Bevy tonemaps meshes in their own shaders and nothing else:
//! captures keep their trained colours with any tonemapping.

mod active;
mod capture_views;
mod composite;
mod detail;
mod draw;
mod extract;
mod plugin;
mod prepare;
mod publish;
mod reflect;
mod renderer;
mod settings;
mod statistics;
mod upload;
mod view;
mod visibility;
mod write_depth;

pub use detail::CaptureDetail;
pub use draw::CaptureSystems;
pub(crate) use plugin::CaptureRenderPlugin;
pub use settings::{CaptureSettings, CaptureViewSettings, CropBox, DepthWrite};
pub use statistics::CaptureStatistics;
pub use upload::{CaptureUploadBudget, GpuGaussianCapture};
