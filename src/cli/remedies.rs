//! The check of commands and options in messages and help texts.
//!
//! In: the string literals of the sources, the texts of `--help`. Out: proof that every `gs4d VERB` in them is a verb,
//! and that every `--option` is an option of that verb, or of the verb that shows the text.

use crate::cli::Cli;
use crate::cli::args::RULES;
use clap::{Arg, Command, CommandFactory};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The options of each verb.
type Verbs = BTreeMap<String, BTreeSet<String>>;

/// Words that follow the name of the command in prose.
const PROSE: [&str; 10] = ["clamp", "does", "opens", "reads", "round", "take", "takes", "that", "works", "writes"];
/// An option of cargo, which messages name.
const OF_CARGO: &str = "--features";
/// The file that is not checked: this one.
const LEFT_OUT: &str = "cli/remedies.rs";
/// Files of verbs whose names differ from those of the verbs.
const FILES: [(&str, &str); 3] = [("fine_tune", "finetune"), ("fleet", "report"), ("info_dataset", "info")];

/// Returns the verbs and their options.
fn verbs() -> Verbs {
    let option = |argument: &Arg| argument.get_long().map(|long| format!("--{long}"));
    let of_verb = |verb: &Command| {
        let own = verb.get_arguments().filter_map(option);
        (verb.get_name().to_owned(), own.chain(["--json", "--help", "--version"].map(str::to_owned)).collect())
    };
    Cli::command().get_subcommands().map(of_verb).collect()
}

/// Returns the string literals of a source before its unit tests.
fn literals(source: &str) -> Vec<String> {
    let (mut found, mut rest) = (Vec::new(), source.split("#[cfg(test)]\nmod tests").next().unwrap_or(source));
    while let Some(first) = rest.chars().next() {
        if rest.starts_with("//") {
            rest = rest.split_once('\n').map_or("", |(_, after)| after);
        } else if let Some(after) = rest.strip_prefix("'\"'") {
            rest = after;
        } else if let Some(after) = rest.strip_prefix("r#\"") {
            let (text, after) = after.split_once("\"#").unwrap_or((after, ""));
            found.push(text.to_owned());
            rest = after;
        } else if let Some(after) = rest.strip_prefix('"') {
            let (text, after) = literal(after);
            found.push(text);
            rest = after;
        } else {
            rest = &rest[first.len_utf8()..];
        }
    }
    found
}

/// Returns the literal before the next quotation mark, and the text after that.
fn literal(text: &str) -> (String, &str) {
    let (mut literal, mut rest) = (String::new(), text);
    while let Some(character) = rest.chars().next() {
        rest = &rest[character.len_utf8()..];
        match (character, rest.chars().next()) {
            ('"', _) | ('\\', None) => break,
            ('\\', Some('\n')) => rest = rest.trim_start(),
            ('\\', Some(escaped)) => {
                literal.push(if escaped == 'n' { '\n' } else { escaped });
                rest = &rest[escaped.len_utf8()..];
            }
            _ => literal.push(character),
        }
    }
    (literal, rest)
}

/// Returns the options in a text.
fn options(text: &str) -> Vec<String> {
    let begins = |at: &usize| {
        let before = text[..*at].chars().next_back();
        before.is_none_or(|before| before.is_whitespace() || "(`\"'".contains(before))
    };
    let option = |at: usize| {
        let name: String =
            text[at + 2..].chars().take_while(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || *c == '-').collect();
        let name = name.trim_end_matches('-');
        name.starts_with(|c: char| c.is_ascii_lowercase()).then(|| format!("--{name}"))
    };
    text.match_indices("--").map(|(at, _)| at).filter(begins).filter_map(option).collect()
}

/// Splits a text at the commands in it. Returns the texts outside of commands, and each word after `gs4d` with the text
/// up to the end of the command.
fn commands(text: &str) -> (Vec<&str>, Vec<(&str, &str)>) {
    let (mut outside, mut commands, mut rest) = (Vec::new(), Vec::new(), text);
    while let Some(at) = rest.find("gs4d ") {
        let (before, after) = (&rest[..at], &rest[at + "gs4d ".len()..]);
        let is_name = before.chars().next_back().is_none_or(|c| !c.is_alphanumeric() && !"./_-".contains(c));
        outside.push(before);
        let word = after.split(|c: char| !c.is_ascii_lowercase()).next().unwrap_or("");
        if !is_name || word.is_empty() {
            rest = after;
            continue;
        }
        let arguments = &after[word.len()..];
        let ends = [";", ":", "(", ")", "`", "\n", ". ", ", ", " gs4d "].iter().filter_map(|end| arguments.find(end));
        let end = ends.min().unwrap_or(arguments.len());
        commands.push((word, &arguments[..end]));
        rest = &arguments[end..];
    }
    outside.push(rest);
    (outside, commands)
}

