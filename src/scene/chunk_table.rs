//! The chunk files of a capture: which Gaussians are in which file.
//!
//! In: the files that `gs4d split` wrote. Out: a [`ChunkTable`], part of the index of the capture, which has no
//! Gaussians itself: from the table a player knows which files it needs at a time, and how many bytes they are, before
//! it asks for one.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The chunk files of a capture, in the order of their numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChunkTable {
    /// Number of stretches of time into which the capture is cut, of equal length.
    pub stretches: u32,
    /// Bytes of a Gaussian of any file on the GPU, its color and its part of the temporal filter included
    /// ([`GaussianScene::gaussian_bytes`](super::GaussianScene::gaussian_bytes)).
    pub gaussian_bytes: u32,
    /// The files.
    pub files: Vec<ChunkFile>,
    /// What each layer adds to the PSNR of held-out views for each byte of its files, dB per megabyte; empty if that
    /// was not measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub utilities: Vec<f32>,
    /// Where the first file is in the file of the index, bytes from its start, if the files follow the index in one
    /// file, one after the other. `None`: each is a file beside the index.
    #[serde(skip)]
    pub first_byte: Option<u64>,
}

/// A chunk file: Gaussians that are only drawn within some stretches of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Entry", into = "Entry")]
pub struct ChunkFile {
    /// The first and the last stretch of time.
    pub stretches: [u32; 2],
    /// Its layer: 0 has the most important Gaussians of its stretches.
    pub layer: u32,
    /// Number of Gaussians.
    pub gaussians: u64,
    /// Length of the file.
    pub bytes: u64,
}

/// A chunk file as it is stored: first and last stretch, layer, Gaussians, bytes.
#[derive(Serialize, Deserialize)]
struct Entry(u32, u32, u32, u64, u64);

impl From<Entry> for ChunkFile {
    fn from(Entry(first, last, layer, gaussians, bytes): Entry) -> Self {
        Self { stretches: [first, last], layer, gaussians, bytes }
    }
}

impl From<ChunkFile> for Entry {
    fn from(file: ChunkFile) -> Self {
        Self(file.stretches[0], file.stretches[1], file.layer, file.gaussians, file.bytes)
    }
}

impl ChunkTable {
    /// The name of the index of a capture in chunk files.
    pub const INDEX: &str = "index.gs4d";
    /// Most stretches of time of a capture.
    pub const MOST_STRETCHES: u32 = 10_000;
    /// Most chunk files of a capture.
    pub const MOST_FILES: usize = 99_999;
    /// Most layers.
    pub const MOST_LAYERS: u32 = 16;
    /// Most bytes of a Gaussian on the GPU: more than those of any form, with a temporal filter of any size.
    pub const MOST_GAUSSIAN_BYTES: u32 = 1 << 14;
    /// The largest of the [delays](Self::delays).
    pub const LATEST: f64 = 16.0;
    /// Gaussians of a page, the unit of memory on the GPU: a block of the packed form.
    pub const PAGE: u64 = 256;

    /// Returns the name of a chunk file. `number` counts from 0.
    pub fn file_name(number: usize, of: usize) -> String {
        format!("chunk-{:05}-of-{of:05}.gs4d", number + 1)
    }

    /// Returns where a file is in the file of the index, bytes from its start. `number` counts from 0. `None`: the
    /// files are beside the index, or there is no such file.
    pub fn range(&self, number: usize) -> Option<Range<u64>> {
        let (own, before) = (self.files.get(number)?, self.files.get(..number)?);
        let start = before.iter().fold(self.first_byte?, |end, file| end.saturating_add(file.bytes));
        Some(start..start.saturating_add(own.bytes))
    }

    /// Returns the bytes of a file's Gaussians on the GPU. `file` counts from 0; 0 for a file that is not there.
    pub fn gpu_bytes(&self, file: usize) -> u64 {
        self.files.get(file).map_or(0, |file| file.gaussians.saturating_mul(self.gaussian_bytes.into()))
    }

    /// Returns the bytes of a file on the GPU in whole [pages](Self::PAGE). `file` counts from 0; 0 for a file that is
    /// not there.
    pub fn page_bytes(&self, file: usize) -> u64 {
        let pages = self.files.get(file).map_or(0, |file| file.gaussians.div_ceil(Self::PAGE));
        pages.saturating_mul(Self::PAGE).saturating_mul(self.gaussian_bytes.into())
    }

    /// Returns the number of layers.
    pub fn layers(&self) -> u32 {
        self.files.iter().map(|file| file.layer.saturating_add(1)).max().unwrap_or_default()
    }

