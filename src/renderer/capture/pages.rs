//! Pages: where the Gaussians of chunk files are in the buffers of a capture.
//!
//! In: the number of pages ([`PAGE`] Gaussians each) of the buffers; files that come and go, and how many of their
//! Gaussians are active in each segment of time. Out: the pages of each file, and for a segment the pages that have
//! Gaussians of it, in the order of the files: the order of a capture that is loaded whole. Nothing here needs a GPU.

use crate::renderer::layout::PAGE;
use crate::scene::ChunkTable;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The pages of a capture, part after part.
#[derive(Debug)]
pub(in crate::renderer) struct Pages {
    /// Number of pages, and of those of each part but the last.
    count: u32,
    per_part: u32,
    free: BTreeSet<u32>,
    files: BTreeMap<usize, PagedFile>,
    /// Changes with the files that can be drawn.
    version: u64,
}

/// A file in pages.
#[derive(Debug)]
struct PagedFile {
    /// Its pages, in the order of its Gaussians: ascending.
    pages: Vec<u32>,
    gaussians: usize,
    /// Its Gaussians in each part of the buffers.
    pieces: Vec<Piece>,
    /// Whether all of it has been written.
    is_filled: bool,
}

/// The Gaussians of a file in one part of the buffers.
#[derive(Debug, Clone)]
struct Piece {
    part: u32,
    /// Of the pages of the file.
    pages: Range<usize>,
    /// Number of active Gaussians of the segments from `first` on; none of others.
    first: usize,
    active: Vec<u32>,
}

/// What is listed of one part of the buffers.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(in crate::renderer) struct PartListing {
    /// Pages, counted from the beginning of the part.
    pub pages: Vec<u32>,
    /// Number of active Gaussians.
    pub active: u32,
}

impl Pages {
    /// Returns free pages.
    pub(super) fn new(count: u32, per_part: u32) -> Self {
        Self { count, per_part: per_part.max(1), free: (0..count).collect(), files: BTreeMap::new(), version: 0 }
    }

    /// Returns the number of pages.
    pub(super) fn count(&self) -> u32 {
        self.count
    }

    /// Returns the number of pages of each part.
    pub(super) fn of_parts(&self) -> impl Iterator<Item = u32> {
        (0..self.count.div_ceil(self.per_part)).map(|part| (self.count - part * self.per_part).min(self.per_part))
    }

    /// Returns a number that changes with the files that can be drawn.
    pub(in crate::renderer) fn version(&self) -> u64 {
        self.version
    }

    /// Returns the number of Gaussians of files that can be drawn.
    pub(super) fn gaussians(&self) -> usize {
        self.files.values().filter(|file| file.is_filled).map(|file| file.gaussians).sum()
    }

    /// Takes pages for the Gaussians of a file, which has none: of one part, if one has enough. `active` returns how many of
    /// a range of its Gaussians are active in each segment. Returns `false` if too few pages are free.
    pub(super) fn place(&mut self, file: usize, gaussians: usize, active: impl Fn(Range<usize>) -> Vec<u32>) -> bool {
        let Some(pages) = self.take(gaussians.div_ceil(PAGE as usize)) else { return false };
        let mut pieces = Vec::new();
        let mut first = 0;
        for own in pages.chunk_by(|a, b| a / self.per_part == b / self.per_part) {
            let pages = first..first + own.len();
            let counts = active(pages.start * PAGE as usize..(pages.end * PAGE as usize).min(gaussians));
            pieces.push(Piece::new(own[0] / self.per_part, pages, &counts));
            first += own.len();
        }
        self.files.insert(file, PagedFile { pages, gaussians, pieces, is_filled: false });
        true
    }

    /// Takes free pages, ascending: of one part, if one has enough. `None` if there are too few.
    fn take(&mut self, needed: usize) -> Option<Vec<u32>> {
        let parts = self.count.div_ceil(self.per_part);
        let of_part = |part: u32| self.free.range(part * self.per_part..(part + 1).saturating_mul(self.per_part));
        let has_enough = |part: &u32| needed == 0 || of_part(*part).nth(needed - 1).is_some();
        let one = (0..parts).find(|part| parts == 1 || has_enough(part));
        let pages: Vec<u32> = match one {
            Some(part) => of_part(part).copied().take(needed).collect(),
            None => self.free.iter().copied().take(needed).collect(),
        };
        if pages.len() < needed {
            return None;
        }
        for page in &pages {
            self.free.remove(page);
        }
        Some(pages)
    }

    /// Returns whether a file of so many Gaussians finds pages.
    pub(super) fn has_room(&self, gaussians: usize) -> bool {
        gaussians.div_ceil(PAGE as usize) <= self.free.len()
    }

    /// Returns the pages of a file.
    pub(super) fn of(&self, file: usize) -> &[u32] {
        self.files.get(&file).map_or(&[], |file| &file.pages)
    }

    /// Returns the part of a page, and the page counted from the beginning of that part.
    pub(super) fn local(&self, page: u32) -> (usize, u32) {
        ((page / self.per_part) as usize, page % self.per_part)
    }

