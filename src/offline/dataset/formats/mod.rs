//! The readers of datasets: a file or a folder for each format, and what several of them need.
//!
//! In: a folder or a camera file. Out: views of all splits, and sentences about assumptions.

pub(crate) mod camera_file;
pub(crate) mod colmap;
pub(crate) mod easyvolcap;
pub(crate) mod files;
pub(crate) mod footage;
pub(crate) mod immersive;
pub(crate) mod json;
pub(crate) mod limited;
pub(crate) mod llff;
pub(crate) mod masks;
pub(crate) mod moments;
pub(crate) mod n3v;
pub(crate) mod named_images;
pub(crate) mod nerfies;
pub(crate) mod nerfstudio;
pub(crate) mod npy;
pub(crate) mod numbered;
pub(crate) mod opencv_yaml;
pub(crate) mod panoptic;
pub(crate) mod picture_size;
pub(crate) mod polycam;
pub(crate) mod pose2sim;
pub(crate) mod poses_bounds;
pub(crate) mod record3d;
pub(crate) mod standing;
pub(crate) mod stream;
pub(crate) mod technicolor;
pub(crate) mod undivided;
pub(crate) mod video;
pub(crate) mod video_rate;
pub(crate) mod zju;
