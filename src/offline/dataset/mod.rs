//! Training views: the cameras, times and images that a capture is trained on and compared with.
//!
//! In: a folder or a single camera file. Out: [`TrainingView`]s in file order, and their images with coverage ([`CoveredImage`]).
//!
//! | form | file | cameras |
//! |---|---|---|
//! | Blender (D-NeRF) | `transforms_{train,test,val}.json` with `camera_angle_x` | FoV cameras |
//! | converted N3V | the same with `fl_x`, `fl_y`, `cx`, `cy`, for the file or per frame | intrinsics cameras |
//! | golden views | `golden*.json`, a list `views` | FoV cameras always |
//!
//! All of them are pinhole cameras: entries that describe a distorted lens are refused by name, since distortion is not undone, and so are
//! golden views whose principal point is not the center, and images of another aspect ratio than the camera.
//!
//! Cameras can be read without any image on disk; [`Dataset::require_images`] reports missing images early.

mod camera_file;
mod dataset_split;
mod error;
mod files;
mod lens;
mod resample;
pub(crate) mod selection;
mod size;
mod split;
pub(crate) mod validation;
mod view;

pub use camera_file::{CameraFile, CameraOptions};
pub use dataset_split::Dataset;
pub(crate) use dataset_split::require_images;
pub use error::{DatasetError, FrameProblem};
pub use size::MAX_SIDE;
pub use split::Split;
pub use validation::Validation;
pub use view::{CoveredImage, TrainingView};
