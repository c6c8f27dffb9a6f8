//! The file of a checkpoint: a zip archive, or in torch before 1.6 pickles followed by the values of the storages.
//!
//! In: a seekable reader, and the [`Tensor`]s to read. Out: the small entries as bytes, and the values of one tensor at
//! a time, read in one pass and in an archive checked against the checksum of the entry. Nothing else is read.

use super::error::CheckpointError;
use super::legacy::{Legacy, PICKLE_LIMIT};
use super::tensor::Tensor;
use crate::codec::text;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use zip::read::{ArchiveOffset, Config};
use zip::{CompressionMethod, ZipArchive};

/// Bytes read at once.
const BUFFER: usize = 1 << 16;

/// The file of a checkpoint.
pub(super) struct Archive<R> {
    store: Store<R>,
    length: u64,
}

/// How a file holds its entries.
enum Store<R> {
    /// An archive with one `<root>/data.pkl`, all of whose entries are stored uncompressed.
    Zip { zip: ZipArchive<R>, root: Vec<u8> },
    /// A file of torch before 1.6.
    Legacy(Legacy<R>),
}

/// A tensor of the state tuple.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot<'p> {
    /// Index in the state tuple, from 0; `None` in a dictionary.
    pub index: Option<usize>,
    /// Name of the attribute in the trainer.
    pub name: &'static str,
    /// Name of a row in messages: Gaussian or channel.
    pub row: &'static str,
    pub tensor: &'p Tensor<'p>,
}

/// A tensor that has been checked: its shape, its storage, and the entry that holds it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Located<'p> {
    slot: Slot<'p>,
    entry: usize,
    /// Number of values.
    count: usize,
    /// Number of values of the storage.
    storage: usize,
}

/// The destination of the rows of a tensor: `width` values from `start` in each stretch of `pitch` values.
pub(super) struct Rows<'v> {
    pub values: &'v mut [f32],
    /// Length of a stretch.
    pub pitch: usize,
    /// First value in each stretch.
    pub start: usize,
    /// Length of a row.
    pub width: usize,
}

impl Slot<'_> {
    fn error(&self, reason: impl Into<String>) -> CheckpointError {
        CheckpointError::Tensor { index: self.index, name: self.name, reason: reason.into() }
    }

    /// Returns the error about a shape that is not `expected`.
    pub(super) fn shape_error(&self, expected: impl Into<String>) -> CheckpointError {
        let found = self.tensor.size.clone();
        CheckpointError::Shape { index: self.index, name: self.name, found, expected: expected.into() }
    }
}

impl<R: Read + Seek> Archive<R> {
    /// Opens the file and checks its directory.
    ///
    /// # Errors
    /// Neither a zip archive nor a file of torch before 1.6; a compressed entry, an entry longer than the file, another
    /// byte order, no `data.pkl` or several.
    pub(super) fn open(mut reader: R) -> Result<Self, CheckpointError> {
        let length = reader.seek(SeekFrom::End(0)).map_err(CheckpointError::Io)?;
        if Legacy::is_start_of(&mut reader).map_err(CheckpointError::Io)? {
            return Ok(Self { store: Store::Legacy(Legacy::open(reader, length)?), length });
        }
        // The archive starts at the beginning of the file; the search for its start fails for some checkpoints.
        let config = Config { archive_offset: ArchiveOffset::Known(0) };
        let zip = ZipArchive::with_config(config, reader).map_err(CheckpointError::Archive)?;
        let mut roots = Vec::new();
        for index in 0..zip.len() {
            let entry = zip.by_index_data(index).map_err(CheckpointError::Archive)?;
            if entry.compression() != CompressionMethod::Stored || entry.encrypted() {
                return Err(CheckpointError::Packed(printable(entry.name_raw())));
            }
            if entry.compressed_size() != entry.size() || entry.size() > length {
                return Err(CheckpointError::EntrySize { entry: printable(entry.name_raw()), size: entry.size() });
            }
            roots.extend(
                entry.name_raw().strip_suffix(b"/data.pkl").filter(|root| !root.contains(&b'/')).map(<[u8]>::to_vec),
            );
        }
        let count = roots.len();
        let root = roots.pop().filter(|_| count == 1).ok_or(CheckpointError::Root(count))?;
        let mut archive = Self { store: Store::Zip { zip, root }, length };
        match archive.small("byteorder", 64)? {
            Some(order) if order.trim_ascii() != b"little" => Err(CheckpointError::ByteOrder(printable(&order))),
            _ => Ok(archive),
        }
    }

