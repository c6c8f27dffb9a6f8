//! Pickles of Python: what the unpicklers of checkpoints and of saved dictionaries share.
//!
//! In: the bytes of a pickle. Out: [`Tape`], which reads them, and [`Stack`], which refers to the values. Which opcodes
//! and objects a file may have, and what they mean, is the unpickler's.

mod stack;
mod tape;

pub(crate) use stack::{Id, Stack};
pub(crate) use tape::Tape;