    /// Returns how much later the files of each layer may come than those of layer 0, in multiples of
    /// [`StreamLimits::layer_seconds`](crate::codec::stream::StreamLimits::layer_seconds): 1 for a layer of a quarter
    /// of the utility of layer 0, so that a byte counts a quarter as much once it is that late, 2 for a sixteenth and
    /// so on, at most [`LATEST`](Self::LATEST), which layers have that make pictures worse. Where utilities were not
    /// measured, each layer counts as a quarter of the one before.
    pub fn delays(&self) -> [f64; Self::MOST_LAYERS as usize] {
        let first = self.utilities.first().copied().map_or(0.0, |own| f64::from(own).max(0.0));
        std::array::from_fn(|layer| match self.utilities.get(layer) {
            None => layer as f64,
            Some(_) if layer == 0 => 0.0,
            // NaN, of no utility at all, is the latest.
            Some(&own) => match (first / f64::from(own).max(0.0)).log2() / 2.0 {
                delay if delay <= Self::LATEST => delay.max(0.0),
                _ => Self::LATEST,
            },
        })
    }

    /// Returns the bytes of all files of the layers up to this one.
    pub fn bytes_up_to(&self, layer: u32) -> u64 {
        let own = self.files.iter().filter(|file| file.layer <= layer);
        own.map(|file| file.bytes).fold(0, u64::saturating_add)
    }

    /// Returns the bytes of the files that a picture of a stretch of time needs, of the layers up to this one.
    pub fn bytes_at(&self, stretch: u32, layer: u32) -> u64 {
        let is_drawn = |file: &&ChunkFile| (file.stretches[0]..=file.stretches[1]).contains(&stretch);
        let own = self.files.iter().filter(|file| file.layer <= layer).filter(is_drawn);
        own.map(|file| file.bytes).fold(0, u64::saturating_add)
    }

    /// Returns the stretch of a time of a capture that lasts `duration` seconds; the first of a still.
    pub fn stretch_at(&self, seconds: f64, duration: f64) -> u32 {
        let share = if duration > 0.0 { seconds / duration } else { 0.0 };
        // NaN counts as 0.
        ((share * f64::from(self.stretches)).max(0.0) as u32).min(self.stretches.saturating_sub(1))
    }

    /// Returns the first and the last of `stretches` stretches of time that segments have: from the first to the last
    /// of them, of `of` segments of the same time. Both are of equal length.
    pub fn stretches_of([first, last]: [u32; 2], of: u32, stretches: u32) -> [u32; 2] {
        let (segments, stretches) = (u64::from(of.max(1)), u64::from(stretches.max(1)));
        let last = ((u64::from(last) + 1) * stretches).div_ceil(segments).clamp(1, stretches) - 1;
        [(u64::from(first) * stretches / segments).min(last) as u32, last as u32]
    }

