//! Calibrations in the YAML of OpenCV's `FileStorage`.
//!
//! In: a file of entries that are not nested: matrices (`!!opencv-matrix`), lists and single values. Out: a
//! [`Storage`], from which they are taken by name, or the fault with its line. Names of cameras are texts also without
//! quotes, so that `00` is not 0.

use super::files::utf8_or_latin1;
use super::limited;
use crate::codec::text::{printable, without_mark};
use crate::offline::dataset::DatasetError;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Most bytes of a file. A camera takes about 500.
const MAX_BYTES: u64 = 1 << 24;
/// The remedy for a fault.
const REMEDY: &str = "write the file again with OpenCV's FileStorage";

/// The entries of a file.
pub(crate) struct Storage {
    path: PathBuf,
    /// The entries by name.
    entries: HashMap<String, Entry>,
}

/// An entry.
struct Entry {
    /// Number of its first line, from 1.
    line: usize,
    /// What follows the colon after its name, also on further lines.
    text: String,
}

impl Storage {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read; a line that belongs to no entry; an entry that is there twice.
    pub(crate) fn read(path: &Path) -> Result<Self, DatasetError> {
        let bytes = limited::bytes(path, MAX_BYTES, "calibration of cameras")?;
        let text = utf8_or_latin1(without_mark(&bytes));
        let entries = entries(&text).map_err(|(line, reason)| DatasetError::Unusable {
            path: path.to_owned(),
            reason: format!("line {line}: {reason}: {REMEDY}"),
        })?;
        Ok(Self { path: path.to_owned(), entries })
    }

    /// Returns the path of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns what follows a prefix in the names of the entries that have it, sorted.
    pub(crate) fn names_after(&self, prefix: &str) -> Vec<String> {
        let mut names: Vec<String> =
            self.entries.keys().filter_map(|name| name.strip_prefix(prefix)).map(str::to_owned).collect();
        names.sort();
        names
    }

    /// Returns the texts of a list.
    ///
    /// # Errors
    /// An entry that is no list.
    pub(crate) fn texts(&self, name: &str) -> Result<Option<Vec<String>>, DatasetError> {
        let Some(entry) = self.entries.get(name) else { return Ok(None) };
        let text = entry.text.trim();
        let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
        let items: Option<Vec<&str>> = match inside_brackets(text) {
            Some(inside) => Some(parts(inside)),
            None => lines().map(|line| line.strip_prefix('-')).collect(),
        };
        let items = items.ok_or_else(|| self.fault(name, entry, "is no list"))?;
        Ok(Some(items.into_iter().map(|item| unquoted(item).to_owned()).collect()))
    }

    /// Returns a single number.
    ///
    /// # Errors
    /// An entry that is no finite number.
    pub(crate) fn number(&self, name: &str) -> Result<Option<f64>, DatasetError> {
        let Some(entry) = self.entries.get(name) else { return Ok(None) };
        Ok(Some(number(&entry.text).map_err(|reason| self.fault(name, entry, &reason))?))
    }

    /// Returns the numbers of a matrix, row by row, or of a list.
    ///
    /// # Errors
    /// An entry that is neither, has a number that is not finite, or other numbers of rows and columns than it says.
    pub(crate) fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, DatasetError> {
        let Some(entry) = self.entries.get(name) else { return Ok(None) };
        Ok(Some(numbers(&entry.text).map_err(|reason| self.fault(name, entry, &reason))?))
    }

    /// Returns the numbers of a matrix that must have so many.
    ///
    /// # Errors
    /// As [`numbers`](Self::numbers); an entry that is missing or has another number of them.
    pub(crate) fn exactly<const N: usize>(&self, name: &str) -> Result<[f64; N], DatasetError> {
        let numbers = self.numbers(name)?.ok_or_else(|| self.missing(name))?;
        let count = numbers.len();
        numbers.try_into().map_err(|_| {
            let reason = format!("{} has {count} numbers, not {N}: {REMEDY}", printable(name));
            DatasetError::Unusable { path: self.path.clone(), reason }
        })
    }

    /// Returns the error of an entry that is missing.
    pub(crate) fn missing(&self, name: &str) -> DatasetError {
        let reason = format!("it has no {}: add it, or remove the camera from the list names", printable(name));
        DatasetError::Unusable { path: self.path.clone(), reason }
    }