    /// Makes a file that has been written part of what can be drawn.
    pub(super) fn fill(&mut self, file: usize) {
        if let Some(file) = self.files.get_mut(&file).filter(|file| !file.is_filled) {
            file.is_filled = true;
            self.version += 1;
        }
    }

    /// Frees the pages of a file, if it has any.
    pub(super) fn remove(&mut self, file: usize) {
        if let Some(PagedFile { pages, is_filled, .. }) = self.files.remove(&file) {
            self.free.extend(pages);
            self.version += u64::from(is_filled);
        }
    }

    /// Returns the pages with active Gaussians of any of these segments, for each part, and the largest number that are
    /// active in one of them.
    pub(in crate::renderer) fn listing(&self, segments: [u32; 2]) -> Vec<PartListing> {
        let mut parts = vec![PartListing::default(); self.count.div_ceil(self.per_part) as usize];
        for file in self.files.values().filter(|file| file.is_filled) {
            for piece in &file.pieces {
                let active = piece.most_active(segments.map(|segment| segment as usize));
                if active > 0 {
                    let part = &mut parts[piece.part as usize];
                    part.pages.extend(file.pages[piece.pages.clone()].iter().map(|page| page % self.per_part));
                    part.active += active;
                }
            }
        }
        parts
    }

    /// Returns the files in other pages, and the pages of all of them here and there. `None` while a file is being written,
    /// and if there is too little room: a file may be in several parts neither here nor there.
    pub(super) fn moved(&self, count: u32) -> Option<(Self, Vec<[u32; 2]>)> {
        // This is asked in each frame until it can be.
        let is_movable = |file: &PagedFile| file.is_filled && file.pieces.len() == 1;
        let in_use = self.count as usize - self.free.len();
        if in_use > count as usize || !self.files.values().all(is_movable) {
            return None;
        }
        let (mut to, mut moves) = (Self::new(count, self.per_part), Vec::new());
        for (&number, file) in &self.files {
            let [piece] = &file.pieces[..] else { return None };
            let pages = to.take(file.pages.len())?;
            let part = pages[0] / self.per_part;
            if pages.iter().any(|page| page / self.per_part != part) {
                return None;
            }
            moves.extend(file.pages.iter().zip(&pages).map(|(from, to)| [*from, *to]));
            let pieces = vec![Piece { part, ..piece.clone() }];
            to.files.insert(number, PagedFile { pages, pieces, ..*file });
        }
        to.version = self.version + 1;
        Some((to, moves))
    }
}

impl Piece {
    /// `counts` are the numbers of active Gaussians in each segment.
    fn new(part: u32, pages: Range<usize>, counts: &[u32]) -> Self {
        let first = counts.iter().position(|count| *count > 0).unwrap_or(counts.len());
        let end = counts.iter().rposition(|count| *count > 0).map_or(first, |last| last + 1);
        Self { part, pages, first, active: counts[first..end].to_vec() }
    }

    /// Returns the largest number of active Gaussians of the segments from the first to the last.
    fn most_active(&self, [first, last]: [usize; 2]) -> u32 {
        let end = (last + 1).saturating_sub(self.first).min(self.active.len());
        let own = first.saturating_sub(self.first).min(end)..end;
        self.active[own].iter().copied().max().unwrap_or_default()
    }
}

/// Returns the number of pages of all files of a capture.
pub(super) fn all_pages(table: &ChunkTable) -> u64 {
    table.files.iter().map(|file| file.gaussians.div_ceil(PAGE.into())).sum()
}

