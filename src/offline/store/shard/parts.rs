//! The parts of all shards of one computation.
//!
//! In: the paths of parts, and what they must have been computed from if that is known. Out: the paths in the order of
//! the shards ([`in_order`]); an error that names the first part that is missing, is given twice, or was computed from
//! something else.

use super::{Label, Shard, part};
use crate::codec::text::printable;
use crate::offline::store::StoreError;
use crate::offline::work::FileError;
use std::path::PathBuf;

/// Returns the paths in the order of the shards, and the label of the first shard. The parts must have the inputs of
/// `expected`, or else of the first path.
///
/// # Errors
/// Files that are no parts, of other inputs, twice there, or missing.
pub(crate) fn in_order(paths: &[PathBuf], expected: Option<&Label>) -> Result<(Vec<PathBuf>, Label), StoreError> {
    let labels = paths.iter().map(|path| part::label(path)).collect::<Result<Vec<Label>, _>>()?;
    let (Some(first), Some(label)) = (paths.first(), labels.first()) else {
        return Err(StoreError::NoParts);
    };
    // The number of shards is not an input of the command.
    let expected = expected.map(|expected| expected.of(label.shard()));
    let mut found: Vec<Option<&PathBuf>> = vec![None; label.shard().count() as usize];
    for (path, other) in paths.iter().zip(&labels) {
        if let Some(difference) = other.difference(expected.as_ref().unwrap_or(label)) {
            let than = match &expected {
                Some(_) => "this command".to_owned(),
                None => first.display().to_string(),
            };
            // The texts of a label are those of a file.
            let difference = printable(&difference);
            let message =
                format!("{difference}, as {than} has: parts belong together if all their inputs are the same");
            return Err(FileError::at(path, message).into());
        }
        let place = found.get_mut(other.shard().index() as usize);
        if let Some(before) = place.and_then(|place| place.replace(path)) {
            let message = format!("is shard {} once more, as {} is: name each once", other.shard(), before.display());
            return Err(FileError::at(path, message).into());
        }
    }
    let missing: Vec<String> = Shard::all(label.shard().count())
        .zip(&found)
        .filter(|(_, path)| path.is_none())
        .map(|(s, _)| s.to_string())
        .collect();
    if !missing.is_empty() {
        let message = format!("is one of {} shards, and {} missing", label.shard().count(), listed(&missing));
        return Err(FileError::at(first, message).into());
    }
    Ok((found.into_iter().flatten().cloned().collect(), label.of(Shard::WHOLE)))
}

/// Returns names as the subject of a sentence, at most five of them.
fn listed(names: &[String]) -> String {
    match names {
        [name] => format!("{name} is"),
        [first, .., last] if names.len() > 5 => format!("{} of them, from {first} to {last}, are", names.len()),
        _ => format!("{} are", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    /// Writes a part of `score` for each name, which is a shard and a scene.
    fn parts(folder: &TempDir, names: &[(&str, &str)]) -> Vec<PathBuf> {
        let write = |(index, (shard, scene)): (usize, &(&str, &str))| {
            let path = folder.path().join(format!("{index}.gs4p"));
            let label = Label::new("score", shard.parse().expect("a shard")).with("scene", scene);
            part::write(&path, &label, b"sums").expect("the folder can be written to");
            path
        };
        names.iter().enumerate().map(write).collect()
    }

    #[test]
    fn parts_come_in_the_order_of_the_shards() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let paths = parts(&folder, &[("2/3", "a"), ("0/3", "a"), ("1/3", "a")]);
        let (ordered, label) = in_order(&paths, None).expect("all parts are there");
        assert_eq!(ordered, [&paths[1], &paths[2], &paths[0]].map(Clone::clone), "the order of the shards");
        let expected = Label::new("score", Shard::WHOLE).with("scene", "a");
        assert_eq!(label, expected, "the label of the whole");
        in_order(&paths, Some(&expected)).expect("the inputs of the command");
    }

    #[test]
    fn gaps_repetitions_and_other_inputs_are_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (names, words) in [
            (&[("0/3", "a"), ("2/3", "a")][..], &["0.gs4p", "1/3 is missing"][..]),
            (&[("0/4", "a")], &["0.gs4p", "1/4, 2/4, 3/4 are missing"]),
            (&[("0/9", "a")], &["8 of them, from 1/9 to 8/9, are missing"]),
            (&[("0/2", "a"), ("1/2", "a"), ("0/2", "a")], &["2.gs4p", "shard 0/2 once more", "0.gs4p"]),
            (&[("0/2", "a"), ("1/2", "b")], &["1.gs4p", "another scene: b, not a", "0.gs4p"]),
            (&[("0/2", "a"), ("1/3", "a")], &["1.gs4p", "one of 3 shards, not of 2"]),
            (&[], &["no parts"]),
        ] {
            let message = in_order(&parts(&folder, names), None).expect_err("it is refused").to_string();
            words.iter().for_each(|word| assert!(message.contains(word), "{word:?}: {message}"));
        }
        let expected = Label::new("score", Shard::WHOLE).with("scene", "c");
        let paths = parts(&folder, &[("0/1", "a")]);
        let message = in_order(&paths, Some(&expected)).expect_err("another scene").to_string();
        assert!(message.contains("another scene: a, not c, as this command has"), "{message}");
    }
}
