//! Errors of reading checkpoints.
//!
//! In: a problem found by the reader. Out: a message of one line that names the problem and, if there is one, the
//! remedy. [`CodecError`](crate::codec::CodecError) adds the path.

use crate::codec::options::InvalidOption;
use std::io;

/// Why a checkpoint was not read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The zip archive is damaged or incomplete.
    #[error("not a complete zip archive, which a checkpoint is ({0}); copy the file again")]
    Archive(zip::result::ZipError),
    /// The file could not be read.
    #[error("cannot be read ({0})")]
    Io(io::Error),
    /// Not exactly one `<folder>/data.pkl` in the archive.
    #[error("{0} entries named <folder>/data.pkl where a checkpoint has one; only files of torch.save can be read")]
    Root(usize),
    /// An entry that is compressed or encrypted, which torch never writes.
    #[error(
        "entry {0} is compressed or encrypted, and torch stores entries as they are; save the checkpoint again with torch.save"
    )]
    Packed(String),
    /// An entry that would reach beyond the end of the file.
    #[error("entry {entry} claims {size} bytes and the file has no room for them; copy the file again")]
    EntrySize {
        /// Name of the entry.
        entry: String,
        /// Bytes claimed.
        size: u64,
    },
    /// An entry larger than its content can need.
    #[error("entry {entry} is {size} bytes long, which is more than the {limit} that a checkpoint can need there")]
    TooLarge {
        /// Name of the entry.
        entry: &'static str,
        /// Its size in bytes.
        size: u64,
        /// The most that is accepted.
        limit: u64,
    },
    /// Values stored with the most significant byte first.
    #[error(
        "byte order {0:?}, and only little-endian checkpoints can be read; save it again on a little-endian machine"
    )]
    ByteOrder(String),
    /// `data.pkl` is malformed.
    #[error("data.pkl, byte {offset}: {reason}")]
    Pickle {
        /// Offset in bytes from the start of `data.pkl`.
        offset: usize,
        /// The reason.
        reason: String,
    },
    /// An opcode that no checkpoint of the trainer contains.
    #[error(
        "data.pkl, byte {offset}: pickle opcode {code:#04x} is not one that checkpoints use; refused. Export the Gaussians as PLY with the program that trained them"
    )]
    Opcode {
        /// Offset in bytes from the start of `data.pkl`.
        offset: usize,
        /// The opcode.
        code: u8,
    },
    /// A Python object that no checkpoint of the trainer contains. No code of the file was run.
    #[error(
        "data.pkl, byte {offset}: the file names the Python object `{name}`, which no 4DGS checkpoint needs; refused. Export the Gaussians as PLY with the program that trained them"
    )]
    Global {
        /// Offset in bytes from the start of `data.pkl`.
        offset: usize,
        /// Module and name, as in the pickle.
        name: String,
    },
    /// The objects in the file are not the state of the 4DGS trainer.
    #[error("{0}")]
    Layout(String),
    /// A slot of the state tuple, or an entry of a dictionary, holds the wrong kind of value.
    #[error("{} holds {found}, expected {expected}", place(.index, .name))]
    Slot {
        /// Index in the state tuple, from 0; `None` in a dictionary.
        index: Option<usize>,
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// The kind of value in the slot.
        found: &'static str,
        /// The kind of value that is expected.
        expected: &'static str,
    },
    /// A tensor does not have the shape that the other tensors require.
    #[error("{} has shape {found:?}, expected {expected}", place(.index, .name))]
    Shape {
        /// Index in the state tuple, from 0; `None` in a dictionary.
        index: Option<usize>,
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// Its shape.
        found: Vec<u64>,
        /// The shape it must have.
        expected: String,
    },
    /// A tensor lies outside its storage, or the storage is missing.
    #[error("{}: {reason}", place(.index, .name))]
    Tensor {
        /// Index in the state tuple, from 0; `None` in a dictionary.
        index: Option<usize>,
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// The reason.
        reason: String,
    },
    /// The values of a tensor could not be read, or do not match their checksum.
    #[error("{} cannot be read ({reason}); the file is damaged, copy it again", place(.index, .name))]
    Read {
        /// Index in the state tuple, from 0; `None` in a dictionary.
        index: Option<usize>,
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// The error of the system.
        reason: io::Error,
    },
    /// A value is infinite or not a number.
    #[error("{row} {at}: a value of {name} that is not finite; training diverged or the file is damaged")]
    NotFinite {
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// Name of a row of that attribute: Gaussian or channel.
        row: &'static str,
        /// Index of the row, from 0.
        at: usize,
    },
    /// A quaternion of length zero.
    #[error("Gaussian {at}: a quaternion of length zero in {name}; training diverged or the file is damaged")]
    ZeroRotation {
        /// Name of the attribute in the trainer.
        name: &'static str,
        /// Index of the Gaussian, from 0.
        at: usize,
    },
    /// An invalid option.
    #[error(transparent)]
    Option(#[from] InvalidOption),
}

/// Returns the words for a slot of the state tuple, or for an entry of a dictionary.
fn place(index: &Option<usize>, name: &str) -> String {
    match index {
        Some(index) => format!("slot {index} ({name})"),
        None => name.to_owned(),
    }
}
