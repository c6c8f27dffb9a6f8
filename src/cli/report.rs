//! What a verb says: a report as text and as JSON, tables, sizes, progress.
//!
//! In: what a verb found out. Out: one document on standard output; progress bars and errors on standard error.

use super::failure::Failure;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Value, json};
use std::io::{ErrorKind, Write, stderr, stdout};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a verb has to say in the end.
pub struct Report {
    /// For `--json`.
    pub json: Value,
    /// For people; lines end with a line break.
    pub text: String,
    /// Why the command fails although it has something to report.
    pub failure: Option<Failure>,
}

impl Report {
    /// A report of success.
    pub fn new(json: Value, text: String) -> Self {
        Self { json, text, failure: None }
    }

    /// A report of nothing but a failure.
    pub fn of_failure(failure: Failure) -> Self {
        Self { json: json!({ "error": failure.message() }), text: String::new(), failure: Some(failure) }
    }

    /// Prints it. A reader that went away (`| head`) is no error.
    ///
    /// # Errors
    /// Standard output cannot be written.
    pub fn print(&self, as_json: bool) -> Result<(), Failure> {
        let text = if as_json { format!("{:#}\n", self.json) } else { self.text.clone() };
        let printed = stdout().write_all(text.as_bytes()).and_then(|()| stdout().flush());
        if let Some(failure) = &self.failure {
            note(&format!("error: {}", failure.message()));
        }
        match printed {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                note(&format!("error: standard output: {error}"));
                Err(error.into())
            }
            _ => Ok(()),
        }
    }
}

/// Writes a line to standard error, or nowhere if that is closed.
pub fn note(line: &str) {
    let _ = BARS.suspend(|| writeln!(stderr(), "{line}"));
}

/// All progress bars on the screen, one below the other.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Whether progress bars stay away.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Hides progress bars from here on.
pub fn silence_progress(silent: bool) {
    SILENT.store(silent, Ordering::Relaxed);
}

/// A progress bar on standard error, below those that are there; hidden with `--json` and where that is no terminal.
pub fn progress(length: usize, doing: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::with_draw_target(Some(length as u64), ProgressDrawTarget::hidden());
    let bar = bar.with_style(style).with_message(doing);
    if SILENT.load(Ordering::Relaxed) { bar } else { BARS.add(bar) }
}

/// A table: the first column to the left, the others to the right.
pub struct Table(Vec<Vec<String>>);

impl Table {
    /// An empty table with these column heads.
    pub fn new(heads: &[&str]) -> Self {
        Self(vec![heads.iter().map(ToString::to_string).collect()])
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.0.push(cells.into_iter().collect());
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

/// Lines of names and values, the values aligned.
pub fn lines(pairs: &[(&str, String)]) -> String {
    let width = pairs.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    pairs.iter().map(|(name, value)| format!("{name:<width$}  {value}\n")).collect()
}

/// A number of bytes for people, in powers of 1000.
pub fn bytes(count: u64) -> String {
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
    fn columns_line_up() {
        let mut table = Table::new(&["pass", "ms"]);
        table.row(["blend".to_owned(), "12.5".to_owned()]);
        assert_eq!(table.to_string(), "pass     ms\nblend  12.5\n", "first column left, second right");
    }

    #[test]
    fn sizes_are_short() {
        assert_eq!(bytes(999), "999 B", "plain bytes");
        assert_eq!(bytes(59_406_126), "59.4 MB", "megabytes");
    }
}
