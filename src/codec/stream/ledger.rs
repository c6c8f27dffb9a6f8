//! The ledger of a stream: which files are on the way or there, and how many bytes they take.
//!
//! In: requests, arrivals, files that are given up. Out: the [`FileState`] of each file, and sums of bytes.

use crate::scene::{ChunkFile, ChunkTable};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Whether a file is there.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FileState {
    /// Neither there nor on the way.
    #[default]
    Absent,
    /// On the way.
    Requested,
    /// There.
    Resident,
}

/// The files of a capture that are on the way or there.
#[derive(Debug, Clone)]
pub(super) struct Ledger {
    table: Arc<ChunkTable>,
    /// Whether files take whole pages on the GPU.
    is_in_pages: bool,
    /// The state of each file.
    states: Vec<FileState>,
    /// The files in two of these states.
    requested: BTreeSet<usize>,
    resident: BTreeSet<usize>,
    gpu_bytes: u64,
    host_bytes: u64,
    /// Bytes on the GPU of all files of the table.
    all_gpu_bytes: u64,
}

impl Ledger {
    /// Returns the ledger of a capture of which no file is there.
    pub(super) fn new(table: Arc<ChunkTable>) -> Self {
        let all = (0..table.files.len()).map(|file| table.gpu_bytes(file));
        Self {
            states: vec![FileState::Absent; table.files.len()],
            is_in_pages: false,
            requested: BTreeSet::new(),
            resident: BTreeSet::new(),
            gpu_bytes: 0,
            host_bytes: 0,
            all_gpu_bytes: all.fold(0, u64::saturating_add),
            table,
        }
    }

    /// Returns the ledger of a capture of which no file is there, and whose files take whole pages on the GPU.
    pub(super) fn in_pages(table: Arc<ChunkTable>) -> Self {
        let all = (0..table.files.len()).map(|file| table.page_bytes(file));
        Self { is_in_pages: true, all_gpu_bytes: all.fold(0, u64::saturating_add), ..Self::new(table) }
    }

    /// Returns the table of the files.
    pub(super) fn table(&self) -> &Arc<ChunkTable> {
        &self.table
    }

    /// Returns the state of a file.
    pub(super) fn state(&self, file: usize) -> FileState {
        self.states.get(file).copied().unwrap_or_default()
    }

    /// Returns the numbers of the files on the way.
    pub(super) fn requested(&self) -> &BTreeSet<usize> {
        &self.requested
    }

    /// Returns the numbers of the files that are there.
    pub(super) fn resident(&self) -> &BTreeSet<usize> {
        &self.resident
    }

    /// Returns the bytes on the GPU of all files on the way or there.
    pub(super) fn gpu_bytes(&self) -> u64 {
        self.gpu_bytes
    }

    /// Returns the bytes that a file takes on the GPU.
    pub(super) fn gpu_bytes_of(&self, file: usize) -> u64 {
        if self.is_in_pages { self.table.page_bytes(file) } else { self.table.gpu_bytes(file) }
    }

    /// Returns the bytes on the GPU of all files of the table.
    pub(super) fn all_gpu_bytes(&self) -> u64 {
        self.all_gpu_bytes
    }

    /// Returns the bytes in memory of all files on the way: the files, and their Gaussians.
    pub(super) fn host_bytes(&self) -> u64 {
        self.host_bytes
    }

    /// Returns whether a file may be on the way beside the others within a limit of bytes in memory. A file may always
    /// be on the way alone.
    pub(super) fn has_host_room(&self, file: usize, limit: u64) -> bool {
        let sum = self.host_bytes.checked_add(self.host_bytes_of(file));
        self.requested.is_empty() || sum.is_some_and(|sum| sum <= limit)
    }

    /// Counts a file that is absent as on the way. The bytes of all files on the GPU are less than 2^64, since a limit
    /// has been compared with them.
    pub(super) fn request(&mut self, file: usize) {
        if self.change(file, FileState::Absent, FileState::Requested) {
            self.requested.insert(file);
            self.gpu_bytes += self.gpu_bytes_of(file);
            self.host_bytes += self.host_bytes_of(file);
        }
    }

    /// Counts a file on the way as there. Returns `false` for any other file.
    pub(super) fn arrive(&mut self, file: usize) -> bool {
        let was_requested = self.change(file, FileState::Requested, FileState::Resident);
        if was_requested {
            self.requested.remove(&file);
            self.resident.insert(file);
            self.host_bytes -= self.host_bytes_of(file);
        }
        was_requested
    }

