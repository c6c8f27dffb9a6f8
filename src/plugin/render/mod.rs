//! Captures in Bevy's frame.
//!
//! In: entities with a [`GaussianCapture3d`](crate::GaussianCapture3d) and `Camera3d`s, perspective or orthographic.
//! Out: the captures that each camera sees, drawn into its target. [`crate::renderer`], which is independent of Bevy,
//! does the drawing; this module connects it to Bevy:
//!
//! ```text
//! renderer     compiles the pipelines                                once per device
//! visibility   a capture's bounds at this time -> its Aabb           main world
//! extract      captures, their times, poses and settings             main world -> render world
//! upload       a loaded capture -> buffers on the GPU                once per asset, over several frames
//! budget       the size below which Gaussians are left out           once per frame, for all views
//! detail       level of detail by the size on the screen             once per camera, placed capture and frame
//! active       the lists of active Gaussians                         once per placed capture and segment
//! prepare      a camera's lens and the poses of captures -> views    once per camera and frame, into capture_views
//! order        transparent items before and after captures           once per camera and frame
//! draw         one compute pass, composite, write_depth, write_motion  Core3d, among transparent items
//! publish      counts, times, memory -> statistics                   render world -> main world
//! ```
//!
//! # The order of a frame
//!
//! 1. opaque and alpha-masked meshes, skybox; contact shadows
//! 2. transmissive meshes; the atmosphere
//! 3. gizmos, and transparent items behind captures, depth-tested against 1 and 2
//! 4. **captures**, depth-tested against all depth so far
//! 5. **captures' depth and motion**, if requested
//! 6. transparent items in front of captures, depth-tested against all depth so far
//! 7. wireframes
//! 8. post-processing, tonemapping
//!
//! The order is the same with and without multisampling and HDR, and needs no setting. Bevy sorts its transparent phase
//! (blended materials, particles of other plugins) by the distance of the center of each item, and captures have a
//! place in this order. All captures of a view are drawn at once, since their Gaussians interleave. Their place is the
//! center of the bounds of the nearest capture, however faint that capture is. A capture whose center is behind the
//! camera, such as a room around the camera, counts as the farthest. An item at the same distance as a capture counts
//! as behind the capture. Items behind captures are drawn first, so the soft edges of captures blend with them as with
//! opaque meshes. As for meshes, one distance per object is not enough where objects interpenetrate or a capture
//! surrounds the camera. With [`DepthWrite::Median`] or `Expected`, all transparent items are therefore drawn after
//! captures and depth-tested per pixel against the pixels where captures hide more than half of the background; at
//! fainter pixels, as in smoke, items behind captures are drawn over them.
//!
//! This order costs nothing while no transparent item is in front of captures, and one more render pass otherwise. On a
//! multisampled target, captures are drawn into the resolved picture or, if an item in front or a wireframe follows,
//! into every sample, so that the samples can be resolved again. Opaque and alpha-masked meshes hide captures by the
//! fraction of samples that they cover in a pixel; at such an edge the mean of the pixel's samples shows through a
//! capture. Captures themselves need no multisampling.
//!
//! Gizmos write depth, so captures and gizmos hide each other per pixel. Shaded captures (fog, shadows) are recorded
//! before the gizmos, so gizmos are drawn over them. Wireframes are drawn over captures, unless these write depth.
//!
//! Captures behind a transmissive mesh appear refracted: if the center of a transmissive mesh in view is nearer than
//! the center of the nearest capture, captures are drawn between 1 and 2, and all transparent items after them. A
//! capture in front of only some of these meshes is then drawn as if it were behind them. A camera with Bevy's
//! atmosphere draws captures after the atmosphere. Captures are then not visible through transmissive meshes, which
//! hide the captures behind them. With order-independent transparency, all items that take part in it are drawn after
//! captures and depth-tested against the depths that captures write for such cameras by default.
//!
//! Prepasses come first and do not contain captures; effects that read the depth prepass before the main pass
//! (screen-space ambient occlusion and reflections) ignore captures. Distance fog, shadows of meshes and light of the
//! scene reach captures in a pass of the module `pbr`, between 1 and the captures. Effects that read the depth buffer
//! after the main pass (depth of field, volumetric fog) read the depths that [`DepthWrite`] wrote, by default for
//! cameras that have such an effect.
//!
//! For cameras with a `MotionVectorPrepass`, which temporal anti-aliasing and motion blur require, captures are then
//! written into its texture, and their depth into the texture of a `DepthPrepass` if there is one. The motion, at
//! pixels where captures hide more than half of the background, is the mean motion of their splats since the previous
//! frame, from the time and transform of the capture and from the camera, without jitter. Captures are never drawn with
//! jitter: their splats are already smooth.
//!
//! A perspective camera whose depth can be read draws the environment map of a capture behind all else; if several
//! captures in one view have maps, it draws only one of the maps. Entities with `NoCpuCulling` are not drawn: captures
//! are culled on the CPU.
//!
//! # Color
//!
//! Blending happens in the space captures were trained in, sRGB-encoded values, unless the camera's
//! [`CaptureViewSettings`] select linear light. On cameras with `Hdr`, tonemapping follows and applies to captures as
//! to meshes; with `Tonemapping::None` captures keep their trained colors. Without `Hdr`, Bevy tonemaps only meshes, in
//! their own shaders: captures keep their trained colors with any tonemapping.

pub(crate) mod captures;
pub(crate) mod logged;
mod plugin;
mod reflect;
mod renderer;
mod settings;
mod statistics;
pub(crate) mod targets;
pub(crate) mod views;

#[cfg(feature = "pbr")]
pub(crate) use captures::active::ActiveLists;
pub use captures::budget::CaptureBudget;
#[cfg(feature = "pbr")]
pub(crate) use captures::budget::CaptureCut;
pub use captures::detail::CaptureDetail;
#[cfg(feature = "pbr")]
pub(crate) use captures::extract::{ExtractedCaptures, extract_captures};
pub use captures::upload::{CaptureUploadBudget, GpuGaussianCapture};
#[cfg(feature = "pbr")]
pub(crate) use captures::view::CameraLens;
pub use plugin::CaptureRenderPlugin;
#[cfg(feature = "pbr")]
pub(crate) use plugin::has_captures;
#[cfg(feature = "pbr")]
pub(crate) use renderer::CaptureRenderer;
pub use settings::{CaptureSettings, CaptureViewSettings, CropBox, DepthWrite};
pub use statistics::CaptureStatistics;
#[cfg(feature = "pbr")]
pub(crate) use targets::write_depth::{WriteDepthBindings, WriteDepthKey, WriteDepthPipeline, WrittenDepth, nearest};
#[cfg(feature = "pbr")]
pub(crate) use views::capture_views::{Drawn, group_copies};
pub use views::draw::CaptureSystems;
pub use views::fault::CameraFault;
