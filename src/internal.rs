//! Items for the tests and benchmarks of this crate alone, outside its public interface: no promise holds for them.
//!
//! In: the modules of the crate that are private. Out: their items, by the same paths behind `internal`.

/// Of [`gaussian`](crate::gaussian).
pub mod gaussian {
    pub use crate::gaussian::gradient::{
        GradientSettings, ParameterGradient, SplatGradient, parameter_gradient, slice_gradient,
    };
    pub use crate::gaussian::slice::rotation_4d;

    /// The alpha of a splat at a pixel.
    pub mod alpha {
        pub use crate::gaussian::alpha::*;
    }
    /// The covariance of splats on the screen.
    pub mod conic {
        pub use crate::gaussian::conic::*;
    }
    /// Spherical harmonics.
    pub mod harmonics {
        pub use crate::gaussian::harmonics::*;
    }
    /// The tiles of a splat.
    pub mod overlap {
        pub use crate::gaussian::overlap::*;
    }
    /// The projection of a Gaussian.
    pub mod projection {
        pub use crate::gaussian::projection::*;
    }
}

/// Of [`reference`](mod@crate::reference): the passes, beside its public items.
pub mod reference {
    pub use crate::reference::activate::*;
    pub use crate::reference::bin::*;
    pub use crate::reference::blend::*;
    pub use crate::reference::blend_backward::*;
    pub use crate::reference::motion::*;
    pub use crate::reference::project::*;
    pub use crate::reference::sort::*;
    pub use crate::reference::tile_lists::*;
    pub use crate::reference::*;
}

/// Of [`scene`](crate::scene).
pub mod scene {
    pub use crate::scene::detail::*;
    pub use crate::scene::filter::*;
    pub use crate::scene::merge_neighbors::*;

    /// The packed form.
    pub mod packed {
        pub use crate::scene::packed::*;

        /// The order of Gaussians in packages.
        pub mod order {
            pub use crate::scene::packed::order::*;
        }
        /// Encoding.
        pub mod encode {
            pub use crate::scene::packed::encode::*;
        }
    }
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
        let beside = InMemory(others.into_iter().collect());
        let imported = crate::codec::read_bytes(path, bytes, &beside, &ReadOptions::default())?;
        Ok((imported.scene, imported.lost))
    }

    /// Checkpoints.
    pub mod checkpoint {
        pub use crate::codec::checkpoint::options::*;
    }
    /// Exports.
    pub mod export {
        pub use crate::codec::export::error::*;
        pub use crate::codec::export::exporter::*;
        pub use crate::codec::export::table::*;
    }
    /// The table of formats.
    pub mod format {
        pub use crate::codec::format::*;
    }
    /// Packages.
    pub mod package {
        pub use crate::codec::package::section::*;
    }
}

/// Of `renderer`.
#[cfg(feature = "renderer")]
pub mod renderer {
    pub use crate::renderer::global_sort::{FinishedFrame, PassBuffers};

    /// Pipelines and bind groups.
    pub mod bind {
        pub use crate::renderer::bind::*;
    }
    /// The layouts that shaders and Rust share.
    pub mod layout {
        pub use crate::renderer::layout::*;
    }
    /// Memory of the device.
    pub mod memory {
        pub use crate::renderer::memory::*;
    }
    /// The composed shaders.
    pub mod shaders {
        pub use crate::renderer::shaders::*;
    }
    /// Variants of the passes of the global sort.
    pub mod global_sort {
        pub use crate::renderer::global_sort::AtOnce;
    }
    /// Variants of the passes of tile bins.
    pub mod tile_bins {
        pub use crate::renderer::tile_bins::{
            Blending, COUNTED, EIGHT_AT_ONCE, FEW_BINS, LARGE_BATCHES, Lists, OPAQUE,
        };
    }
}

/// Of `offline`.
#[cfg(feature = "offline")]
pub mod offline {
    pub use crate::offline::sliced::*;

    /// The layouts that shaders and Rust share.
    pub mod layout {
        pub use crate::offline::layout::*;
    }
    /// The composed shaders.
    pub mod shaders {
        pub use crate::offline::shaders::*;
    }