/// Returns the largest number of Gaussians that the files of a capture list in any of `segments` segments; if `in_pages`, in
/// whole pages, and in any two segments that follow each other.
pub(super) fn most_listed(table: &ChunkTable, segments: u32, in_pages: bool) -> u64 {
    let (stretches, segments) = (table.stretches.max(1), segments.max(1));
    let size = |gaussians: u64| if in_pages { gaussians.next_multiple_of(PAGE.into()) } else { gaussians };
    // The Gaussians of files that begin in a stretch or before it, and of those that end before it.
    let (mut begun, mut ended) = (vec![0; stretches as usize], vec![0; stretches as usize + 1]);
    for file in &table.files {
        let [first, last] = file.stretches.map(|stretch| stretch.min(stretches - 1) as usize);
        begun[first] += size(file.gaussians);
        ended[last + 1] += size(file.gaussians);
    }
    let sum_up = |counts: &mut [u64]| {
        let mut sum = 0;
        for count in counts {
            sum += *count;
            *count = sum;
        }
    };
    sum_up(&mut begun);
    sum_up(&mut ended);
    // Of a segment that several stretches have, the files of all of them.
    let of_segment = |segment: u32| {
        let last = (segment + u32::from(in_pages)).min(segments - 1);
        let [first, last] = ChunkTable::stretches_of([segment, last], segments, stretches);
        begun[last as usize] - ended[first as usize]
    };
    (0..segments).map(of_segment).max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ChunkFile;

    /// Returns a function that finds all Gaussians active in these segments of eight.
    fn all_in(segments: Range<usize>) -> impl Fn(Range<usize>) -> Vec<u32> {
        move |own| (0..8).map(|segment| if segments.contains(&segment) { own.len() as u32 } else { 0 }).collect()
    }

    fn listing(pages: &[u32], active: u32) -> PartListing {
        PartListing { pages: pages.to_vec(), active }
    }

    #[test]
    fn pages_are_listed_in_the_order_of_files_once_these_are_written() {
        let mut pages = Pages::new(8, 8);
        assert!(pages.place(5, 300, all_in(0..4)) && pages.place(2, 256, all_in(3..8)), "three pages of eight");
        assert_eq!(pages.listing([3; 2]), [listing(&[], 0)], "no file has been written");
        pages.fill(5);
        pages.fill(2);
        assert_eq!(pages.listing([3; 2]), [listing(&[2, 0, 1], 556)], "file 2 comes before file 5");
        assert_eq!(pages.listing([2, 4]), pages.listing([3; 2]), "of several segments, the pages of each");
        assert_eq!(
            (pages.listing([0; 2]), pages.listing([7; 2])),
            (vec![listing(&[0, 1], 300)], vec![listing(&[2], 256)]),
            "one"
        );
        assert_eq!((pages.listing([8; 2]), pages.gaussians()), (vec![listing(&[], 0)], 556), "after the last segment");
    }

    #[test]
    fn pages_of_files_that_go_are_used_again() {
        let mut pages = Pages::new(4, 4);
        assert!(pages.place(0, 600, all_in(0..8)), "three pages");
        assert!(!pages.place(1, 257, all_in(0..8)), "two pages, and one is free");
        assert_eq!(pages.of(1), [0; 0], "nothing is taken");
        let before = pages.version();
        pages.fill(0);
        assert_ne!(pages.version(), before, "a file that can be drawn");
        pages.remove(0);
        pages.remove(0);
        assert!(pages.place(1, 1024, all_in(0..8)), "all pages are free again");
        let version = pages.version();
        pages.remove(1);
        assert_eq!(pages.version(), version, "a file that was not drawn changes nothing");
        assert!(pages.place(2, 0, all_in(0..8)) && pages.of(2).is_empty(), "a file without Gaussians");
    }

    #[test]
    fn a_file_is_in_one_part_if_one_has_room() {
        let mut pages = Pages::new(8, 3);
        assert_eq!(pages.of_parts().collect::<Vec<_>>(), [3, 3, 2], "the last part is smaller");
        assert!(pages.place(0, 500, all_in(0..8)) && pages.place(1, 700, all_in(0..8)), "two pages, and three");
        assert_eq!((pages.of(0), pages.of(1)), (&[0, 1][..], &[3, 4, 5][..]), "the second part has room");
        assert!(pages.place(2, 520, all_in(2..3)), "three pages");
        assert_eq!(pages.of(2), [2, 6, 7], "no part has room");
        (0..3).for_each(|file| pages.fill(file));
        let expected = [listing(&[0, 1, 2], 500 + 256), listing(&[0, 1, 2], 700), listing(&[0, 1], 264)];
        assert_eq!(pages.listing([2; 2]), expected, "the Gaussians of each part");
        assert!(pages.moved(8).is_none(), "a file in two parts is not moved");
    }

    #[test]
    fn moved_files_have_the_same_gaussians() {
        let mut pages = Pages::new(6, 9);
        assert!([3, 1, 2].iter().all(|file| pages.place(*file, 300, all_in(*file..8))), "two pages each");
        assert!(pages.moved(6).is_none(), "files that are being written are not moved");
        (1..4).for_each(|file| pages.fill(file));
        pages.remove(2);
        let (to, moves) = pages.moved(4).expect("there is room");
        assert_eq!(moves, [[2, 0], [3, 1], [0, 2], [1, 3]], "files 1 and 3");
        assert_eq!(to.listing([2; 2]), [listing(&[0, 1], 300)], "file 1 in its new pages");
        assert_eq!((to.listing([5; 2]), to.count()), (vec![listing(&[0, 1, 2, 3], 600)], 4), "both");
        assert_ne!(to.version(), pages.version(), "lists of the old pages are stale");
        assert!(pages.moved(3).is_none(), "too little room");
    }

    #[test]
    fn most_listed_is_a_bound_for_every_segment() {
        let file = |stretches, gaussians| ChunkFile { stretches, layer: 0, gaussians, bytes: 1 };
        let files = vec![file([0, 3], 10), file([0, 0], 20), file([1, 2], 300), file([2, 2], 5), file([3, 3], 400)];
        let table = ChunkTable { stretches: 4, gaussian_bytes: 1, files, utilities: Vec::new(), first_byte: None };
        assert_eq!(all_pages(&table), 7, "whole pages");
        assert_eq!(most_listed(&table, 4, false), 410, "the last stretch");
        assert_eq!(most_listed(&table, 8, false), 410, "two segments for each stretch");
        assert_eq!(most_listed(&table, 2, false), 715, "a segment for two stretches");
        assert_eq!(most_listed(&table, 3, false), 715, "a segment of a stretch and a third of the next");
        assert_eq!(most_listed(&table, 4, true), 256 + 512 + 256 + 512, "in whole pages: the last two stretches");
    }
}
