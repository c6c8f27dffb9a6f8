//! The readers, and how their inputs are made.
//!
//! In: random numbers. Out: the bytes of a file for one reader, and the outcome of reading them. `KINDS` lists the
//! readers.
//!
//! Three readers are not included: timelines (`*.timeline.ron`), which only a Bevy app can load, and the state of
//! fine-tuning, which needs a GPU, both RON or bytes behind a checksum, whose tests are in
//! `plugin/playback/timeline/file.rs` and `offline/store/results.rs`; and sounds, whose decoder panics on some damaged
//! files: `codec::sound` catches that, this program does not allow it, and `tests/core/sounds.rs` changes them.

mod calibrations;
mod cameras;
mod checkpoint;
mod datasets;
mod edits;
mod imports;
mod known_points;
mod package;
mod parts;
mod pictures;
mod points;
mod rigs;
mod saved;
mod scores;
mod settings;
mod studios;
mod views;

use crate::support::random::Random;
use std::sync::Arc;

/// The outcome of an input.
#[derive(Debug)]
pub enum Outcome {
    /// It was refused, with this message.
    Refused(String),
    /// It was accepted.
    Accepted,
    /// It was accepted and drawn.
    Drawn,
}

/// A reader with its seeds.
pub trait Reader: Send + Sync {
    /// Makes an input.
    fn input(&self, random: &mut Random) -> Vec<u8>;

    /// Reads an input.
    ///
    /// # Errors
    /// A defect: an input that is accepted although it is wrong.
    fn read(&self, bytes: &[u8]) -> Result<Outcome, String>;
}

/// A kind of reader.
pub struct Kind {
    /// Its name, on the command line and of its folder in `tests/corpus/`.
    pub name: &'static str,
    /// A description of the files that it reads.
    pub about: &'static str,
    /// Extension of its inputs.
    pub extension: &'static str,
    /// The reader reads each input whose number is a multiple of this: more than 1 for slow readers.
    pub share: u64,
    /// Makes the reader.
    pub make: fn() -> Arc<dyn Reader>,
}

