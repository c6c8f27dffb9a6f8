//! The order in which a packed capture stores its Gaussians.
//!
//! In: options. Out: a [`PackedOrder`].

use super::values;
use crate::offline::compress::PackedOrder;
use crate::offline::segments::{Cut, LayerShares};

/// The order in which a packed capture stores its Gaussians: usually as they are in space.
#[derive(clap::Args)]
pub(crate) struct OrderArgs {
    /// Store the most important Gaussians first, so that a player shows a coarse picture before the whole file is there.
    #[arg(long)]
    pub progressive: bool,
    /// Store the Gaussians in the order of chunk files of this many seconds, into which gs4d split cuts the package
    /// without a change of its values.
    #[arg(long, value_name = "SECONDS", value_parser = values::positive, conflicts_with = "progressive")]
    chunk: Option<f32>,
    /// With --chunk: shares of the Gaussians in layers, percent, the most important first [default: 25,25,50].
    #[arg(long, value_name = "PERCENT,..", value_parser = values::layers, requires = "chunk")]
    layers: Option<LayerShares>,
}

impl OrderArgs {
    /// Returns the order.
    pub(crate) fn order(&self) -> PackedOrder {
        let layers = || self.layers.clone().unwrap_or_default();
        match self.chunk {
            Some(seconds) => PackedOrder::Chunks(Cut { seconds, layers: layers() }),
            None if self.progressive => PackedOrder::Progressive,
            None => PackedOrder::Spatial,
        }
    }
}
