//! Work in shards: the share of one machine in a computation, and the parts that all machines have written.
//!
//! In: a computation whose results add up. Out: the share of each shard, a file for its result ([`part`]), and the
//! check that files are all the parts of one computation ([`parts`]).

mod division;
mod label;
pub(crate) mod part;
pub(crate) mod parts;

pub use division::Shard;
pub use label::Label;