/// Returns the verbs and options in a text that do not exist. `own` are the options that are allowed outside of
/// commands.
fn wrong(text: &str, verbs: &Verbs, own: &BTreeSet<String>) -> Vec<String> {
    let (outside, commands) = commands(text);
    let unknown = outside.iter().flat_map(|part| options(part)).filter(|option| !own.contains(option));
    let mut wrong: Vec<String> = unknown.filter(|option| option != OF_CARGO).collect();
    for (word, arguments) in commands {
        match verbs.get(word) {
            Some(known) => {
                let unknown = options(arguments).into_iter().filter(|option| !known.contains(option));
                wrong.extend(unknown.map(|option| format!("gs4d {word} {option}")));
            }
            // Labels of GPU objects begin with "gs4d ".
            None if PROSE.contains(&word) || text.starts_with("gs4d ") => {}
            None => wrong.push(format!("gs4d {word}")),
        }
    }
    wrong
}

/// Adds the faults of the sources in a folder, whose path below `src` is given, with their files.
fn check_folder(folder: &Path, below: &str, verbs: &Verbs, found: &mut Vec<String>, literals_found: &mut usize) {
    let all: BTreeSet<String> = verbs.values().flatten().cloned().collect();
    for entry in fs::read_dir(folder).expect("the sources can be listed") {
        let path = entry.expect("the entry can be read").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let file = format!("{below}{name}");
        if path.is_dir() {
            check_folder(&path, &format!("{file}/"), verbs, found, literals_found);
        } else if name.ends_with(".rs") && file != LEFT_OUT {
            let stem = name.trim_end_matches(".rs");
            let verb = FILES.iter().find(|(file, _)| *file == stem).map_or(stem, |(_, verb)| *verb);
            let own = verbs.get(verb).filter(|_| below == "cli/verbs/").unwrap_or(&all);
            let literals = literals(&fs::read_to_string(&path).expect("a source is text"));
            *literals_found += literals.len();
            let wrong =
                literals.iter().flat_map(|text| wrong(text, verbs, own).into_iter().map(move |name| (name, text)));
            found.extend(wrong.map(|(name, text)| format!("{file}: {name} in {text:?}")));
        }
    }
}

#[test]
fn commands_and_options_are_found_in_texts() {
    let source =
        "let a = \"give --time\\\n     or --sequence\"; // \"no --comment\"\nlet b = '\"'; f(r#\"<a b=\"--c\">\"#);";
    assert_eq!(literals(source), ["give --timeor --sequence", "<a b=\"--c\">"], "literals without comments");
    assert_eq!(options("a --b-c, (--d 1) x--y --- --{z} `--e`"), ["--b-c", "--d", "--e"], "options of words alone");
    let (outside, found) = commands("is it --a? gs4d info FILE --b: or a.gs4d --c, or gs4d bake --d");
    assert_eq!(outside.concat(), "is it --a? : or a.--c, or ", "the text outside of commands");
    assert_eq!(found, [("info", " FILE --b"), ("bake", " --d")], "verbs and their arguments");
    let own = BTreeSet::from(["--a".to_owned()]);
    let wrong = wrong("give --a or --b: gs4d info --json --quality, gs4d inform; another gs4d works", &verbs(), &own);
    assert_eq!(wrong, ["--b", "gs4d info --quality", "gs4d inform"], "verbs and options that do not exist");
}

#[test]
fn messages_name_verbs_and_options_that_exist() {
    let (mut found, mut literals) = (Vec::new(), 0);
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    check_folder(&sources, "", &verbs(), &mut found, &mut literals);
    assert!(found.is_empty(), "{} names do not exist:\n{}", found.len(), found.join("\n"));
    assert!(literals > 3000, "{literals} literals are read");
}

#[test]
fn helps_name_verbs_and_options_that_exist() {
    let (verbs, mut found) = (verbs(), Vec::new());
    for verb in Cli::command().get_subcommands() {
        let own = &verbs[verb.get_name()];
        let about = [verb.get_long_about(), verb.get_about(), verb.get_after_help()].into_iter().flatten();
        let of_options = verb.get_arguments().flat_map(|argument| [argument.get_long_help(), argument.get_help()]);
        for text in about.chain(of_options.flatten()).map(ToString::to_string) {
            found.extend(wrong(&text, &verbs, own).into_iter().map(|name| format!("{}: {name}", verb.get_name())));
        }
    }
    assert!(found.is_empty(), "{} names do not exist:\n{}", found.len(), found.join("\n"));
}

#[test]
fn every_rule_about_options_is_of_options_that_exist() {
    let verbs = verbs();
    for rule in RULES {
        for &option in rule.options {
            let with: Vec<_> = verbs.values().filter(|options| options.contains(option)).collect();
            assert!(!with.is_empty(), "{:?}: no verb has {option}", rule.need);
            let known: BTreeSet<String> = with.into_iter().flatten().cloned().collect();
            let wrong = wrong(rule.reason, &verbs, &known);
            assert!(wrong.is_empty(), "{option} has no effect {}: there is no {wrong:?} beside it", rule.reason);
        }
    }
}

#[test]
fn options_of_rules_are_known_by_their_names() {
    let ruled: BTreeSet<&str> = RULES.iter().flat_map(|rule| rule.options.iter().copied()).collect();
    for verb in Cli::command().get_subcommands() {
        for argument in verb.get_arguments().filter(|argument| argument.get_long() != Some("out")) {
            let (id, name) = (argument.get_id().as_str().replace('_', "-"), argument.get_long().unwrap_or_default());
            let is_ruled = ruled.contains(format!("--{name}").as_str());
            assert!(!is_ruled || id == name, "{} --{name}: its id is {id}, by which it is not found", verb.get_name());
        }
    }
}