    /// Checks that a player can use the table.
    ///
    /// # Errors
    /// A description of the first fault.
    pub fn check(&self) -> Result<(), &'static str> {
        if !(1..=Self::MOST_STRETCHES).contains(&self.stretches) {
            return Err("a table of chunk files whose number of stretches is not 1 to 10000");
        }
        if self.files.len() > Self::MOST_FILES {
            return Err("a table of more than 99999 chunk files");
        }
        if self.gaussian_bytes == 0 {
            return Err("a table of chunk files whose Gaussians have no bytes");
        }
        if self.gaussian_bytes > Self::MOST_GAUSSIAN_BYTES {
            return Err("a table of chunk files whose Gaussians have more than 16384 bytes each");
        }
        if self.utilities.len() > Self::MOST_LAYERS as usize || self.utilities.iter().any(|own| !own.is_finite()) {
            return Err("a table of chunk files with more than 16 utilities of layers, or one that is not finite");
        }
        for ChunkFile { stretches: [first, last], layer, gaussians, bytes } in &self.files {
            if first > last || *last >= self.stretches {
                return Err("a chunk file whose stretches of time do not exist, or are not in order");
            }
            if *layer >= Self::MOST_LAYERS {
                return Err("a chunk file of a layer above 15");
            }
            if *gaussians == 0 {
                return Err("a chunk file without Gaussians");
            }
            // Sums over all files stay below 2^64.
            if *gaussians > u64::from(u32::MAX) || *bytes > 1 << 40 {
                return Err("a chunk file of more than 4294967295 Gaussians, or of more than 1 TiB");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> ChunkTable {
        let file = |first, last, layer| ChunkFile { stretches: [first, last], layer, gaussians: 10, bytes: 1000 };
        ChunkTable {
            stretches: 4,
            gaussian_bytes: 80,
            files: vec![file(0, 0, 0), file(0, 3, 1), file(2, 3, 0)],
            utilities: Vec::new(),
            first_byte: None,
        }
    }

    #[test]
    fn an_entry_is_five_numbers() {
        let text = ron::to_string(&table()).expect("numbers can be written");
        assert!(text.contains("(0,3,1,10,1000)"), "short: {text}");
        assert_eq!(ron::from_str::<ChunkTable>(&text), Ok(table()), "and read again");
    }

    #[test]
    fn layers_of_less_utility_may_come_later() {
        let delays = |utilities: &[f32]| {
            let delays = ChunkTable { utilities: utilities.to_vec(), ..table() }.delays();
            assert_eq!(delays[4], 4.0, "a layer that was not measured");
            [delays[0], delays[1], delays[2], delays[3]]
        };
        assert_eq!(delays(&[]), [0.0, 1.0, 2.0, 3.0], "not measured: a quarter each");
        assert_eq!(delays(&[64.0, 16.0, 4.0, 2.0]), [0.0, 1.0, 2.0, 2.5], "a quarter, a sixteenth, half of that");
        assert_eq!(delays(&[8.0, 16.0, 0.0, -1.0]), [0.0, 0.0, 16.0, 16.0], "more utility, none, and worse pictures");
        assert_eq!(delays(&[0.0, 0.0, -1.0, 1.0]), [0.0, 16.0, 16.0, 0.0], "a first layer without utility");
    }

    #[test]
    fn files_in_one_file_follow_one_another() {
        let inside = ChunkTable { first_byte: Some(500), ..table() };
        assert_eq!([0, 2].map(|number| inside.range(number)), [Some(500..1500), Some(2500..3500)], "after the index");
        assert_eq!((inside.range(3), table().range(0)), (None, None), "no such file, and files beside the index");
        assert_eq!(ron::to_string(&inside), ron::to_string(&table()), "where they are follows from the file");
    }

    #[test]
    fn a_time_has_a_stretch() {
        let at = |seconds: f64| table().stretch_at(seconds, 8.0);
        assert_eq!([-1.0, 0.0, 1.9, 2.0, 7.9, 8.0, 99.0].map(at), [0, 0, 0, 1, 3, 3, 3], "clamped to the capture");
        assert_eq!((at(f64::NAN), table().stretch_at(3.0, 0.0)), (0, 0), "NaN, and a still");
    }

    #[test]
    fn bytes_are_those_of_some_layers_and_of_a_stretch() {
        let table = table();
        assert_eq!((table.layers(), ChunkTable { files: Vec::new(), ..table.clone() }.layers()), (2, 0), "the layers");
        assert_eq!([0, 1, 9].map(|layer| table.bytes_up_to(layer)), [2000, 3000, 3000], "two files of layer 0, three");
        let at = |stretch| [0, 1].map(|layer| table.bytes_at(stretch, layer));
        assert_eq!([0, 1, 2, 4].map(at), [[1000, 2000], [0, 1000], [1000, 2000], [0, 0]], "of a stretch");
    }

    #[test]
    fn segments_have_every_stretch_that_they_touch() {
        let of = |segments: u32, stretches: u32| {
            (0..segments).map(move |at| ChunkTable::stretches_of([at; 2], segments, stretches))
        };
        assert_eq!(of(2, 4).collect::<Vec<_>>(), [[0, 1], [2, 3]], "two stretches each");
        assert_eq!(of(4, 2).collect::<Vec<_>>(), [[0, 0], [0, 0], [1, 1], [1, 1]], "half a stretch each");
        assert_eq!(of(3, 4).collect::<Vec<_>>(), [[0, 1], [1, 2], [2, 3]], "a stretch and a third each");
        assert_eq!(ChunkTable::stretches_of([1, 2], 3, 6), [2, 5], "several segments");
        assert_eq!(ChunkTable::stretches_of([9, u32::MAX], 3, 6), [5, 5], "segments that are not there");
        assert_eq!(ChunkTable::stretches_of([0, 0], 0, 0), [0, 0], "no segments, no stretches");
    }

    #[test]
    fn pages_are_whole() {
        let table = |gaussians| {
            let file = ChunkFile { stretches: [0, 0], layer: 0, gaussians, bytes: 0 };
            ChunkTable { stretches: 1, gaussian_bytes: 80, files: vec![file], utilities: Vec::new(), first_byte: None }
        };
        let pages = |gaussians| table(gaussians).page_bytes(0) / (80 * ChunkTable::PAGE);
        assert_eq!([0, 1, 255, 256, 257, 512, 513].map(pages), [0, 1, 1, 1, 2, 2, 3], "256 Gaussians to a page");
        assert_eq!(table(257).page_bytes(0), 512 * 80, "bytes");
        assert_eq!((table(u64::MAX).page_bytes(0), table(1).page_bytes(1)), (u64::MAX, 0), "saturated, and no file");
    }

    #[test]
    fn faulty_tables_are_refused() {
        assert_eq!(table().check(), Ok(()), "a good table");
        assert_eq!((table().gpu_bytes(1), table().gpu_bytes(3)), (800, 0), "bytes of a file on the GPU");
        let faults: [fn(&mut ChunkTable); 11] = [
            |table| table.utilities = vec![1.0; 17],
            |table| table.utilities = vec![1.0, f32::NAN],
            |table| table.stretches = 0,
            |table| table.gaussian_bytes = 0,
            |table| table.gaussian_bytes = 16_385,
            |table| table.files[0].stretches = [1, 0],
            |table| table.files[0].stretches = [3, 4],
            |table| table.files[0].layer = 16,
            |table| table.files[0].gaussians = 0,
            |table| table.files[0].gaussians = u64::MAX,
            |table| table.files[0].bytes = u64::MAX,
        ];
        for (number, fault) in faults.into_iter().enumerate() {
            let mut bad = table();
            fault(&mut bad);
            assert!(bad.check().is_err(), "fault {number}");
        }
    }
}
