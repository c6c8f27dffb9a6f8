//! The Huffman codes of sequential JPEG scans, counted but not decoded.
//!
//! In: the data of a scan and the tables of its codes. Out: whether there are codes for another block of 8 × 8 values.

/// Values of a block.
const BLOCK: u8 = 64;

/// A table of codes. Codes of one length are consecutive, and longer codes follow shorter codes.
pub(super) struct Table {
    /// For each length from 1 bit, the number after its last code, filled up to 16 bits with zeros.
    ends: [u32; 16],
    /// For each length, the place of a code's symbol in `symbols` minus the code.
    offsets: [i32; 16],
    /// The symbols, from the shortest code on.
    symbols: Vec<u8>,
}

impl Table {
    /// Creates a table from the number of codes of each length from 1 to 16 bits; `None` if a length has more codes
    /// than bit patterns.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self { ends: [0; 16], offsets: [0; 16], symbols: symbols.to_vec() };
        let (mut code, mut place) = (0u32, 0u32);
        for (index, &count) in counts.iter().enumerate() {
            table.offsets[index] = place as i32 - code as i32;
            code += u32::from(count);
            place += u32::from(count);
            table.ends[index] = code << (15 - index);
            if code > 2 << index {
                return None;
            }
            code <<= 1;
        }
        Some(table)
    }
}

/// The data of a scan as bits.
pub(super) struct Bits<'a> {
    data: &'a [u8],
    at: usize,
    /// Bits that have been read from `data` and not used, in the lowest `count` bits.
    held: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    /// Starts at the first bit.
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0, held: 0, count: 0 }
    }

    /// Skips the codes of one block; `None` if they end too early.
    pub(super) fn skip_block(&mut self, first: &Table, others: &Table) -> Option<()> {
        let size = self.symbol(first)?;
        self.skip(size)?;
        let mut place = 1;
        while place < BLOCK {
            let symbol = self.symbol(others)?;
            let (zeros, size) = (symbol >> 4, symbol & 15);
            if size == 0 && zeros < 15 {
                break;
            }
            self.skip(size)?;
            place += zeros + 1;
        }
        Some(())
    }

    /// Skips to the end of the next restart marker; `None` if there is none.
    pub(super) fn restart(&mut self) -> Option<()> {
        self.count = 0;
        let is_restart = |pair: &[u8]| pair[0] == 0xff && (0xd0..=0xd7).contains(&pair[1]);
        self.at += self.data.get(self.at..)?.windows(2).position(is_restart)? + 2;
        Some(())
    }

    /// Returns the symbol of the next code; `None` if there is no code.
    fn symbol(&mut self, table: &Table) -> Option<u8> {
        if self.count < 16 {
            self.fill();
        }
        // Ones follow the last bit, since no code consists of ones.
        let window = if self.count < 16 {
            let missing = 16 - self.count;
            self.held << missing | ((1 << missing) - 1)
        } else {
            self.held >> (self.count - 16)
        };
        let window = window as u32 & 0xffff;
        let index = table.ends.iter().position(|&end| window < end)?;
        self.count = self.count.checked_sub(index as u32 + 1)?;
        let place = (window >> (15 - index)) as i32 + table.offsets[index];
        table.symbols.get(usize::try_from(place).ok()?).copied()
    }

    fn skip(&mut self, bits: u8) -> Option<()> {
        if self.count < u32::from(bits) {
            self.fill();
        }
        self.count = self.count.checked_sub(bits.into())?;
        Some(())
    }

    /// Reads bytes into `held`, up to the next marker, until `held` is full.
    fn fill(&mut self) {
        while self.count <= 48 {
            let Some(&byte) = self.data.get(self.at) else { return };
            self.at += 1;
            if byte == 0xff {
                if self.data.get(self.at) != Some(&0) {
                    self.at -= 1;
                    return;
                }
                self.at += 1;
            }
            self.held = self.held << 8 | u64::from(byte);
            self.count += 8;
        }
    }
}