    /// Returns the bytes of the pickle.
    ///
    /// # Errors
    /// An entry that cannot be read, is damaged or too large.
    pub(super) fn pickle(&mut self) -> Result<Vec<u8>, CheckpointError> {
        match &self.store {
            Store::Legacy(legacy) => Ok(legacy.pickle().to_vec()),
            Store::Zip { .. } => self.small("data.pkl", PICKLE_LIMIT)?.ok_or(CheckpointError::Root(0)),
        }
    }

    /// Returns the bytes of an entry; `None` if it does not exist. An entry of more than `limit` bytes is an error.
    fn small(&mut self, name: &'static str, limit: u64) -> Result<Option<Vec<u8>>, CheckpointError> {
        let Some((index, size)) = self.find(name)? else { return Ok(None) };
        if size > limit {
            return Err(CheckpointError::TooLarge { entry: name, size, limit });
        }
        let mut bytes = Vec::new();
        self.entry(index)?.read_to_end(&mut bytes).map_err(CheckpointError::Io)?;
        Ok(Some(bytes))
    }

    /// Returns the index and the size in bytes of an entry; `None` if there is none of that name.
    ///
    /// # Errors
    /// An entry that reaches beyond the end of the file.
    fn find(&mut self, name: &str) -> Result<Option<(usize, u64)>, CheckpointError> {
        let (zip, root) = match &mut self.store {
            Store::Legacy(legacy) => return Ok(legacy.find(name)),
            Store::Zip { zip, root } => (zip, root),
        };
        let Some(index) = zip.index_for_name_raw(&[&root[..], b"/", name.as_bytes()].concat()) else { return Ok(None) };
        let entry = zip.by_index(index).map_err(CheckpointError::Archive)?;
        let size = entry.size();
        let end = entry.data_start().and_then(|start| start.checked_add(size));
        if end.is_none_or(|end| end > self.length) {
            return Err(CheckpointError::EntrySize { entry: printable(name.as_bytes()), size });
        }
        Ok(Some((index, size)))
    }

