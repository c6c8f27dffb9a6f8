//! Captures in Bevy's frame.
//!
//! In: entities with a [`GaussianCapture3d`] and `Camera3d`s, perspective or orthographic. Out: pixels in every such camera's target,
//! of the captures that it sees. The drawing itself is [`crate::renderer`], which knows nothing of Bevy; what is here connects the two:
//!
//! ```text
//! visibility   where a capture is now -> its Aabb                    main world
//! extract      what is where, at which moment, with which settings   main world -> render world
//! upload       a loaded capture -> buffers on the GPU                once per asset
//! active       which Gaussians the filter leaves                     once per placed capture and segment, before all cameras
//! prepare      a camera's lens and every capture's pose -> views     once per camera and frame
//! draw         one compute pass, the composite, write_depth          Core3d, after opaque meshes, before or after transparent ones
//! statistics   counts, times, memory                                 render world -> main world
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
//! So without multisampling everything in Bevy's transparent phase (blended materials, gizmos) is drawn over captures, in front of
//! them or behind; with [`DepthWrite`] what is behind captures is cut by them, pixel by pixel. A multisampled target can only be
//! read once all meshes are in it: captures are then drawn over everything in the transparent phase, in front of them or behind,
//! and only opaque and alpha-masked meshes hide them, each by as many samples of a pixel as it covers. What shows through a capture
//! at such an edge is the mean of the pixel's samples, and wireframes, which come later and resolve the samples again, wipe captures
//! away. Where that matters use `Msaa::Off`: captures need no multisampling.
//!
//! Bevy orders its transmissive meshes only between opaque and transparent ones: order [`CaptureSystems::Draw`] against
//! `main_transmissive_pass_3d`, in the render world's `Core3d` schedule, to see captures through glass. Its atmosphere cannot be ordered
//! against: cameras with one need [`CaptureViewSettings::late`], which draws captures in the order of multisampled cameras.
//! Prepasses come first and know nothing of captures: neither do effects that read the depth prepass (screen-space ambient
//! occlusion and reflections). Those that read the depth buffer after the main pass (depth of field, volumetric fog) see what
//! [`DepthWrite`] wrote.
//!
//! A capture with an environment map shows it behind everything, through perspective cameras whose depth can be read; of several
//! maps in one view, that of one capture. Entities with `NoCpuCulling` are not drawn: captures are culled on the CPU.
//!
//! # Colour
//!
//! Blending happens in the space captures were trained in, sRGB-encoded values, unless the camera's [`CaptureViewSettings`] say
//! otherwise. On cameras with `Hdr` tonemapping comes afterwards and applies to captures as to everything else; with
//! `Tonemapping::None` they show as they were trained. Without `Hdr` Bevy tonemaps meshes in their own shaders and nothing else:
//! captures show as they were trained, whatever the tonemapping.

mod active;
mod composite;
mod draw;
mod extract;
mod plugin;
mod prepare;
mod reflect;
mod settings;
mod statistics;
mod upload;
mod view;
mod visibility;
mod write_depth;

pub use draw::CaptureSystems;
pub(crate) use plugin::CaptureRenderPlugin;
pub use settings::{CaptureSettings, CaptureViewSettings, CropBox, DepthWrite};
pub use statistics::CaptureStatistics;
pub use upload::GpuGaussianCapture;
