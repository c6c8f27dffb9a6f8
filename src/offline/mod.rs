//! The offline half: from pictures, or a trained checkpoint and its training views, to a small, fast capture, with the
//! loss of quality.
//!
//! In: pictures with their cameras, a `GaussianScene`. Out: a smaller scene, packages, pictures, measurements. Build
//! scripts and editors can call every function as the command does: functions report their
//! [`Progress`](work::Progress), return data, and have the error of their module.
//!
//! The modules, in the order in which data passes through them. A module uses those above it, and none below it:
//!
//! | module | what happens to the data |
//! |---|---|
//! | [`work`] | tasks are reported and interrupted; files are written whole or not at all |
//! | [`picture_file`] | pictures are decoded |
//! | [`dataset`] | cameras and images become views, divided into training, validation and test views |
//! | [`forms`] | a scene is brought into the form that the work needs, or that other programs read |
//! | `store` | results are kept on disk, so that work resumes and is divided among machines |
//! | [`engine`] | views are drawn, on the GPU or by the CPU reference |
//! | [`score`] | the contributions of every Gaussian to the training views are summed to scores |
//! | [`measure`] | pictures are compared with images: PSNR, SSIM, MS-SSIM, FLIP |
//! | [`filter`] | the active Gaussians of each segment of time are found |
//! | [`prune`] | the Gaussians of the highest scores are kept, as many as validation views need |
//! | [`segments`] | captures of stretches of time become one, and one becomes chunks |
//! | [`mod@compress`] | the Gaussians are packed, and their colors are coded by codebooks |
//! | [`mod@train`] | the Gaussians are trained: from pictures alone, or to compensate for removed Gaussians |
//! | [`edit`] | cameras tell floaters from what stands there, for edits |
//! | [`sockets`] | named points follow the Gaussians around them |
//! | [`mod@collide`] | the solid parts become closed meshes, for the physics of games |
//! | [`mod@footage`] | footage of several cameras becomes a dataset, with a verdict |
//! | [`mod@detail`] | levels of fewer Gaussians are made, for pictures of few pixels |
//! | [`report`] | the result of a bake, or of many, becomes a page |
//! | [`draw`] | pictures are drawn in bulk, from cameras around the scene if there are no others |
//! | [`mod@bake`] | all of this in stages, which resume, or as jobs for many machines |

pub mod bake;
pub mod collide;
pub mod compress;
pub mod dataset;
pub mod detail;
pub mod draw;
pub mod edit;
pub mod engine;
pub mod filter;
pub mod footage;
pub mod forms;
pub mod measure;
pub mod picture_file;
pub mod prune;
pub mod report;
pub mod score;
pub mod segments;
pub mod sockets;
pub mod store;
pub mod train;
pub mod work;