    fn fault(&self, name: &str, entry: &Entry, reason: &str) -> DatasetError {
        let reason = format!("line {}: {} {reason}: {REMEDY}", entry.line, printable(name));
        DatasetError::Unusable { path: self.path.clone(), reason }
    }
}

/// Returns the entries of a text, or the number of a line and its fault.
fn entries(text: &str) -> Result<HashMap<String, Entry>, (usize, String)> {
    let mut entries: HashMap<String, Entry> = HashMap::new();
    let mut last: Option<(String, Entry)> = None;
    for (line, content) in (1..).zip(text.lines()) {
        let is_mark = content.trim_end() == "---" || content.trim_end() == "...";
        if is_mark || content.trim().is_empty() || content.starts_with('%') || content.trim_start().starts_with('#') {
            continue;
        }
        if content.starts_with([' ', '\t', '-', '[', ']']) {
            let Some((_, entry)) = &mut last else { return Err((line, "it belongs to no entry".to_owned())) };
            entry.text.push('\n');
            entry.text.push_str(content);
            continue;
        }
        let (name, rest) = content.split_once(':').ok_or_else(|| (line, "it has no colon after a name".to_owned()))?;
        let next = (unquoted(name).to_owned(), Entry { line, text: rest.to_owned() });
        add(&mut entries, last.replace(next))?;
    }
    add(&mut entries, last)?;
    Ok(entries)
}

/// Adds an entry that has all of its lines.
fn add(entries: &mut HashMap<String, Entry>, new: Option<(String, Entry)>) -> Result<(), (usize, String)> {
    let Some((name, entry)) = new else { return Ok(()) };
    let line = entry.line;
    let shown = printable(&name);
    match entries.insert(name, entry) {
        None => Ok(()),
        Some(before) => Err((line, format!("{shown} is in line {} already", before.line))),
    }
}

/// Returns the numbers of a matrix or of a list in brackets.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let (header, data) = text.split_once("data:").unwrap_or(("", text));
    let inside = inside_brackets(data.trim()).ok_or("is no matrix and no list in brackets")?;
    let numbers: Vec<f64> = parts(inside).into_iter().map(number).collect::<Result<_, _>>()?;
    let side = |name: &str| {
        let line = header.lines().find_map(|line| line.trim().strip_prefix(name)?.strip_prefix(':'));
        line.and_then(|value| value.trim().parse::<usize>().ok())
    };
    match (header.is_empty(), side("rows"), side("cols")) {
        (true, ..) => Ok(numbers),
        (_, Some(rows), Some(columns)) if rows.checked_mul(columns) == Some(numbers.len()) => Ok(numbers),
        (_, Some(rows), Some(columns)) => {
            Err(format!("has {} numbers, and says {rows} rows and {columns} columns", numbers.len()))
        }
        _ => Err("says no rows and cols".to_owned()),
    }
}

fn number(text: &str) -> Result<f64, String> {
    let text = unquoted(text);
    let value: Option<f64> = text.parse().ok();
    value.filter(|value| value.is_finite()).ok_or_else(|| format!("has {:?}, which is no number", printable(text)))
}

/// Returns what is between the brackets of a list.
fn inside_brackets(text: &str) -> Option<&str> {
    text.strip_prefix('[')?.strip_suffix(']')
}

/// Returns the parts between commas, without an empty last one.
fn parts(text: &str) -> Vec<&str> {
    let text = text.trim();
    let text = text.strip_suffix(',').unwrap_or(text);
    if text.is_empty() { Vec::new() } else { text.split(',').collect() }
}

