//! The paths in a Rust file.
//!
//! In: its text. Out: every path that starts with `crate`, `self` or `super` and every branch of a `use`, with its line and the module
//! around it; the names of the items that the file defines. Comments, strings and doc text are skipped.

use std::collections::BTreeSet;

/// The path of a module from the crate root: `plugin`, `asset`.
pub type Module = Vec<String>;

/// The modules that a file mentions, and the items that it defines.
pub struct Source {
    /// Its path below `src`, with forward slashes.
    pub file: String,
    pub mentions: Vec<Mention>,
    /// The names that it defines.
    pub items: BTreeSet<String>,
    /// The words of its code outside of `use` and of unit tests.
    pub words: BTreeSet<String>,
}

/// A path in a file.
pub struct Mention {
    pub line: usize,
    /// The module inside the file.
    pub inside: Module,
    pub path: Module,
    /// The name that a `use` outside of functions and inner modules gives it; `*` for a glob.
    pub name: Option<String>,
    /// Whether it is part of a `pub use`: a re-export.
    pub exported: bool,
}

impl Source {
    /// Reads a file from its path and its text.
    pub fn new(file: &str, text: &str) -> Self {
        let code = code(text);
        let mut reader = Reader { tokens: tokens(&code), ..Reader::default() };
        reader.read();
        Self { file: file.to_owned(), mentions: reader.mentions, items: reader.items, words: reader.words }
    }
}

/// Finds the paths in the words and signs of a file.
#[derive(Default)]
struct Reader<'a> {
    /// Each with its line.
    tokens: Vec<(&'a str, usize)>,
    at: usize,
    /// Open braces.
    depth: usize,
    /// Open inner modules, each with the braces open around it.
    inside: Vec<(String, usize)>,
    mentions: Vec<Mention>,
    items: BTreeSet<String>,
    words: BTreeSet<String>,
    /// Whether the `use` that is read is a `pub use`.
    exported: bool,
}

impl<'a> Reader<'a> {
    fn read(&mut self) {
        const DEFINING: [&str; 9] = ["const", "enum", "fn", "mod", "static", "struct", "trait", "type", "union"];
        while self.at < self.tokens.len() {
            let (word, next) = (self.peek(0), self.peek(1));
            if DEFINING.contains(&word) && is_name(next) {
                self.items.insert(next.to_owned());
            }
            if is_name(word) && !self.inside.iter().any(|(module, _)| module == "tests") {
                self.words.insert(word.to_owned());
            }
            match word {
                "use" => {
                    // `pub use`, `pub(crate) use`.
                    let before = self.at.checked_sub(1).and_then(|at| self.tokens.get(at));
                    self.exported = before.is_some_and(|(token, _)| ["pub", ")"].contains(token));
                    self.at += 1;
                    self.branch(&[]);
                    self.exported = false;
                    continue;
                }
                "crate" | "self" | "super" if next == "::" => {
                    self.path();
                    continue;
                }
                "mod" if self.peek(2) == "{" => self.inside.push((next.to_owned(), self.depth)),
                "{" => self.depth += 1,
                "}" => {
                    self.depth = self.depth.saturating_sub(1);
                    if self.inside.last().is_some_and(|(_, depth)| *depth == self.depth) {
                        self.inside.pop();
                    }
                }
                _ => {}
            }
            self.at += 1;
        }
    }

    /// Returns the word or sign `ahead` positions further on; empty at the end.
    fn peek(&self, ahead: usize) -> &'a str {
        self.tokens.get(self.at + ahead).map_or("", |&(token, _)| token)
    }

    /// Reads a branch of a `use` below the path `stem`.
    fn branch(&mut self, stem: &[String]) {
        let line = self.line();
        let mut path = stem.to_vec();
        loop {
            match self.peek(0) {
                "::" => {}
                "{" => {
                    self.at += 1;
                    while !matches!(self.peek(0), "}" | ";" | "") {
                        let before = self.at;
                        self.branch(&path);
                        if self.peek(0) == "," || self.at == before {
                            self.at += 1;
                        }
                    }
                    self.at += 1;
                    return;
                }
                // The module itself, not one of its items.
                "self" if !stem.is_empty() => {}
                name if name == "*" || (is_name(name) && name != "as") => path.push(name.to_owned()),
                _ => break,
            }
            self.at += 1;
        }
        let mut name = path.last().cloned();
        if self.peek(0) == "as" {
            name = Some(self.peek(1).to_owned());
            self.at += 2;
        }
        self.mention(line, path, name.filter(|_| self.depth == 0));
    }

    /// Reads a path in the midst of code.
    fn path(&mut self) {
        let line = self.line();
        let mut path = vec![self.peek(0).to_owned()];
        self.at += 1;
        while self.peek(0) == "::" && is_name(self.peek(1)) {
            path.push(self.peek(1).to_owned());
            self.at += 2;
        }
        self.mention(line, path, None);
    }

    fn line(&self) -> usize {
        self.tokens.get(self.at).map_or(0, |&(_, line)| line)
    }

    fn mention(&mut self, line: usize, path: Module, name: Option<String>) {
        let inside = self.inside.iter().map(|(module, _)| module.clone()).collect();
        self.mentions.push(Mention { line, inside, path, name, exported: self.exported });
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| is_word(c) && !c.is_numeric())
}

