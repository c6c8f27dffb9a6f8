//! Chunk files are known by their names.
//!
//! In: paths that a person names. Out: the segments among them: a file each, or the chunks of one capture, whether their
//! folder is named or each of them. The index beside them is no segment.

use super::error::SegmentsError;
use crate::codec::package::Following;
use crate::offline::work::FileError;
use crate::scene::ChunkTable;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A capture to read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The file, or the folder of the chunks.
    pub path: PathBuf,
    /// The file, or all chunks in order.
    pub files: Vec<PathBuf>,
    /// Whether the files are chunks, or the one file has an index and all chunks.
    pub is_split: bool,
}

/// Returns the number of a chunk file, from 0, and the number of chunks; `None` for a file of another name than
/// [`ChunkTable::file_name`] returns.
pub(super) fn chunk_number(path: &Path) -> Option<(usize, usize)> {
    let name = path.file_name()?.to_str()?.strip_prefix("chunk-")?.strip_suffix(".gs4d")?;
    // A number may begin with a sign when it is parsed.
    let number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<usize>().ok())?;
    let (own, of) = name.split_once("-of-")?;
    let (own, of) = (number(own)?, number(of)?);
    (1..=of).contains(&own).then(|| (own - 1, of))
}

/// Returns the captures at these paths, in order. Chunks of one folder are one capture, where its first is.
///
/// # Errors
/// Chunks that are missing or are of two captures, a folder that cannot be listed.
pub fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, SegmentsError> {
    let (mut sources, mut seen) = (Vec::<Source>::new(), BTreeSet::new());
    for path in paths.iter().filter(|path| !is_index_of(path, paths)) {
        let chunks = if path.is_dir() { chunks_in(path)? } else { Vec::new() };
        let folder = match chunk_number(path) {
            _ if !chunks.is_empty() => path.clone(),
            Some(_) => path.parent().unwrap_or(Path::new("")).to_owned(),
            None => {
                sources.push(Source { path: path.clone(), files: vec![path.clone()], is_split: is_one_file(path) });
                continue;
            }
        };
        let chunks = if chunks.is_empty() { vec![path.clone()] } else { chunks };
        if let Some(twice) = chunks.iter().find(|chunk| !seen.insert((*chunk).clone())) {
            return Err(SegmentsError::Mixed { path: twice.clone() });
        }
        match sources.iter_mut().find(|source| source.is_split && source.path == folder) {
            Some(source) => source.files.extend(chunks),
            None => sources.push(Source { path: folder, files: chunks, is_split: true }),
        }
    }
    for source in sources.iter_mut().filter(|source| source.is_split && source.files != [source.path.as_path()]) {
        source.files.sort_by_key(|file| chunk_number(file));
        check_complete(source)?;
    }
    Ok(sources)
}

/// Returns whether a path is the index beside chunks that are named, too, as by `chunks/*`.
fn is_index_of(path: &Path, paths: &[PathBuf]) -> bool {
    let is_beside = |other: &PathBuf| chunk_number(other).is_some() && other.parent() == path.parent();
    path.file_name().is_some_and(|name| name == ChunkTable::INDEX) && paths.iter().any(is_beside)
}

/// Returns whether a file has an index that all chunks follow. A file that cannot be read is none: reading it says why.
fn is_one_file(path: &Path) -> bool {
    let Ok(mut file) = File::open(path) else { return false };
    let (mut bytes, mut step) = (Vec::new(), 1 << 16);
    loop {
        let read = Read::by_ref(&mut file).take(step).read_to_end(&mut bytes);
        match Following::of(&bytes) {
            Following::From(_) => return true,
            Following::Undecided if read.is_ok_and(|read| read > 0) => step *= 2,
            Following::Undecided | Following::Nothing => return false,
        }
    }
}

/// Returns the chunk files in a folder.
pub(super) fn chunks_in(folder: &Path) -> Result<Vec<PathBuf>, SegmentsError> {
    let entries = folder.read_dir().map_err(|error| FileError::at(folder, error))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let paths = paths.collect::<Result<Vec<_>, _>>().map_err(|error| FileError::at(folder, error))?;
    Ok(paths.into_iter().filter(|path| chunk_number(path).is_some()).collect())
}

