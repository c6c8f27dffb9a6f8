//! The inputs read so far, and the defects found.
//!
//! In: inputs, one after the other. Out: counts for each reader, a line for each new kind of defect with the command
//! that repeats it, and the inputs in a folder if one is given.

use crate::designs;
use crate::readers::{Kind, Outcome, Reader};
use crate::watch::{Seen, watch};
use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Inputs of one kind of defect that are reported and kept; further ones are only counted.
const TOLD: usize = 3;

/// The inputs that the readers have read.
pub struct Trials {
    seed: u64,
    keep: Option<PathBuf>,
    rows: Vec<Row>,
    /// Number of inputs with each kind of defect.
    kinds: HashMap<String, usize>,
}

/// An input.
pub struct Input {
    /// Its number, or the name of its file.
    pub name: String,
    pub bytes: Vec<u8>,
    /// Whether the reader must accept it; `None` if it may do either.
    pub accepted: Option<bool>,
}

/// The counts of one reader, or of all.
#[derive(Default)]
struct Row {
    reader: &'static str,
    inputs: usize,
    accepted: usize,
    refused: usize,
    drawn: usize,
    defects: usize,
    slowest: (Duration, String),
    /// Bytes.
    most: (usize, String),
}

impl Trials {
    /// Returns trials without inputs. `keep` is a folder for inputs, created if it does not exist.
    pub fn new(seed: u64, keep: Option<PathBuf>) -> Self {
        if let Some(folder) = &keep {
            fs::create_dir_all(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        }
        Self { seed, keep, rows: Vec::new(), kinds: HashMap::new() }
    }

    /// Runs a reader on an input and counts the outcome. Returns the outcome; `None` if the reader does not end.
    pub fn give(&mut self, kind: &Kind, reader: &Arc<dyn Reader>, input: Input) -> Option<Result<Outcome, String>> {
        let name = format!("{} {}", kind.name, input.name);
        let bytes: Arc<[u8]> = input.bytes.into();
        // If the process ends, this is the input that ended it.
        self.write(&format!("{}.running", kind.name), &bytes);
        let Seen { outcome, time, memory, stuck } = watch(&name, reader, &bytes);
        let outcome = outcome.and_then(|outcome| as_expected(outcome, input.accepted));
        let row = self.row(kind.name);
        row.inputs += 1;
        match &outcome {
            Ok(Outcome::Refused(_)) => row.refused += 1,
            Ok(Outcome::Accepted) => row.accepted += 1,
            Ok(Outcome::Drawn) => {
                row.accepted += 1;
                row.drawn += 1;
            }
            Err(_) => row.defects += 1,
        }
        if time > row.slowest.0 {
            row.slowest = (time, name.clone());
        }
        if memory > row.most.0 {
            row.most = (memory, name.clone());
        }
        if let Err(defect) = &outcome {
            self.tell(kind, &input.name, defect, &bytes);
        }
        if stuck { None } else { Some(outcome) }
    }

    /// Prints a defect and keeps its input, unless the kind of defect is known.
    fn tell(&mut self, kind: &Kind, input: &str, defect: &str, bytes: &[u8]) {
        let general: String = defect.chars().filter(|c| !c.is_ascii_digit()).take(160).collect();
        let seen = self.kinds.entry(format!("{}: {general}", kind.name)).or_default();
        *seen += 1;
        if *seen > TOLD {
            return;
        }
        let defect: String = defect.chars().take(1000).collect();
        let again = match input.parse::<u64>() {
            Ok(number) => format!("--seed {} --reader {} --input {number}", self.seed, kind.name),
            Err(_) => format!("--reader {} --file {input}", kind.name),
        };
        println!("DEFECT {} {input}: {defect}\n    again: {again}", kind.name);
        let name = input.rsplit('/').next().unwrap_or(input);
        let stem = format!("{}-{}-{name}", kind.name, self.seed);
        self.write(&format!("{stem}.{}", kind.extension), bytes);
        self.write(&format!("{stem}.txt"), format!("{defect}\n{again}\n").as_bytes());
    }

    /// Writes a file into the folder, if there is one.
    fn write(&self, name: &str, bytes: &[u8]) {
        if let Some(folder) = &self.keep {
            let path = folder.join(name);
            fs::write(&path, bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
    }

    fn row(&mut self, reader: &'static str) -> &mut Row {
        let index = self.rows.iter().position(|row| row.reader == reader).unwrap_or_else(|| {
            self.rows.push(Row { reader, ..Row::default() });
            self.rows.len() - 1
        });
        &mut self.rows[index]
    }

    /// Prints the counts, with the sums over all readers in the last line. Returns whether no defect was found.
    pub fn close(&self) -> bool {
        let mut all = Row { reader: "all", ..Row::default() };
        for row in &self.rows {
            println!("{row}");
            all.inputs += row.inputs;
            all.accepted += row.accepted;
            all.refused += row.refused;
            all.drawn += row.drawn;
            all.defects += row.defects;
            all.slowest = all.slowest.max(row.slowest.clone());
            all.most = all.most.max(row.most.clone());
            // No input is running any more.
            if let Some(folder) = &self.keep {
                let _ = fs::remove_file(folder.join(format!("{}.running", row.reader)));
            }
        }
        println!("{}", designs::summary());
        println!("{all}");
        all.defects == 0
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reader, inputs, accepted, refused, drawn, defects, slowest, most } = self;
        write!(f, "{reader}: {inputs} inputs, {accepted} accepted, {refused} refused, {drawn} drawn, ")?;
        write!(f, "{defects} defects; slowest {:.3} s ({})", slowest.0.as_secs_f64(), slowest.1)?;
        write!(f, ", most memory {} KiB ({})", most.0 >> 10, most.1)
    }
}

/// Returns the outcome if it is the one that the input must have.
fn as_expected(outcome: Outcome, accepted: Option<bool>) -> Result<Outcome, String> {
    match (&outcome, accepted) {
        (Outcome::Refused(message), Some(true)) => Err(format!("is refused and must be accepted: {message}")),
        (Outcome::Accepted | Outcome::Drawn, Some(false)) => Err("is accepted and must be refused".to_owned()),
        _ => Ok(outcome),
    }
}
