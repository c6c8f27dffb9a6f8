//! Items for the tests and benchmarks of this crate alone, outside its public interface: no promise holds for them.
//!
//! In: the modules of the crate that are private. Out: their items, by the same paths behind `internal`.

/// Of [`gaussian`](crate::gaussian).
pub mod gaussian {
    pub use crate::gaussian::gradient::{
        GradientSettings, ParameterGradient, SplatGradient, parameter_gradient, slice_gradient,
    };
    pub use crate::gaussian::slice::rotation_4d;
    pub use crate::gaussian::{alpha::*, conic::*, harmonics::*, overlap::*, projection::*};
}

/// Of [`reference`](mod@crate::reference): the passes, beside its public items.
pub mod reference {
    pub use crate::reference::*;
    pub use crate::reference::{
        activate::*, bin::*, blend::*, blend_backward::*, motion::*, project::*, sort::*, tile_lists::*,
    };
}

/// Of [`scene`](crate::scene).
pub mod scene {
    pub use crate::scene::packed::{encode::*, order::*};
    pub use crate::scene::{detail::*, filter::*, merge_neighbors::*, packed::*};
}

/// Of [`codec`](crate::codec).
pub mod codec {
    use crate::codec::import::source::InMemory;
    use crate::codec::{CodecErrorKind, ReadOptions};
    use crate::scene::GaussianScene;
    use std::path::Path;

    pub use crate::codec::import::sequence::next as next_frame;

    /// Reads the frames of a sequence, each the name and the bytes of a file, without options: the scene, and what it does not show.
    ///
    /// # Errors
    /// As [`load`](crate::codec::load).
    pub fn read_frames(frames: Vec<(String, Vec<u8>)>) -> Result<(GaussianScene, Vec<String>), CodecErrorKind> {
        let imported = crate::codec::read_frames(frames, &ReadOptions::default())?;
        Ok((imported.scene, imported.lost))
    }

    /// Reads a capture of another make from bytes in memory, without options and without other files: the scene, and what it does not show.
    ///
    /// # Errors
    /// As [`load`](crate::codec::load).
    pub fn read_bytes(path: &Path, bytes: &[u8]) -> Result<(GaussianScene, Vec<String>), CodecErrorKind> {
        read_beside(path, bytes, Vec::new())
    }

    /// As [`read_bytes`], with the other files of its folder.
    ///
    /// # Errors
    /// As [`load`](crate::codec::load).
    pub fn read_beside(
        path: &Path,
        bytes: &[u8],
        others: Vec<(String, Vec<u8>)>,
    ) -> Result<(GaussianScene, Vec<String>), CodecErrorKind> {
        let others = InMemory(others.into_iter().collect());
        let imported = crate::codec::read_bytes(path, bytes.to_vec(), others, &ReadOptions::default())?;
        Ok((imported.scene, imported.lost))
    }

    pub use crate::codec::checkpoint::options::*;
    pub use crate::codec::export::{error::*, exporter::*, table::*};
    pub use crate::codec::format::*;
    pub use crate::codec::package::section::*;
}

/// Of `renderer`.
#[cfg(feature = "renderer")]
pub mod renderer {
    pub use crate::renderer::device::{bind::*, memory::*};
    pub use crate::renderer::frame::Blending;
    pub use crate::renderer::global_sort::{AtOnce, FinishedFrame, PassBuffers};
    pub use crate::renderer::tile_bins::{COUNTED, EIGHT_AT_ONCE, FEW_BINS, LARGE_BATCHES, Lists, OPAQUE};
    pub use crate::renderer::{layout::*, shaders::*};
}

/// Of `offline`: the passes of scoring and training, and each wing's private items.
#[cfg(feature = "offline")]
pub mod offline {
    /// Of `engine`: the passes of scoring and training.
    pub mod engine {
        pub use crate::offline::engine::{layout::*, shaders::*};
    }

    /// Of `compress`.
    pub mod compress {
        pub use crate::offline::compress::{codebook::*, roundings::*};
    }
    /// Of `dataset`.
    pub mod dataset {
        pub use crate::offline::dataset::cameras::{clock::*, drawing::*};
        pub use crate::offline::dataset::point_cloud::*;
        pub use crate::offline::dataset::{selection::*, splits::*, summary::*, validation::*};
    }
    /// Of `filter`.
    pub mod filter {
        pub use crate::offline::filter::{temporal_filter::*, visibility_masks::*};
    }
    /// Of `measure`.
    pub mod measure {
        pub use crate::offline::measure::metrics::{ms_ssim::*, ssim::*};
        pub use crate::offline::measure::{
            belonging::*, comparison::*, evaluation::*, evaluation_parts::*, reference_pictures::*,
        };
    }
    /// Of `prune`.
    pub mod prune {
        pub use crate::offline::prune::{search::*, select::*, smallest_count::*};
    }
    /// Of `score`.
    pub mod score {
        pub use crate::offline::score::{engine::*, file::*, gpu::*, parts::*, reference::*, traits::*};
    }
    /// Of `store`.
    pub mod store {
        pub use crate::offline::store::shard::{Label, Shard, part::*};
        pub use crate::offline::store::{results::*, stored::*};
    }
    /// Of `train`.
    pub mod train {
        pub use crate::offline::train::gpu::{sample::*, totals::*};
        pub use crate::offline::train::parts::{
            PART_SHADERS, regularizer::TermWeights, request::*, standing::StandingUniforms,
        };
        pub use crate::offline::train::reference::{
            adam::*, cloning::*, dropout::*, environment_backward::*, exposure::*, loss::*, neighbors::*, noise::*,
            relocation::*, standing::*, terms::*,
        };
        pub use crate::offline::train::trainer::{state::*, step::*};
        pub use crate::offline::train::{densification::*, schedule::*, *};
    }
}

/// Of the plugin.
#[cfg(feature = "bevy")]
pub mod plugin {
    pub use crate::plugin::render::targets::checked_pipelines::CheckedPipelines;
}