/// Checks that the files, which are in order, are all chunks of one capture.
fn check_complete(source: &Source) -> Result<(), SegmentsError> {
    let numbers: Vec<(usize, usize)> = source.files.iter().filter_map(|file| chunk_number(file)).collect();
    let of = numbers.first().map_or(0, |(_, of)| *of);
    if let Some((file, _)) = source.files.iter().zip(&numbers).find(|(_, (_, other))| *other != of) {
        return Err(SegmentsError::Mixed { path: file.clone() });
    }
    let missing = (0..of).find(|number| numbers.get(*number) != Some(&(*number, of)));
    missing.map_or(Ok(()), |number| {
        Err(SegmentsError::Missing { folder: source.path.clone(), name: ChunkTable::file_name(number, of) })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn at(folder: &Path, names: &[String]) -> Vec<PathBuf> {
        names.iter().map(|name| folder.join(name)).collect()
    }

    #[test]
    fn chunks_are_known_by_their_names() {
        let last = Path::new("a").join(ChunkTable::file_name(11, 12));
        assert_eq!(last, Path::new("a/chunk-00012-of-00012.gs4d"), "numbers begin at 1");
        assert_eq!(chunk_number(&last), Some((11, 12)), "the last");
        assert_eq!(chunk_number(Path::new(ChunkTable::INDEX)), None, "the index is no chunk");
        for name in ["chunk-13-of-12.gs4d", "chunk-0-of-3.gs4d", "chunk-+1-of-3.gs4d", "chunk-1-of-2.ply", "a.gs4d"] {
            assert_eq!(chunk_number(Path::new(name)), None, "{name} is no chunk");
        }
    }

    #[test]
    fn a_folder_and_its_files_are_one_capture() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let names: Vec<String> = (0..3).map(|number| ChunkTable::file_name(number, 3)).collect();
        let chunks = at(folder.path(), &names);
        let index = folder.path().join(ChunkTable::INDEX);
        for path in chunks.iter().chain([&index, &folder.path().join("notes.txt")]) {
            fs::write(path, b"").expect("the folder can be written to");
        }
        let expected = Source { path: folder.path().to_owned(), files: chunks.clone(), is_split: true };
        let by_folder = sources(&[folder.path().to_owned()]).expect("all chunks are there");
        assert_eq!(by_folder, std::slice::from_ref(&expected), "the folder");
        let first = PathBuf::from("first.gs4d");
        let backwards: Vec<PathBuf> = [first.clone()].into_iter().chain(chunks.iter().rev().cloned()).collect();
        let by_files = sources(&backwards).expect("all chunks are named");
        assert_eq!((by_files.len(), &by_files[1]), (2, &expected), "each file, in the order of their numbers");
        assert!(!by_files[0].is_split && by_files[0].files == [first], "another file");
        let all: Vec<PathBuf> = chunks.iter().cloned().chain([index.clone()]).collect();
        assert_eq!(sources(&all).ok(), Some(vec![expected]), "the index beside them is left out");
        let alone = sources(std::slice::from_ref(&index)).expect("a file");
        assert!(!alone[0].is_split, "the index alone is a file as any other");

        let missing = sources(&[chunks[0].clone(), chunks[2].clone()]).expect_err("one is missing").to_string();
        assert!(missing.contains("chunk-00002-of-00003.gs4d is missing"), "by name: {missing}");
        let twice = sources(&[folder.path().to_owned(), chunks[1].clone()]);
        assert!(matches!(twice, Err(SegmentsError::Mixed { path }) if path == chunks[1]), "named twice");
        fs::write(folder.path().join(ChunkTable::file_name(0, 2)), b"").expect("the folder can be written to");
        let mixed = sources(&[folder.path().to_owned()]);
        assert!(matches!(mixed, Err(SegmentsError::Mixed { .. })), "chunks of two captures");
    }
}
