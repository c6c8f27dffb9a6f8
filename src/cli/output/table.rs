//! Tables, aligned lines and sizes, as text.
//!
//! In: cells, names with values, numbers of bytes. Out: lines for people. Control characters in cells and values are
//! escaped, so that none breaks a line.

use crate::codec::text::escaped;

/// A table: the first column is aligned to the left, the other columns to the right.
pub(crate) struct Table(Vec<Vec<String>>);

impl Table {
    /// Returns an empty table with these column heads.
    pub(crate) fn new(heads: &[&str]) -> Self {
        Self(vec![heads.iter().map(ToString::to_string).collect()])
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.0.push(cells.into_iter().map(|cell| escaped(&cell)).collect());
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let columns = self.0.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| self.0.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max();
        let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
        for row in &self.0 {
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                if column == 0 {
                    write!(f, "{cell:<width$}")?;
                } else {
                    write!(f, "  {cell:>width$}")?;
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

/// Returns one line for each name and value, with the values aligned.
pub(crate) fn lines(pairs: &[(&str, String)]) -> String {
    let width = pairs.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    pairs.iter().map(|(name, value)| format!("{name:<width$}  {}\n", escaped(value))).collect()
}

/// Returns a number of bytes with a unit: B, kB, MB or GB, in powers of 1000.
pub(crate) fn bytes(count: u64) -> String {
    match count {
        0..1_000 => format!("{count} B"),
        1_000..1_000_000 => format!("{:.1} kB", count as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", count as f64 / 1e6),
        _ => format!("{:.2} GB", count as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::new(&["pass", "ms"]);
        table.row(["blend".to_owned(), "12.5".to_owned()]);
        assert_eq!(
            table.to_string(),
            "pass     ms\nblend  12.5\n",
            "the first column is left-aligned, the second right-aligned"
        );
    }

    #[test]
    fn sizes_have_the_unit_of_their_magnitude() {
        assert_eq!(bytes(999), "999 B", "below 1000 the unit is B");
        assert_eq!(bytes(59_406_126), "59.4 MB", "millions of bytes are MB");
    }
}
