//! The inputs that a part was computed from.
//!
//! In: the name of a computation, a shard, every input. Out: a [`Label`], which is equal for equal inputs; or the first
//! input that differs.

use super::Shard;
use serde::{Deserialize, Serialize};

/// The computation that a part belongs to, its shard, and the inputs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    /// The verb.
    work: String,
    shard: Shard,
    /// Names of the inputs, and what each is: a hash, or settings in words.
    inputs: Vec<(String, String)>,
}

impl Label {
    /// Returns the label of a shard of the work of a verb, with the version of this crate as its first input.
    pub(crate) fn new(work: &str, shard: Shard) -> Self {
        Self { work: work.to_owned(), shard, inputs: Vec::new() }.with("version of gs4d", env!("CARGO_PKG_VERSION"))
    }

    /// Adds an input. The name completes the sentence "has another NAME".
    pub(crate) fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.inputs.push((name.to_owned(), value.to_string()));
        self
    }

    /// Returns the shard.
    pub(crate) fn shard(&self) -> Shard {
        self.shard
    }

    /// Returns the same label for another shard.
    pub(crate) fn of(&self, shard: Shard) -> Self {
        Self { shard, ..self.clone() }
    }

    /// Returns how this label differs from another of the same computation, as a clause that follows the name of its
    /// file; `None` if they differ in the index of the shard alone.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        if self.work != other.work {
            return Some(format!("is a part of gs4d {}, not of gs4d {}", self.work, other.work));
        }
        let mut pairs = self.inputs.iter().zip(&other.inputs);
        if let Some(((name, here), (_, there))) = pairs.find(|(here, there)| here != there) {
            return Some(format!("has another {name}: {here}, not {there}"));
        }
        if self.inputs.len() != other.inputs.len() {
            return Some("has other inputs".to_owned());
        }
        let [here, there] = [self.shard, other.shard].map(Shard::count);
        (here != there).then(|| format!("is one of {here} shards, not of {there}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_input_that_differs_is_named() {
        let shard = |text: &str| text.parse::<Shard>().expect("a shard");
        let label = |engine: &str| Label::new("score", shard("0/4")).with("scene", "abc").with("engine", engine);
        assert_eq!(label("cpu").difference(&label("cpu").of(shard("3/4"))), None, "another shard of the same work");
        let difference = label("cpu").difference(&label("gpu"));
        assert_eq!(difference.as_deref(), Some("has another engine: cpu, not gpu"), "the input and both values");
        let difference = label("cpu").difference(&label("cpu").of(shard("0/5")));
        assert_eq!(difference.as_deref(), Some("is one of 4 shards, not of 5"), "another number of shards");
        let difference = label("cpu").difference(&Label::new("eval", shard("0/4")));
        assert_eq!(difference.as_deref(), Some("is a part of gs4d score, not of gs4d eval"), "another verb");
    }
}
