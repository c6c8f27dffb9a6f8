//! Files in which chunk files may follow an index: which parts of such a file are read.
//!
//! In: a reader of an asset source. Out: the bytes of the index, if its chunk files follow and the source can give
//! parts of the file; else all bytes.

use crate::codec::package::Following;
use bevy::asset::io::{AssetSourceId, Reader};
use bevy::ecs::resource::Resource;
use bevy::tasks::futures_lite::AsyncReadExt;
use std::io::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes that are read at first, which most often have the header of a package.
const FIRST: usize = 1 << 16;
/// Most bytes that are read at once: a header may say any number.
pub(super) const PIECE: usize = 8 << 20;

/// Which of the sources `http` and `https` give parts of files: those of
/// [`HttpRangesPlugin`](crate::stream::HttpRangesPlugin), from the first file on that is read through them. Those of
/// Bevy itself seek in a file that has been received whole.
#[derive(Debug, Clone, Default, Resource)]
pub(crate) struct PartSources(Arc<[AtomicBool; 2]>);

impl PartSources {
    const NAMES: [&str; 2] = ["http", "https"];

    /// Notes that a file is read through a source that gives parts.
    #[cfg(feature = "http_ranges")]
    pub(crate) fn note(&self, name: &str) {
        for (own, is_used) in Self::NAMES.iter().zip(self.0.iter()) {
            if *own == name {
                is_used.store(true, Ordering::Relaxed);
            }
        }
    }

    /// Returns whether a source gives parts of files.
    fn give_parts(&self, source: &AssetSourceId<'_>) -> bool {
        match source {
            // The files of a page and of an Android package are read whole before they seek.
            AssetSourceId::Default => cfg!(not(any(target_arch = "wasm32", target_os = "android"))),
            AssetSourceId::Name(name) => match Self::NAMES.iter().position(|own| *own == &**name) {
                Some(index) => self.0[index].load(Ordering::Relaxed),
                None => cfg!(not(target_arch = "wasm32")),
            },
        }
    }
}

/// What has been read of a file.
pub(super) enum ReadFile {
    /// All of it.
    Whole(Vec<u8>),
    /// All of an index that chunk files follow, for the reason that parts of it cannot be read.
    WithoutParts(Vec<u8>),
    /// The index before its chunk files.
    Index(Vec<u8>),
}

/// Reads a file of a source: the index, if chunk files follow it and parts can be read.
pub(super) async fn read_file(
    reader: &mut dyn Reader,
    source: &AssetSourceId<'_>,
    sources: &PartSources,
) -> Result<ReadFile, Error> {
    let (mut bytes, mut step) = (Vec::new(), FIRST);
    loop {
        let more = match Following::of(&bytes) {
            Following::Undecided => step,
            Following::From(_) if !sources.give_parts(source) || reader.seekable().is_err() => {
                reader.read_to_end(&mut bytes).await?;
                return Ok(ReadFile::WithoutParts(bytes));
            }
            Following::From(first) if bytes.len() as u64 >= first => {
                bytes.truncate(first as usize);
                return Ok(ReadFile::Index(bytes));
            }
            Following::From(first) => usize::try_from(first - bytes.len() as u64).unwrap_or(usize::MAX).min(PIECE),
            Following::Nothing => {
                reader.read_to_end(&mut bytes).await?;
                return Ok(ReadFile::Whole(bytes));
            }
        };
        if read_more(reader, &mut bytes, more).await? == 0 {
            return Ok(ReadFile::Whole(bytes));
        }
        step = (step * 2).min(PIECE);
    }
}

/// Reads up to `more` bytes, and returns their number: fewer only at the end of the file.
pub(super) async fn read_more(reader: &mut dyn Reader, bytes: &mut Vec<u8>, more: usize) -> Result<usize, Error> {
    let before = bytes.len();
    bytes.resize(before + more, 0);
    let mut filled = before;
    while filled < bytes.len() {
        let read = reader.read(bytes.get_mut(filled..).unwrap_or_default()).await?;
        if read == 0 {
            break;
        }
        filled += read;
    }
    bytes.truncate(filled);
    Ok(filled - before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::package::{WriteSettings, write, write_index};
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{ChunkFile, ChunkTable, GaussianScene};
    use bevy::asset::io::VecReader;
    use bevy::tasks::block_on;

    /// Returns an index with 3000 chunk files of a byte, so that its header is long, and its length.
    fn file() -> (Vec<u8>, usize) {
        let file = ChunkFile { stretches: [0, 0], layer: 0, gaussians: 1, bytes: 1 };
        let files = vec![file; 3000];
        let table = ChunkTable { stretches: 1, gaussian_bytes: 80, files, utilities: Vec::new(), first_byte: None };
        let empty = synthesize(&SynthSettings { count: 0, ..SynthSettings::default() });
        let index = GaussianScene { chunks: Some(Arc::new(table)), ..empty };
        let mut bytes = Vec::new();
        write_index(&mut bytes, &index, &WriteSettings::default()).expect("an index can be written");
        let length = bytes.len();
        bytes.extend([7; 3000]);
        (bytes, length)
    }

    fn read(bytes: &[u8], source: AssetSourceId<'_>) -> ReadFile {
        block_on(read_file(&mut VecReader::new(bytes.to_vec()), &source, &PartSources::default())).expect("bytes")
    }

    #[test]
    fn of_an_index_and_its_chunk_files_the_index_is_read() {
        let (bytes, length) = file();
        for source in [AssetSourceId::Default, AssetSourceId::from("packs")] {
            let ReadFile::Index(index) = read(&bytes, source) else { panic!("the index alone") };
            assert!(index == bytes[..length], "up to the first chunk file");
        }
        let ReadFile::WithoutParts(whole) = read(&bytes, AssetSourceId::from("https")) else { panic!("all of it") };
        assert!(whole == bytes, "from a server whose source reads files whole");
        let ReadFile::Whole(short) = read(&bytes[..length - 1], AssetSourceId::Default) else { panic!("all of it") };
        assert_eq!(short.len(), length - 1, "an index that is cut off");
    }

    #[test]
    fn of_any_other_file_all_is_read() {
        let mut package = Vec::new();
        let settings = SynthSettings { count: 2000, ..SynthSettings::default() };
        write(&mut package, &synthesize(&settings), &WriteSettings::default()).expect("a package can be written");
        for bytes in [&package[..], b"ply", b""] {
            let ReadFile::Whole(whole) = read(bytes, AssetSourceId::Default) else { panic!("all of it") };
            assert!(whole == bytes, "all {} bytes", bytes.len());
        }
    }
}