    /// Counts a file on the way as absent. Returns `false` for any other file.
    pub(super) fn end_request(&mut self, file: usize) -> bool {
        let was_requested = self.change(file, FileState::Requested, FileState::Absent);
        if was_requested {
            self.requested.remove(&file);
            self.gpu_bytes -= self.gpu_bytes_of(file);
            self.host_bytes -= self.host_bytes_of(file);
        }
        was_requested
    }

    /// Counts a file that is there as absent.
    pub(super) fn remove(&mut self, file: usize) {
        if self.change(file, FileState::Resident, FileState::Absent) {
            self.resident.remove(&file);
            self.gpu_bytes -= self.gpu_bytes_of(file);
        }
    }

    /// Changes the state of a file. Returns `false` if the file is in another state.
    fn change(&mut self, file: usize, from: FileState, to: FileState) -> bool {
        let state = self.states.get_mut(file).filter(|state| **state == from);
        state.map(|state| *state = to).is_some()
    }

    /// Returns the bytes that a file takes in memory while it is on the way, where its Gaussians are not in pages.
    fn host_bytes_of(&self, file: usize) -> u64 {
        let bytes = self.table.files.get(file).map_or(0, |ChunkFile { bytes, .. }| *bytes);
        bytes.saturating_add(self.table.gpu_bytes(file))
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::table;
    use super::*;
    use crate::scene::packed::BLOCK;

    #[test]
    fn bytes_are_counted_with_the_states_of_files() {
        // 10 and 20 bytes on the GPU, and as many in the file.
        let mut ledger = Ledger::new(table(1, &[([0, 0], 0, 10), ([0, 0], 0, 20)]).into());
        let bytes = |ledger: &Ledger| (ledger.gpu_bytes(), ledger.host_bytes());
        ledger.request(0);
        ledger.request(1);
        assert_eq!((bytes(&ledger), ledger.state(1)), ((30, 60), FileState::Requested), "two requests");
        assert!(ledger.arrive(1) && !ledger.arrive(1), "a file arrives once");
        assert_eq!((bytes(&ledger), ledger.state(1)), ((30, 20), FileState::Resident), "a file has arrived");
        assert!(ledger.end_request(0) && !ledger.end_request(0) && !ledger.end_request(1), "a request ends once");
        assert_eq!((bytes(&ledger), ledger.state(0)), ((20, 0), FileState::Absent), "a request has ended");
        assert!(!ledger.arrive(0), "a file that was not asked for does not count");
        ledger.remove(1);
        ledger.remove(1);
        assert_eq!((bytes(&ledger), ledger.state(1)), ((0, 0), FileState::Absent), "a file has been given up");
    }

    #[test]
    fn files_in_pages_take_whole_pages_on_the_gpu_and_no_more_in_memory() {
        assert_eq!(ChunkTable::PAGE, BLOCK as u64, "a page is a block of the packed form");
        // Gaussians of a byte each, and as many bytes in the file.
        let mut ledger = Ledger::in_pages(table(1, &[([0, 0], 0, 257), ([0, 0], 0, 256)]).into());
        assert_eq!([0, 1, 2].map(|file| ledger.gpu_bytes_of(file)), [512, 256, 0], "two pages, one, and no file");
        let bytes = |ledger: &Ledger| (ledger.gpu_bytes(), ledger.host_bytes());
        ledger.request(0);
        ledger.request(1);
        assert_eq!(bytes(&ledger), (768, 514 + 512), "two requests");
        assert!(ledger.arrive(0) && ledger.end_request(1), "one arrives, and one ends");
        assert_eq!(bytes(&ledger), (512, 0), "a file is there");
        ledger.remove(0);
        assert_eq!(bytes(&ledger), (0, 0), "the file has been given up");
    }

    #[test]
    fn a_file_may_always_be_on_the_way_alone() {
        let mut ledger = Ledger::new(table(1, &[([0, 0], 0, 10), ([0, 0], 0, 20)]).into());
        assert!(ledger.has_host_room(1, 5), "larger than the limit, but alone");
        ledger.request(0);
        assert!(!ledger.has_host_room(1, 59) && ledger.has_host_room(1, 60), "20 and 40 bytes");
    }
}