    /// Checks whether images show a capture.
    pub mod belonging {
        pub use crate::offline::belonging::*;
    }
    /// Pairs of pictures to compare.
    pub mod comparison {
        pub use crate::offline::comparison::*;
    }
    /// Datasets.
    pub mod dataset {
        /// What times mean.
        pub mod clock {
            pub use crate::offline::dataset::clock::*;
        }
        /// Pictures of cameras.
        pub mod drawing {
            pub use crate::offline::dataset::drawing::*;
        }
        /// Points to begin a training with.
        pub mod point_cloud {
            pub use crate::offline::dataset::point_cloud::*;
        }
        /// Descriptions of folders.
        pub mod summary {
            pub use crate::offline::dataset::summary::*;
        }
        /// Subsets of views.
        pub mod selection {
            pub use crate::offline::dataset::selection::*;
        }
        /// Validation views.
        pub mod validation {
            pub use crate::offline::dataset::validation::*;
        }
    }
    /// Evaluation of scenes.
    pub mod evaluation {
        pub use crate::offline::evaluation::*;
    }
    /// Evaluations in parts.
    pub mod evaluation_parts {
        pub use crate::offline::evaluation_parts::*;
    }
    /// Training.
    pub mod fine_tune {
        pub use crate::offline::fine_tune::adam::*;
        pub use crate::offline::fine_tune::cloner::*;
        pub use crate::offline::fine_tune::cloning::*;
        pub use crate::offline::fine_tune::dropout::*;
        pub use crate::offline::fine_tune::environment_backward::*;
        pub use crate::offline::fine_tune::exposure::*;
        pub use crate::offline::fine_tune::growth::Cloning;
        pub use crate::offline::fine_tune::loss::*;
        pub use crate::offline::fine_tune::neighbors::*;
        pub use crate::offline::fine_tune::noise::*;
        pub use crate::offline::fine_tune::relocation::*;
        pub use crate::offline::fine_tune::sample::*;
        pub use crate::offline::fine_tune::state::*;
        pub use crate::offline::fine_tune::terms::*;
        pub use crate::offline::fine_tune::totals::*;
        pub use crate::offline::fine_tune::trainer::*;
    }
    /// Metrics.
    pub mod metrics {
        pub use crate::offline::metrics::ms_ssim::*;
        pub use crate::offline::metrics::ssim::*;
    }
    /// Decoding of pictures.
    pub mod picture_file {
        pub use crate::offline::picture_file::*;
    }
    /// Selection of Gaussians by score.
    pub mod prune {
        pub use crate::offline::prune::*;
    }
    /// The smallest count that a loss allows.
    pub mod quality {
        pub use crate::offline::quality::*;
    }
    /// Quantization.
    pub mod quantize {
        pub use crate::offline::quantize::roundings::*;

        /// Codebooks.
        pub mod codebook {
            pub use crate::offline::quantize::codebook::*;
        }
    }
    /// Scores.
    pub mod score {
        pub use crate::offline::score::engine::*;
        pub use crate::offline::score::file::*;
        pub use crate::offline::score::gpu::*;
        pub use crate::offline::score::parts::*;
        pub use crate::offline::score::reference::*;
        pub use crate::offline::score::traits::*;
    }
    /// Search for the best score.
    pub mod search {
        pub use crate::offline::search::*;
    }
    /// Gaussians that views show.
    pub mod seen {
        pub use crate::offline::seen::*;
    }
    /// Work in shards.
    pub mod shard {
        pub use crate::offline::shard::{Label, Shard};

        /// Files of parts.
        pub mod part {
            pub use crate::offline::shard::part::*;
        }
    }
    /// Splits of datasets.
    pub mod splits {
        pub use crate::offline::splits::*;
    }
    /// Stages and their results.
    pub mod store {
        pub use crate::offline::store::*;
    }
    /// Types that stages store.
    pub mod stored {
        pub use crate::offline::stored::*;
    }
    /// Training from pictures alone.
    pub mod train {
        pub use crate::offline::train::*;
    }
    /// Key-frame masks and intervals.
    pub mod temporal_filter {
        pub use crate::offline::temporal_filter::*;
    }
}

/// Of the plugin.
#[cfg(feature = "bevy")]
pub mod plugin {
    pub use crate::plugin::render::checked_pipelines::CheckedPipelines;
}