/// The readers.
pub static KINDS: &[Kind] = &[
    Kind {
        name: "package",
        about: "packages (.gs4d) in every form, with filters, environment maps, colliders and tables of chunk files",
        extension: "gs4d",
        share: 1,
        make: || Arc::new(package::Packages::new()),
    },
    Kind {
        name: "checkpoint",
        about: "checkpoints (.pth) of every model: archive, pickle, tensors",
        extension: "pth",
        share: 1,
        make: || Arc::new(checkpoint::Checkpoints::new()),
    },
    Kind {
        name: "cameras",
        about: "camera files: transforms with a field of view or intrinsics, golden views",
        extension: "json",
        share: 1,
        make: || Arc::new(cameras::Cameras::new()),
    },
    Kind {
        name: "nerfstudio",
        about: "transforms.json of nerfstudio, distorted and fisheye",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("transforms.json")),
    },
    Kind {
        name: "n3v",
        about: "poses_bounds.npy of N3V",
        extension: "npy",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("poses_bounds.npy")),
    },
    Kind {
        name: "panoptic",
        about: "train_meta.json of PanopticSports",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("train_meta.json", &studios::panoptic())),
    },
    Kind {
        name: "panoptic-points",
        about: "init_pt_cld.npz of PanopticSports",
        extension: "npz",
        share: 1,
        make: || Arc::new(points::Points::new("init_pt_cld.npz")),
    },
    Kind {
        name: "easyvolcap-intri",
        about: "intri.yml of EasyVolcap",
        extension: "yml",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("intri.yml", &studios::easyvolcap())),
    },
    Kind {
        name: "easyvolcap-extri",
        about: "extri.yml of EasyVolcap",
        extension: "yml",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("extri.yml", &studios::easyvolcap())),
    },
    Kind {
        name: "selfcap-sync",
        about: "sync.json of SelfCap",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("sync.json", &studios::easyvolcap())),
    },
    Kind {
        name: "zju",
        about: "annots.npy of ZJU-MoCap: pickles of lists and of arrays",
        extension: "npy",
        share: 1,
        make: || Arc::new(studios::Annotations::new()),
    },
    Kind {
        name: "llff",
        about: "poses_bounds.npy of LLFF, with a picture for each row",
        extension: "npy",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("poses_bounds.npy", &rigs::llff())),
    },
    Kind {
        name: "nerfies",
        about: "names of the pictures of Nerfies",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("dataset.json", &rigs::nerfies())),
    },
    Kind {
        name: "nerfies-camera",
        about: "a camera file of Nerfies",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("camera/a.json", &rigs::nerfies())),
    },
    Kind {
        name: "nerfies-scene",
        about: "center and scale of Nerfies",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("scene.json", &rigs::nerfies())),
    },
    Kind {
        name: "nerfies-metadata",
        about: "moments of the pictures of Nerfies",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("metadata.json", &rigs::nerfies())),
    },
    Kind {
        name: "nerfies-points",
        about: "points.npy of Nerfies",
        extension: "npy",
        share: 1,
        make: || Arc::new(points::Points::new("points.npy")),
    },
    Kind {
        name: "technicolor",
        about: "cameras_parameters.txt of Technicolor",
        extension: "txt",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("cameras_parameters.txt", &rigs::technicolor())),
    },
    Kind {
        name: "immersive",
        about: "models.json of Google Immersive",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("models.json", &rigs::immersive())),
    },
    Kind {
        name: "nerfstudio-matrices",
        about: "transforms.json with the matrix of each lens",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("transforms.json", &calibrations::matrices())),
    },
    Kind {
        name: "pose2sim",
        about: "Calib.toml of Pose2Sim",
        extension: "toml",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("Calib.toml", &calibrations::pose2sim())),
    },
    Kind {
        name: "qualisys",
        about: "Calib.qca.txt of Qualisys",
        extension: "txt",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("Calib.qca.txt", &calibrations::qualisys())),
    },
    Kind {
        name: "record3d",
        about: "metadata.json of Record3D",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("metadata.json", &calibrations::record3d())),
    },
    Kind {
        name: "polycam",
        about: "a camera of Polycam",
        extension: "json",
        share: 1,
        make: || Arc::new(datasets::Datasets::of("keyframes/corrected_cameras/0.json", &calibrations::polycam())),
    },
    Kind {
        name: "colmap-cameras",
        about: "cameras of a binary COLMAP model, of every lens",
        extension: "bin",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("sparse/0/cameras.bin")),
    },
    Kind {
        name: "colmap-images",
        about: "images of a binary COLMAP model",
        extension: "bin",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("sparse/0/images.bin")),
    },
    Kind {
        name: "colmap-cameras-text",
        about: "cameras of a COLMAP model as text",
        extension: "txt",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("sparse/0/cameras.txt")),
    },
    Kind {
        name: "colmap-images-text",
        about: "images of a COLMAP model as text",
        extension: "txt",
        share: 1,
        make: || Arc::new(datasets::Datasets::new("sparse/0/images.txt")),
    },
    Kind {
        name: "colmap-points",
        about: "points of a binary COLMAP model",
        extension: "bin",
        share: 1,
        make: || Arc::new(points::Points::new("points3D.bin")),
    },
    Kind {
        name: "colmap-points-text",
        about: "points of a COLMAP model as text",
        extension: "txt",
        share: 1,
        make: || Arc::new(points::Points::new("points3D.txt")),
    },
    Kind {
        name: "points",
        about: "points to begin a training with (.ply), as text and binary",
        extension: "ply",
        share: 1,
        make: || Arc::new(points::Points::new("points.ply")),
    },
    Kind {
        name: "cfg-args",
        about: "cfg_args in the folder of a checkpoint",
        extension: "txt",
        share: 1,
        make: || Arc::new(settings::CfgArgs::new()),
    },
    Kind {
        name: "options",
        about: "the options of a checkpoint in RON, as settings of Bevy's loader, on a checkpoint and a package",
        extension: "ron",
        share: 1,
        make: || Arc::new(settings::Options::new()),
    },
    Kind {
        name: "edits",
        about: "lists of edits (.ron), applied to a scene in each form",
        extension: "ron",
        share: 1,
        make: || Arc::new(edits::Edits::new()),
    },
    Kind {
        name: "known-points",
        about: "points of a scene whose tracks are known (points.json of a film)",
        extension: "json",
        share: 1,
        make: || Arc::new(known_points::KnownPoints::new()),
    },
    Kind {
        name: "scores",
        about: "scores to prune by and weights of colors (.f32)",
        extension: "f32",
        share: 1,
        make: || Arc::new(scores::ScoreFiles::new()),
    },
    Kind {
        name: "pictures",
        about: "training images and masks (PNG, JPEG, EXR), in both modes, and their size",
        extension: "png",
        share: 1,
        make: || Arc::new(pictures::Pictures::new()),
    },
    Kind {
        name: "raw-pictures",
        about: "raw pictures (.f32) to compare",
        extension: "f32",
        share: 1,
        make: || Arc::new(pictures::RawPictures::new()),
    },
    Kind {
        name: "saved",
        about: "stored results of a bake, from which it resumes",
        extension: "saved",
        share: 10,
        make: || Arc::new(saved::Saved::new()),
    },
    Kind {
        name: "parts",
        about: "parts of shards of scores, masks and evaluations",
        extension: "gs4p",
        share: 2,
        make: || Arc::new(parts::Parts::new()),
    },
    Kind {
        name: "ply",
        about: "PLY of 3DGS: binary in both orders of bytes and as text, with lists",
        extension: "ply",
        share: 1,
        make: || Arc::new(imports::Imports::new("ply")),
    },
    Kind {
        name: "moving-ply",
        about: "PLY of the sources of .sogst and .sog4d",
        extension: "ply",
        share: 1,
        make: || Arc::new(imports::Imports::new("moving-ply")),
    },
    Kind {
        name: "free-time",
        about: "PLY of FreeTimeGS",
        extension: "ply",
        share: 1,
        make: || Arc::new(imports::Imports::new("free-time")),
    },
    Kind {
        name: "spacetime",
        about: "PLY of Spacetime Gaussians",
        extension: "ply",
        share: 1,
        make: || Arc::new(imports::Imports::new("spacetime")),
    },
    Kind {
        name: "compressed-ply",
        about: "compressed PLY",
        extension: "ply",
        share: 1,
        make: || Arc::new(imports::Imports::new("compressed-ply")),
    },
    Kind {
        name: "ply4d",
        about: ".ply4d files",
        extension: "ply4d",
        share: 1,
        make: || Arc::new(imports::Imports::new("ply4d")),
    },
    Kind {
        name: "sequence",
        about: "sequences of PLY",
        extension: "zip",
        share: 1,
        make: || Arc::new(imports::Imports::new("sequence")),
    },
    Kind {
        name: "splat",
        about: ".splat files",
        extension: "splat",
        share: 1,
        make: || Arc::new(imports::Imports::new("splat")),
    },
    Kind {
        name: "ksplat",
        about: "captures of GaussianSplats3D in every level of compression",
        extension: "ksplat",
        share: 1,
        make: || Arc::new(imports::Imports::new("ksplat")),
    },
    Kind {
        name: "splatv",
        about: "captures of splaTV",
        extension: "splatv",
        share: 1,
        make: || Arc::new(imports::Imports::new("splatv")),
    },
    Kind {
        name: "npz",
        about: "parameters of Dynamic 3D Gaussians",
        extension: "npz",
        share: 1,
        make: || Arc::new(imports::Imports::new("npz")),
    },
    Kind {
        name: "4dgs",
        about: ".4dgs files, with windows and tracks",
        extension: "4dgs",
        share: 1,
        make: || Arc::new(imports::Imports::new("4dgs")),
    },
    Kind {
        name: "sog",
        about: "SOG of versions 1 and 2",
        extension: "sog",
        share: 1,
        make: || Arc::new(imports::Imports::new("sog")),
    },
    Kind {
        name: "sogst",
        about: ".sogst, in groups and on curved paths",
        extension: "sogst",
        share: 1,
        make: || Arc::new(imports::Imports::new("sogst")),
    },
    Kind {
        name: "sog4d",
        about: ".sog4d in both encodings",
        extension: "sog4d",
        share: 1,
        make: || Arc::new(imports::Imports::new("sog4d")),
    },
    Kind {
        name: "tsog",
        about: "TSOG of frames and of motion",
        extension: "tsog",
        share: 1,
        make: || Arc::new(imports::Imports::new("tsog")),
    },
    Kind {
        name: "streamed-sog",
        about: "SOG in levels of detail, with the files of its folder",
        extension: "zip",
        share: 1,
        make: || Arc::new(imports::Imports::new("streamed-sog")),
    },
    Kind {
        name: "spz",
        about: "SPZ of versions 2 to 4",
        extension: "spz",
        share: 1,
        make: || Arc::new(imports::Imports::new("spz")),
    },
    Kind {
        name: "glb",
        about: "glTF with KHR_gaussian_splatting, in one file: nodes, drafts, SPZ inside",
        extension: "glb",
        share: 1,
        make: || Arc::new(imports::Imports::new("glb")),
    },
    Kind {
        name: "gltf",
        about: "the same as text, with data URIs",
        extension: "gltf",
        share: 1,
        make: || Arc::new(imports::Imports::new("gltf")),
    },
];