/// Words and signs with their lines. `::` is one sign.
fn tokens(code: &str) -> Vec<(&str, usize)> {
    let mut tokens = Vec::new();
    for (line, number) in code.lines().zip(1..) {
        let mut rest = line.trim_start();
        while let Some(first) = rest.chars().next() {
            let word = rest.find(|c: char| !is_word(c)).unwrap_or(rest.len());
            let sign = if rest.starts_with("::") { 2 } else { first.len_utf8() };
            let (token, after) = rest.split_at(if word > 0 { word } else { sign });
            tokens.push((token, number));
            rest = after.trim_start();
        }
    }
    tokens
}

/// Returns the text with comments, strings and characters blanked out. Everything else stays on its line.
fn code(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let blank = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if first == '"' {
            string(rest)
        } else if first == '\'' {
            character(rest).unwrap_or(0)
        } else if code.ends_with(is_word) {
            0
        } else {
            raw_string(rest).unwrap_or(0)
        };
        let (skipped, after) = rest.split_at(blank.max(first.len_utf8()));
        let keep = |c: char| if blank == 0 || c == '\n' { c } else { ' ' };
        code.extend(skipped.chars().map(keep));
        rest = after;
    }
    code
}

/// Returns the length of the comment that the text begins with, comments inside it included.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while let Some(c) = text[at..].chars().next() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += c.len_utf8();
        }
    }
    at
}

/// Returns the length of the string that the text begins with.
fn string(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == '"' && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// Returns the length of the raw string that the text begins with; `None` if it begins with anything else.
fn raw_string(text: &str) -> Option<usize> {
    let start = text.strip_prefix(['b', 'c']).unwrap_or(text).strip_prefix('r')?;
    let hashes = start.len() - start.trim_start_matches('#').len();
    let body = start[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = body.find(&end).map_or(body.len(), |at| at + end.len());
    Some(text.len() - body.len() + length)
}

/// Returns the length of the character that the text begins with; `None` if it begins with a lifetime.
fn character(text: &str) -> Option<usize> {
    let body = text.strip_prefix('\'')?;
    let first = body.chars().next()?;
    // What follows a backslash belongs to it, even a quote.
    let least = if first == '\\' { 2 } else { first.len_utf8() };
    let end = least + body.get(least..)?.find('\'')?;
    (first == '\\' || end == least).then_some(end + 2)
}

#[test]
fn paths_are_read_from_code_alone() {
    let text = r##"//! crate::doc
use crate::a::{self, b::{C, D as E}, f::*};
/* crate::x /* crate::y */ crate::z */
fn f<'a>(s: &'a str) { g("crate::s \" crate::s", r#"crate::r""#, '"', '\''); super::g::h::<u8>(s); }
mod tests {
    use super::super::i; // crate::comment
}
pub(in crate::j) struct K;
"##;
    let read = Source::new("k.rs", text);
    let show = |mention: &Mention| {
        let name = mention.name.as_deref().unwrap_or("-");
        format!("{} {} {} {name}", mention.line, mention.inside.join("::"), mention.path.join("::"))
    };
    let expected = [
        "2  crate::a a",
        "2  crate::a::b::C C",
        "2  crate::a::b::D E",
        "2  crate::a::f::* *",
        "4  super::g::h -",
        "6 tests super::super::i -",
        "8  crate::j -",
    ];
    assert_eq!(read.mentions.iter().map(show).collect::<Vec<_>>(), expected, "line, module inside, path, bound name");
    assert_eq!(read.items.iter().collect::<Vec<_>>(), ["K", "f", "tests"], "what the file defines");
}
