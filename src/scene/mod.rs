//! A capture in memory: its Gaussians and their color, an environment map, and its settings of training and playback.
//!
//! In: the result of a codec. Out: a [`GaussianScene`] that can be stored, or a [`RuntimeScene`] that can be drawn,
//! which [`into_runtime`](GaussianScene::into_runtime) returns. They differ in the [forms](SceneForm) that their
//! Gaussians may have.

mod bounds;
mod chunk_table;
mod collider;
mod conversion;
pub(crate) mod detail;
pub mod edit;
mod environment;
pub(crate) mod filter;
mod form;
mod gaussian_bytes;
mod gaussian_scene;
pub mod grow;
mod importances;
pub(crate) mod merge_neighbors;
pub(crate) mod near;
pub(crate) mod packed;
mod pick;
pub(crate) mod pieces;
mod provenance;
pub(crate) mod random;
mod runtime_scene;
mod select;
mod sliced;
mod socket;
mod sound_file;
pub mod synth;
pub(crate) mod union;

pub use bounds::{Bounds, BoundsOverTime};
pub use chunk_table::{ChunkFile, ChunkTable};
pub(crate) use collider::ColliderGrid;
pub use collider::{ColliderMesh, ColliderStretch, Colliders};
pub(crate) use conversion::Conversion;
pub(crate) use detail::MAX_LEVELS;
pub use environment::Environment;
pub use filter::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter};
pub use form::{ColorDegrees, Form, SceneForm, Trained};
pub use gaussian_scene::GaussianScene;
pub use importances::Importances;
pub use packed::{Bits, CodedColors, ColorCodebooks, PackError, PackedColors, PackedScene, Packing, RunPart, Runs};
pub use pick::{Pick, PickSettings};
pub use provenance::{Origin, PlaybackHints, RotationConvention, TrainedCameras, TrainedWith, UpAxis};
pub use runtime_scene::{Level, RuntimeScene};
pub use sliced::Sliced;
pub(crate) use socket::check_sockets;
pub use socket::{Socket, SocketSample};
pub use sound_file::SoundFile;
