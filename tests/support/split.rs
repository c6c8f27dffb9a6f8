//! Synthetic captures that `gs4d split` has cut.
//!
//! Out: the index and the chunk files of a capture, all of them in one file, and the capture that `gs4d join` makes of
//! them.

use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::scene::ChunkTable;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, LazyLock};

/// A capture in chunk files.
pub struct Split {
    /// The index and the chunk files, by name.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The capture that `gs4d join` makes of them.
    pub joined: Vec<u8>,
    /// The file of the index and all chunk files.
    pub one: Vec<u8>,
    pub table: Arc<ChunkTable>,
}

pub static SPLIT: LazyLock<Split> = LazyLock::new(|| {
    let split = split("--count 12000 --sh-degree 0", None, "--chunk 0.5 --layers 25,25,50");
    assert_eq!((split.table.stretches, split.table.layers()), (8, 3), "stretches of half a second, in three layers");
    split
});

/// A packed capture in chunk files, whose codebooks are in the index.
pub static PACKED: LazyLock<Split> = LazyLock::new(|| {
    let order = "--chunk 1 --layers 25,75 --codebooks 64,32 --verify 0";
    let split = split("--count 30000 --sh-degree 1", Some(order), "");
    assert_eq!((split.table.stretches, split.table.layers()), (4, 2), "stretches of a second, in two layers");
    split
});

/// Makes a synthetic capture with these options, compresses it with others, if any, and cuts it with further ones.
fn split(synthetic: &str, packed: Option<&str>, cut: &str) -> Split {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [mut whole, chunks, joined, one] =
        ["whole.gs4d", "chunks", "joined.gs4d", "one.gs4d"].map(|name| folder.path().join(name));
    let words = |words: &str| words.split_whitespace().map(OsString::from).collect::<Vec<_>>();
    let file = |path: &Path| vec![path.as_os_str().to_owned()];
    run(&[words("synth"), file(&whole), words(synthetic), words("--duration 4 --level 1")].concat());
    if let Some(order) = packed {
        let out = folder.path().join("packed.gs4d");
        run(&[words("compress"), file(&whole), file(&out), words(order), words("--level 1")].concat());
        whole = out;
    }
    run(&[words("split"), file(&whole), words("-o"), file(&chunks), words(cut), words("--level 1")].concat());
    run(&[words("split"), file(&whole), words("-o"), file(&one), words(cut), words("--level 1")].concat());
    run(&[words("join"), file(&chunks), words("-o"), file(&joined), words("--level 1")].concat());
    let read = |path: &Path| fs::read(path).expect("the command has written it");
    let entries = fs::read_dir(&chunks).expect("the command has made it").map(|entry| entry.expect("readable"));
    let files = entries.map(|entry| (entry.file_name().to_string_lossy().into_owned(), read(&entry.path()))).collect();
    let index = codec::load(&chunks.join(ChunkTable::INDEX), &ReadOptions::default()).expect("a package");
    let table = index.chunks.expect("an index has a table");
    Split { files, joined: read(&joined), one: read(&one), table }
}

/// Runs the `gs4d` command.
fn run(arguments: &[OsString]) {
    let output = Command::new(env!("CARGO_BIN_EXE_gs4d")).args(arguments).output().expect("the command starts");
    assert!(output.status.success(), "gs4d {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}