    /// Returns the bytes of an entry.
    fn entry(&mut self, index: usize) -> Result<Box<dyn Read + '_>, CheckpointError> {
        match &mut self.store {
            Store::Legacy(legacy) => Ok(Box::new(legacy.entry(index).map_err(CheckpointError::Io)?)),
            Store::Zip { zip, .. } => Ok(Box::new(zip.by_index(index).map_err(CheckpointError::Archive)?)),
        }
    }

    /// Checks that a tensor has the shape given and that all its values are in the file.
    ///
    /// # Errors
    /// Another shape, a tensor outside its storage, a storage that is missing or too short.
    pub(super) fn locate<'p>(&mut self, slot: Slot<'p>, shape: &[usize]) -> Result<Located<'p>, CheckpointError> {
        if !slot.tensor.size.iter().copied().eq(shape.iter().map(|&size| size as u64)) {
            return Err(slot.shape_error(format!("{shape:?}")));
        }
        let count = slot.tensor.check().map_err(|reason| slot.error(format!("the tensor {reason}")))?;
        let storage = slot.tensor.storage;
        let name = format!("data/{}", storage.key);
        let missing = || slot.error(format!("entry {} is missing; copy the file again", printable(name.as_bytes())));
        let (index, size) = self.find(&name)?.ok_or_else(missing)?;
        let too_short = || slot.error(format!("a storage of {} values in an entry of {size} bytes", storage.count));
        if storage.count.checked_mul(4).is_none_or(|bytes| bytes > size) {
            return Err(too_short());
        }
        let (Ok(count), Ok(storage)) = (usize::try_from(count), usize::try_from(storage.count)) else {
            return Err(too_short());
        };
        Ok(Located { slot, entry: index, count, storage })
    }

    /// Reads the values of a tensor into `rows`.
    ///
    /// # Errors
    /// Values that cannot be read, do not match their checksum, or are not finite.
    pub(super) fn fill(&mut self, from: &Located, mut rows: Rows) -> Result<(), CheckpointError> {
        if from.count == 0 {
            return Ok(());
        }
        self.read(from, &mut rows)?;
        let Slot { name, row, .. } = from.slot;
        match rows.iter_mut().position(|row| row.iter().any(|value| !value.is_finite())) {
            Some(at) => Err(CheckpointError::NotFinite { name, row, at }),
            None => Ok(()),
        }
    }

    /// As [`fill`](Self::fill), with values that may be infinite or not numbers.
    ///
    /// # Errors
    /// Values that cannot be read or do not match their checksum.
    pub(super) fn read(&mut self, from: &Located, rows: &mut Rows) -> Result<(), CheckpointError> {
        if from.count == 0 {
            return Ok(());
        }
        let Slot { index, name, tensor, .. } = from.slot;
        let mut reader = BufReader::with_capacity(BUFFER, self.entry(from.entry)?);
        let read = if tensor.is_contiguous() {
            read_contiguous(&mut reader, tensor.offset, rows)
        } else {
            read_strided(&mut reader, tensor, from.storage, rows)
        };
        // The checksum is compared at the end of the entry.
        read.and_then(|()| io::copy(&mut reader, &mut io::sink())).map_err(|reason| CheckpointError::Read {
            index,
            name,
            reason,
        })?;
        Ok(())
    }

    /// Reads a tensor of this shape as rows of `W` values, which may be infinite or not numbers.
    ///
    /// # Errors
    /// As [`locate`](Self::locate) and [`read`](Self::read).
    pub(super) fn any_rows<const W: usize>(
        &mut self,
        slot: Slot,
        shape: &[usize],
    ) -> Result<Vec<[f32; W]>, CheckpointError> {
        let located = self.locate(slot, shape)?;
        let mut values = vec![[0.0; W]; located.count / W];
        self.read(&located, &mut Rows { values: values.as_flattened_mut(), pitch: W, start: 0, width: W })?;
        Ok(values)
    }

    /// Reads a tensor of shape `count` × W.
    ///
    /// # Errors
    /// As [`locate`](Self::locate) and [`fill`](Self::fill).
    pub(super) fn rows<const W: usize>(&mut self, slot: Slot, count: usize) -> Result<Vec<[f32; W]>, CheckpointError> {
        let located = self.locate(slot, &[count, W])?;
        let mut values = vec![[0.0; W]; count];
        self.fill(&located, Rows { values: values.as_flattened_mut(), pitch: W, start: 0, width: W })?;
        Ok(values)
    }
}

impl Rows<'_> {
    fn iter_mut(&mut self) -> impl Iterator<Item = &mut [f32]> {
        let (start, end) = (self.start, self.start + self.width);
        self.values.chunks_exact_mut(self.pitch).map(move |stretch| &mut stretch[start..end])
    }
}

fn read_contiguous(reader: &mut impl BufRead, offset: u64, rows: &mut Rows) -> io::Result<()> {
    io::copy(&mut reader.by_ref().take(offset * 4), &mut io::sink())?;
    rows.iter_mut().try_for_each(|row| read_values(reader, row))
}

fn read_strided(reader: &mut impl BufRead, tensor: &Tensor, count: usize, rows: &mut Rows) -> io::Result<()> {
    let mut storage = vec![0.0; count];
    read_values(reader, &mut storage)?;
    // `locate` has checked that every index is inside the storage.
    for (at, value) in rows.iter_mut().flatten().enumerate() {
        *value = storage[tensor.place(at as u64) as usize];
    }
    Ok(())
}

fn read_values(reader: &mut impl BufRead, values: &mut [f32]) -> io::Result<()> {
    reader.read_exact(bytemuck::cast_slice_mut(values))?;
    for value in values {
        *value = f32::from_bits(u32::from_le(value.to_bits()));
    }
    Ok(())
}

/// Returns a name from the file, made safe to print.
fn printable(name: &[u8]) -> String {
    text::printable(&String::from_utf8_lossy(name))
}
