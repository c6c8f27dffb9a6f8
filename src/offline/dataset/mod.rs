//! Training views: the cameras, times and images that a capture is trained on and compared with.
//!
//! In: a folder or a single camera file. Out: [`TrainingView`]s in file order, and their images with coverage ([`CoveredImage`]).
//!
//! | format | files | splits |
//! |---|---|---|
//! | Blender (D-NeRF) | `transforms_{train,test,val}.json` with `camera_angle_x`: FoV cameras; with `fl_x`, `fl_y`, `cx`, `cy` for the file or per frame: intrinsics cameras | a file each |
//! | nerfstudio | `transforms.json`, as above | `train_filenames`, ..., or `split` of each frame, or every eighth camera |
//! | N3V | `poses_bounds.npy` with `camNN.mp4`, or frames in `camNN/` | the first camera is for the test |
//! | COLMAP | the largest of `sparse/0`, `sparse/1`, ... (binary or text) with `images/` | every eighth camera |
//! | golden views | `golden*.json`, a list `views`: FoV cameras always | |
//!
//! `format` has the table of the formats of folders. All cameras are pinhole cameras: the distortion of a lens is undone when an image is loaded
//! (`distortion`), and models that cannot be undone are refused by name. So are golden views whose principal point is not the center, and images of
//! another aspect ratio than the camera.
//!
//! Cameras can be read without any image on disk; [`Dataset::require_images`] reports missing images early. `point_cloud` reads the points that a
//! dataset names or has, to begin a training with.

mod camera_file;
mod camera_options;
pub(crate) mod clock;
mod cloud_point;
mod colmap;
mod dataset_split;
mod distortion;
mod division;
pub(crate) mod drawing;
mod error;
mod files;
mod format;
mod frame;
mod json;
mod lens;
mod masks;
mod n3v;
mod named_images;
mod nerfstudio;
mod npy;
mod numbered;
mod origin;
mod placing;
pub(crate) mod point_cloud;
mod pose;
mod resample;
pub(crate) mod selection;
mod size;
mod split;
mod stream;
pub(crate) mod summary;
mod undivided;
pub(crate) mod validation;
mod video;
mod view;

pub use camera_file::CameraFile;
pub use camera_options::CameraOptions;
pub(crate) use clock::Clock;
pub use dataset_split::Dataset;
pub(crate) use dataset_split::require_images;
pub use error::{DatasetError, FrameProblem};
pub(crate) use format::inputs;
pub use size::MAX_SIDE;
pub use split::Split;
pub use validation::Validation;
pub use view::{Correction, CoveredImage, TrainingView};