/// Returns a text without spaces and quotes around it.
fn unquoted(text: &str) -> &str {
    let text = text.trim();
    let inside = |quote: char| text.strip_prefix(quote)?.strip_suffix(quote);
    inside('"').or_else(|| inside('\'')).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn storage(text: &str) -> Result<Storage, String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("intri.yml");
        std::fs::write(&path, text).expect("the folder can be written to");
        Storage::read(&path).map_err(|error| error.to_string())
    }

    /// As `EasyVolcap` writes it, and as OpenCV does, which breaks long lines.
    const WRITTEN: &str = "%YAML:1.0\r\n---\r\nnames:\r\n  - \"00\"\r\n  - \"01\"\r\n\
        K_00: !!opencv-matrix\r\n  rows: 3\r\n  cols: 3\r\n  dt: d\r\n\x20 \
        data: [1000.5000000000, 0.0, 960.0, 0.0, 1001.0, 540.0, 0.0, 0.0, 1.0]\r\n\
        H_00: 1080.0000000000\r\nD_01: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n\x20 \
        data: [ -1.5000000000000000e-01, 2.,\n       0., 0., .5 ]\n# a comment\nbare: [ 00, 'a b', ]\n...\n";

    #[test]
    fn entries_of_easyvolcap_and_of_opencv_are_read() {
        let found = storage(WRITTEN).expect("a valid file");
        let texts = |name: &str| found.texts(name).expect("a list").expect("it is there");
        assert_eq!(texts("names"), ["00", "01"], "a list on lines");
        assert_eq!(texts("bare"), ["00", "a b"], "a list in brackets, with and without quotes");
        let matrix = found.exactly::<9>("K_00").expect("a matrix");
        assert_eq!(matrix, [1000.5, 0.0, 960.0, 0.0, 1001.0, 540.0, 0.0, 0.0, 1.0], "row by row");
        assert_eq!(found.number("H_00").expect("a number"), Some(1080.0), "a single number");
        let broken = found.numbers("D_01").expect("a matrix").expect("it is there");
        assert_eq!(broken, [-0.15, 2.0, 0.0, 0.0, 0.5], "a matrix on two lines");
        assert_eq!(found.names_after("K_"), ["00"], "the cameras of the matrices");
        assert!(found.numbers("K_01").expect("no fault").is_none(), "an entry that is missing");
        assert!(found.texts("none").expect("no fault").is_none(), "a list that is missing");
    }

    #[test]
    fn faults_have_their_line() {
        for (text, part) in [
            ("  rows: 3\n", "line 1: it belongs to no entry"),
            ("a: 1\nb\n", "line 2: it has no colon"),
            ("a: 1\nb: 2\na: 3\n", "line 3: a is in line 1 already"),
        ] {
            let error = storage(text).err().expect(part);
            assert!(error.contains(part) && error.contains("intri.yml"), "{part:?} is not in: {error}");
        }
        let matrix =
            |rows: &str, data: &str| format!("\na: !!opencv-matrix\n  {rows}\n  cols: 2\n  dt: d\n  data: {data}\n");
        for (text, part) in [
            (matrix("rows: 2", "[1, 2, 3]"), "line 2: a has 3 numbers, and says 2 rows and 2 columns"),
            (matrix("rows: 99999999999999999999", "[1]"), "says no rows"),
            (matrix("rows: 9223372036854775808", "[]"), "and says 9223372036854775808 rows"),
            (matrix("dt: d", "[1, 2]"), "says no rows"),
            (matrix("rows: 1", "[1, 2"), "no matrix"),
            (matrix("rows: 1", "[1, .Nan]"), "has \".Nan\", which is no number"),
            (matrix("rows: 1", "[1, inf]"), "no number"),
            (matrix("rows: 1", "[1,, 2]"), "has \"\", which is no number"),
            ("a: 3\n".to_owned(), "no matrix"),
            ("a: \u{1b}[2J\n".to_owned(), "no matrix"),
        ] {
            let found = storage(&text).expect("the entries can be told apart");
            let error = found.numbers("a").expect_err(part).to_string();
            assert!(error.contains(part) && error.contains("FileStorage"), "{part:?} is not in: {error}");
        }
        let found = storage("a: [1, 2, 3]\n").expect("a valid file");
        let error = found.exactly::<9>("a").expect_err("three numbers").to_string();
        assert!(error.contains("a has 3 numbers, not 9"), "{error}");
        let error = found.exactly::<9>("b").expect_err("no such entry").to_string();
        assert!(error.contains("it has no b"), "{error}");
        let error = found.texts("c").map(|found| found.is_none());
        assert!(error.is_ok_and(|is_none| is_none), "an entry that is missing is no fault");
        assert!(storage("a: b\n").expect("a valid file").texts("a").is_err(), "a single value is no list");
    }
}
