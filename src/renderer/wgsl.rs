//! WGSL files with imports and definitions.
//!
//! In: a file, the libraries that it may import, definitions. Out: one text of WGSL without directives, for every driver and every browser; an
//! error for a directive that is not understood. A file uses directives of naga_oil, with which an app can compose the same libraries:
//!
//! | directive | meaning |
//! |---|---|
//! | `#define_import_path gs4d::NAME` | the file is the library `NAME` |
//! | `#import gs4d::NAME::{A, B}` | the text of the library `NAME` is part of the text, once |
//! | `#ifdef D`, `#ifndef D`, `#else ifdef D`, `#else`, `#endif` | the lines between are part of the text if `D` is defined, or if it is not |
//!
//! Names are not changed: those of a file and of all the libraries that it imports must differ.

/// A library: its name and its text.
pub(super) type Library = (&'static str, &'static str);

/// Returns the text of a file with its libraries.
///
/// # Errors
/// A description of the first line that is not understood.
pub(super) fn composed<'a>(
    source: &'static str,
    libraries: impl Iterator<Item = &'a Library> + Clone,
    definitions: &[&str],
) -> Result<String, String> {
    let mut text = String::new();
    // WGSL has no order of declarations: libraries follow the files that import them.
    let mut files = vec![("", source)];
    let mut next = 0;
    while let Some(&(_, file)) = files.get(next) {
        next += 1;
        // Of each open `#ifdef`: whether its lines are part of the text here, and whether any of its branches has been.
        let mut branches: Vec<(bool, bool)> = Vec::new();
        for line in file.lines() {
            let mut words = line.split_whitespace();
            let [first, second, third] = [(); 3].map(|()| words.next().unwrap_or_default());
            let refused = || Err(format!("the line `{line}` is not understood"));
            let is_part = branches.iter().all(|(here, _)| *here);
            match (first, branches.last_mut()) {
                ("#ifdef" | "#ifndef", _) => {
                    let holds = holds(&first[1..], second, definitions) == Some(true);
                    branches.push((holds, holds));
                }
                ("#else", Some((here, any))) => {
                    let Some(holds) = holds(second, third, definitions) else { return refused() };
                    *here = holds && !*any;
                    *any |= holds;
                }
                ("#endif", Some(_)) => _ = branches.pop(),
                ("#else" | "#endif", None) => return refused(),
                ("#define_import_path", _) => {}
                _ if !is_part => {}
                ("#import", _) => {
                    let name = second.strip_prefix("gs4d::").and_then(|path| path.split("::").next());
                    let library = libraries.clone().find(|(known, _)| Some(*known) == name);
                    let Some(library) = library else { return refused() };
                    if files.iter().all(|(known, _)| *known != library.0) {
                        files.push(*library);
                    }
                }
                _ if first.starts_with('#') => return refused(),
                _ => text.extend([line, "\n"]),
            }
        }
        if !branches.is_empty() {
            return Err("an #endif is missing".to_owned());
        }
    }
    Ok(text)
}

/// Returns whether a condition holds: `ifdef` or `ifndef` with a name, or none; `None` for any other condition.
fn holds(condition: &str, name: &str, definitions: &[&str]) -> Option<bool> {
    match condition {
        "" => Some(true),
        "ifdef" => Some(definitions.contains(&name)),
        "ifndef" => Some(!definitions.contains(&name)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIBRARIES: [Library; 2] = [
        ("one", "#define_import_path gs4d::one\nconst ONE = 1u;"),
        ("two", "#define_import_path gs4d::two\n#import gs4d::one::ONE\nconst TWO = ONE + ONE;"),
    ];

    fn compose(source: &'static str, definitions: &[&str]) -> Result<String, String> {
        composed(source, LIBRARIES.iter(), definitions)
    }

    #[test]
    fn each_library_is_in_the_text_once() {
        let source = "#import gs4d::two::{TWO}\n#import gs4d::one::ONE\nconst THREE = TWO + ONE;";
        let expected = "const THREE = TWO + ONE;\nconst TWO = ONE + ONE;\nconst ONE = 1u;\n";
        assert_eq!(compose(source, &[]).as_deref(), Ok(expected), "also if two files import it");
    }

    #[test]
    fn lines_are_in_the_text_if_all_their_conditions_hold() {
        let source = "#ifdef A\na\n#ifndef B\nb\n#else\nc\n#endif\n#else\nd\n#endif\ne";
        for (definitions, expected) in [(&["A"][..], "a\nb\ne\n"), (&["A", "B"], "a\nc\ne\n"), (&["B"], "d\ne\n")] {
            assert_eq!(compose(source, definitions).as_deref(), Ok(expected), "with {definitions:?}");
        }
        let chain = "#ifdef A\na\n#else ifdef B\nb\n#else\nc\n#endif";
        for (definitions, expected) in [(&["A", "B"][..], "a\n"), (&["B"], "b\n"), (&[], "c\n")] {
            assert_eq!(compose(chain, definitions).as_deref(), Ok(expected), "one branch, with {definitions:?}");
        }
        let unused = "#ifdef A\n#import gs4d::unknown\n#endif\na";
        assert_eq!(compose(unused, &[]).as_deref(), Ok("a\n"), "an import in a part that is left out");
    }

    #[test]
    fn a_directive_that_is_not_understood_is_refused() {
        for source in ["#import gs4d::three::THREE", "#else", "#endif", "#ifdef A\n#else if B\n#endif", "#define A"] {
            let message = compose(source, &["A"]).expect_err("it is refused");
            assert!(message.contains('#'), "the message has the line: {message}");
        }
        assert!(compose("#ifdef A", &[]).is_err(), "a condition without end");
    }
}
