//! Training views: the cameras, times and images that a capture is trained on and compared with.
//!
//! In: a folder or a single camera file. Out: [`TrainingView`]s in file order, and their images with coverage
//! ([`CoveredImage`]).
//!
//! | format | files | splits |
//! |---|---|---|
//! | Blender (D-NeRF) | `transforms_{train,test,val}.json` with `camera_angle_x`: FoV cameras; with `fl_x`, `fl_y`, `cx`, `cy`, or a matrix `K` (`intrinsics`, `camera_intrinsics`), for the file or per frame: intrinsics cameras | a file each |
//! | nerfstudio | `transforms.json`, lenses as above | `train_filenames`, ..., or `split` of each frame, or every eighth camera |
//! | N3V | `poses_bounds.npy` with `camNN.mp4`, or frames in `camNN/` | the first camera is for the test |
//! | COLMAP | the largest of `sparse/0`, `sparse/1`, ... (binary or text) with `images/` | every eighth camera |
//! | LLFF | `poses_bounds.npy` with `images/` (at rest) or `frames/` (a camera that moves), or frames of a camera for each row | every eighth camera |
//! | Nerfies, `HyperNeRF`, `DyCheck` | `dataset.json`, `camera/ID.json`, `rgb/1x/ID.png` (or 2x, 4x), `scene.json`, `metadata.json` | `val_ids`, else every eighth camera |
//! | Technicolor | `cameras_parameters.txt` with `NAME_FRAME_CAMERA.png`, or frames or a video of each camera | camera 10 of 16, else every eighth |
//! | Google Immersive | `models.json` with a video or frames of each camera, fisheye | `camera_0001`, else every eighth |
//! | `PanopticSports` | `train_meta.json`, `test_meta.json` with `ims/` | a file each |
//! | `EasyVolcap`, `ENeRF`, `SelfCap` | `intri.yml`, `extri.yml`, in the folder or in `optimized/`, with `images/CAMERA/` or `videos/CAMERA.mp4` | every eighth camera |
//! | `ZJU-MoCap` | `annots.npy` | every eighth camera |
//! | Pose2Sim, Anipose, Qualisys | `Calib*.toml` or `*.qca.txt` (also in a folder `*calib*`) with a video or a folder of frames for each camera | every eighth camera |
//! | Record3D | `metadata.json` (or `metadata` of an unpacked .r3d) with `rgbd/N.jpg` or `rgb/N.jpg` | every eighth picture |
//! | Polycam | `keyframes/corrected_cameras/*.json` with `corrected_images`, or else `cameras` with `images` | every eighth picture |
//! | golden views | `golden*.json`, a list `views`: FoV cameras always | |
//!
//! `format` has the table of the formats of folders, `formats` their readers, `cameras` lenses and poses. All cameras
//! are pinhole cameras: the distortion of a lens is undone when an image is loaded, and models that cannot be undone
//! are refused by name. So are golden views whose principal point is not the center, and images of another aspect ratio
//! than the camera.
//!
//! Cameras can be read without any image on disk; [`Dataset::require_images`] reports missing images early.
//! `point_cloud` reads the points that a dataset names or has, to begin a training with.

pub(crate) mod cameras;
pub(crate) mod cloud_point;
pub(crate) mod dataset_split;
pub(crate) mod division;
pub(crate) mod error;
pub(crate) mod format;
pub(crate) mod formats;
pub(crate) mod gaps;
pub(crate) mod mask;
pub(crate) mod point_cloud;
pub(crate) mod selection;
pub(crate) mod split;
pub(crate) mod splits;
pub(crate) mod summary;
pub(crate) mod trained_pixel;
pub(crate) mod validation;
mod validation_choice;
pub(crate) mod view;

pub use cameras::camera_options::CameraOptions;
pub(crate) use cameras::clock::Clock;
pub use cameras::size::MAX_SIDE;
pub use dataset_split::Dataset;
pub(crate) use dataset_split::require_images;
pub use error::{DatasetError, FrameProblem};
pub(crate) use format::inputs;
pub use formats::camera_file::CameraFile;
pub use split::Split;
pub use splits::{SplitOptions, Splits};
pub(crate) use trained_pixel::trained_pixel;
pub use validation_choice::Validation;
pub use view::{Correction, CoveredImage, TrainingView};
