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
//! prepare      a camera's lens and every capture's pose -> views     once per camera and frame, kept in capture_views; then previous
//! order        what is drawn before captures, and what after them    once per camera and frame
//! draw         one compute pass, composite, write_depth, write_motion  Core3d, among transparent things
//! publish      counts, times, memory -> statistics                   render world -> main world
//! ```
//!
//! # The order of a frame
//!
//! 1. opaque and alpha-masked meshes, skybox; contact shadows
//! 2. transmissive meshes; the atmosphere
//! 3. gizmos, and transparent things behind captures, cut by the depth of 1 and 2
//! 4. **captures**, cut by all depth so far
//! 5. **captures' depth and motion**, if asked for
//! 6. transparent things in front of captures, cut by all depth so far
//! 7. wireframes
//! 8. post-processing, tonemapping
//!
//! With or without multisampling, HDR or not, and without a setting: Bevy sorts its transparent phase (blended materials, particles of
//! other plugins) by the distance of each item's centre, and captures have a place in it. All captures of a view are drawn at once,
//! since their Gaussians interleave: at the centre of the bounds of the nearest one, however faint it is. One whose centre is behind the
//! camera, as in a room, counts as the farthest; an item at the same distance is behind. What is behind is in the target before captures
//! are blended with it, so soft edges are as over anything opaque. As between meshes, one distance for each is too little where they reach
//! through each other, or for a capture all around the camera. With [`DepthWrite::Median`] or `Expected` all transparent things are therefore drawn after
//! captures, which cut them pixel by pixel where they hide more than half of what is behind; elsewhere, as in smoke, what is behind is
//! drawn over them.
//!
//! What this costs: nothing while no transparent thing is in front, and another render pass otherwise. Multisampled captures are drawn
//! into the resolved picture, or, if something is in front or a wireframe is drawn, into every sample, so that these can be resolved
//! again. Opaque and alpha-masked meshes hide them by as many samples of a pixel as they cover; at such an edge the mean of the pixel's
//! samples shows through a capture. Captures need no multisampling themselves.
//!
//! Gizmos write depth, so captures hide them, or are hidden, pixel by pixel; if captures are shaded (fog, shadows), they have been
//! recorded earlier, and gizmos are drawn over them. Wireframes are drawn over captures, unless these write depth.
//!
//! Behind a transmissive mesh captures show refracted: if the centre of one in view is nearer than that of the nearest capture, captures
//! are drawn between 1 and 2, and everything transparent after them. A capture in front of only some of these meshes is then seen as if it
//! were behind them. A camera with Bevy's atmosphere draws captures after it, and so not through transmissive meshes, which hide what is
//! behind them. With order-independent transparency, everything that takes part in it is drawn after captures, and cut by the depths that
//! they write for such cameras by default.
//!
//! Prepasses come first and do not contain captures; effects that read the depth prepass before the main pass (screen-space ambient
//! occlusion and reflections) ignore captures. Distance fog, shadows of meshes and light of the scene reach captures in a pass of the module
//! `pbr`, between 1 and the captures. Effects that read the depth buffer after the main pass (depth of field, volumetric fog) read the
//! depths that [`DepthWrite`] wrote, by default for cameras that have such an effect.
//!
//! For cameras with a `MotionVectorPrepass`, which temporal anti-aliasing and motion blur require, captures are then written into its
//! texture, and into that of a `DepthPrepass` if there is one: at pixels where they hide more than half of the background, the mean motion of their splats since the
//! frame before, by the time of the capture, its transform and the camera, without jitter. Captures are never drawn with jitter: their
//! splats are smooth without.
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
pub(crate) mod capture_views;
mod composite;
mod depth_readers;
mod detail;
mod draw;
pub(crate) mod extract;
mod fault;
pub(crate) mod kept;
pub(crate) mod order;
mod plugin;
mod prepare;
mod previous;
mod publish;
mod reflect;
mod renderer;
mod settings;
pub(crate) mod shade_requests;
mod statistics;
mod upload;
mod view;
mod visibility;
mod write_depth;
mod write_motion;

#[cfg(feature = "pbr")]
pub(crate) use active::ActiveLists;
#[cfg(feature = "pbr")]
pub(crate) use capture_views::{Drawn, group_copies};
pub use detail::CaptureDetail;
pub use draw::CaptureSystems;
#[cfg(feature = "pbr")]
pub(crate) use extract::{ExtractedCaptures, extract_captures};
pub use fault::CameraFault;
pub(crate) use plugin::CaptureRenderPlugin;
#[cfg(feature = "pbr")]
pub(crate) use renderer::CaptureRenderer;
pub use settings::{CaptureSettings, CaptureViewSettings, CropBox, DepthWrite};
pub use statistics::CaptureStatistics;
pub use upload::{CaptureUploadBudget, GpuGaussianCapture};
#[cfg(feature = "pbr")]
pub(crate) use view::CameraLens;
#[cfg(feature = "pbr")]
pub(crate) use write_depth::{WriteDepthBindings, WriteDepthKey, WriteDepthPipeline, nearest};
