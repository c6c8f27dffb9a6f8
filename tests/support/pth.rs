//! Checkpoints for tests: pickles joined from fragments, and the zip archive around them.
//!
//! In: slots as pickle fragments, storages as values. Out: the bytes of a `.pth` file. Fragments do not use the memo,
//! so they can be joined in any order.

use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// The fragment of `None`.
pub const NONE: &[u8] = b"N";

/// A checkpoint whose parts tests can replace by invalid ones before it is written.
#[derive(Clone)]
pub struct Pth {
    /// The elements of the state tuple, each a pickle fragment.
    pub slots: Vec<Vec<u8>>,
    /// Values of the storages, by key.
    pub storages: Vec<Vec<f32>>,
}

impl Pth {
    /// Returns a checkpoint of `count` Gaussians of a `rot_4d` model with `k` coefficients per channel, degrees 3
    /// and 2.
    pub fn rotating(count: usize, k: usize) -> Self {
        let mut pth = Self { slots: vec![NONE.to_vec(); 19], storages: Vec::new() };
        // Statistics and optimizer state have no storage here: reading them fails.
        let unread = tensor(999, 1, 0, &[1], &[1]);
        pth.slots[7..11].fill(unread);
        pth.slots[0] = int(3);
        pth.slots[11] = b"}".to_vec();
        pth.slots[12] = float(5.5);
        pth.slots[16] = flag(true);
        pth.slots[18] = int(2);
        let shapes: [(usize, &[usize]); 9] = [
            (1, &[count, 3]),
            (2, &[count, 1, 3]),
            (3, &[count, k - 1, 3]),
            (4, &[count, 3]),
            (5, &[count, 4]),
            (6, &[count, 1]),
            (13, &[count, 1]),
            (14, &[count, 1]),
            (15, &[count, 4]),
        ];
        for (slot, size) in shapes {
            let length: usize = size.iter().product();
            // No value is zero or equal to its neighbors.
            let values = (0..length).map(|i| ((i * 37 + slot) % 101) as f32 * 0.02 - 0.999).collect();
            pth.set(slot, size, values);
        }
        pth
    }

    /// Sets a slot to a contiguous tensor with its own storage.
    pub fn set(&mut self, slot: usize, size: &[usize], values: Vec<f32>) {
        let stride: Vec<usize> = (1..=size.len()).map(|axis| size[axis..].iter().product()).collect();
        self.slots[slot] = tensor(self.storages.len(), values.len(), 0, size, &stride);
        self.storages.push(values);
    }

    /// Returns the pickle: a pair of the state tuple and the iteration 30,000.
    pub fn pickle(&self) -> Vec<u8> {
        let mut pickle = b"\x80\x02".to_vec();
        pickle.extend(tuple(&[tuple(&self.slots), int(30_000)]));
        pickle.push(b'.');
        pickle
    }

    /// Returns the bytes of the file.
    pub fn bytes(&self) -> Vec<u8> {
        self.bytes_with(&self.pickle())
    }

    /// Returns the bytes of the file with the given pickle.
    pub fn bytes_with(&self, pickle: &[u8]) -> Vec<u8> {
        let mut entries = vec![("archive/data.pkl".to_owned(), pickle.to_vec())];
        for (key, values) in self.storages.iter().enumerate() {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            entries.push((format!("archive/data/{key}"), bytes));
        }
        entries.push(("archive/version".to_owned(), b"3\n".to_vec()));
        archive(&entries)
    }
}

/// Returns a zip archive of uncompressed entries.
pub fn archive(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in entries {
        zip.start_file(name, options).expect("the name is short");
        zip.write_all(bytes).expect("memory can be written to");
    }
    zip.finish().expect("memory can be written to").into_inner()
}

/// Returns the fragment of an int.
pub fn int(value: usize) -> Vec<u8> {
    let value = i32::try_from(value).expect("tests use small numbers");
    [&b"J"[..], &value.to_le_bytes()].concat()
}

/// Returns the fragment of a float.
pub fn float(value: f64) -> Vec<u8> {
    [&b"G"[..], &value.to_be_bytes()].concat()
}

/// Returns the fragment of a bool.
pub fn flag(value: bool) -> Vec<u8> {
    vec![if value { 0x88 } else { 0x89 }]
}

/// Returns the fragment of a text.
pub fn text(value: &str) -> Vec<u8> {
    let length = u32::try_from(value.len()).expect("tests use short texts");
    [&b"X"[..], &length.to_le_bytes()[..], value.as_bytes()].concat()
}

/// Returns the fragment of a tuple.
pub fn tuple(items: &[Vec<u8>]) -> Vec<u8> {
    [&b"("[..], &items.concat()[..], b"t"].concat()
}

/// Returns the fragment of a tensor as torch writes it: a view of the storage `key`, which declares a length of `count`
/// values.
pub fn tensor(key: usize, count: usize, offset: usize, size: &[usize], stride: &[usize]) -> Vec<u8> {
    let ints = |values: &[usize]| tuple(&values.iter().map(|&value| int(value)).collect::<Vec<_>>());
    let class = b"ctorch\nFloatStorage\n".to_vec();
    let mut storage = tuple(&[text("storage"), class, text(&key.to_string()), text("cuda:0"), int(count)]);
    storage.push(b'Q');
    let hooks = b"ccollections\nOrderedDict\n)R".to_vec();
    let arguments = tuple(&[storage, int(offset), ints(size), ints(stride), flag(false), hooks]);
    [&b"ctorch._utils\n_rebuild_tensor_v2\n"[..], &arguments[..], b"R"].concat()
}
