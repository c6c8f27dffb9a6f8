//! The paths in a Rust file.
//!
//! In: the text of the file. Out: every path of two or more names and every branch of a `use`, with its line and the
//! module around it; the names of the items that the file defines, and the names that occur outside of `use` items.
//! Comments, strings and doc text are skipped.

use std::collections::BTreeSet;

/// The path of a module from the crate root: `plugin`, `asset`.
pub type Module = Vec<String>;

/// The paths in a file, and the items that it defines.
pub struct Source {
    /// Path of the file below `src`, with forward slashes.
    pub file: String,
    pub mentions: Vec<Mention>,
    /// The names of the items that the file defines.
    pub items: BTreeSet<String>,
    /// The names that occur outside of `use` and `mod` items.
    pub words: BTreeSet<String>,
}

/// A path in a file.
pub struct Mention {
    pub line: usize,
    /// The module inside the file.
    pub inside: Module,
    pub path: Module,
    pub kind: Kind,
}

/// The kind of place of a path.
#[derive(PartialEq)]
pub enum Kind {
    /// In code.
    Code,
    /// In a `use`.
    Import {
        /// The name that the `use` binds; `*` for a glob.
        name: String,
        /// Whether the `use` stands outside of functions and inner modules.
        is_outermost: bool,
        /// Whether the `use` has a visibility: `pub use`, `pub(super) use`.
        is_reexport: bool,
    },
}

impl Mention {
    /// Returns whether the path is a `use` that binds a name, in any scope of the file.
    pub fn binds(&self, bound: &str) -> bool {
        matches!(&self.kind, Kind::Import { name, .. } if name == bound)
    }

    /// Returns whether the path is a `use` that binds a name for the whole file, so that other files can reach the
    /// name.
    pub fn exports(&self, bound: &str) -> bool {
        self.binds(bound) && matches!(self.kind, Kind::Import { is_outermost: true, .. })
    }

    /// Returns the name that the path binds if it is a re-export.
    pub fn reexported(&self) -> Option<&str> {
        match &self.kind {
            Kind::Import { name, is_reexport: true, .. } => Some(name),
            _ => None,
        }
    }
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
    /// Each token with its line.
    tokens: Vec<(&'a str, usize)>,
    at: usize,
    /// Number of open braces.
    depth: usize,
    /// Open inner modules, each with the number of braces open around it.
    inside: Vec<(String, usize)>,
    mentions: Vec<Mention>,
    items: BTreeSet<String>,
    words: BTreeSet<String>,
}

impl<'a> Reader<'a> {
    fn read(&mut self) {
        const DEFINING: [&str; 9] = ["const", "enum", "fn", "mod", "static", "struct", "trait", "type", "union"];
        while self.at < self.tokens.len() {
            let (word, next) = (self.peek(0), self.peek(1));
            if DEFINING.contains(&word) && is_name(next) {
                self.items.insert(next.to_owned());
            }
            let before = self.at.checked_sub(1).map_or("", |before| self.tokens[before].0);
            match word {
                "use" => {
                    self.at += 1;
                    // `pub use`, or `pub(super) use`.
                    self.branch(&[], matches!(before, "pub" | ")"));
                    continue;
                }
                // `::` after a type in angle brackets or after the name of a method does not begin a path.
                name if is_name(name) && next == "::" && !matches!(before, "::" | ".") => {
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
                name if is_name(name) && before != "mod" => {
                    self.words.insert(name.to_owned());
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
    fn branch(&mut self, stem: &[String], is_reexport: bool) {
        let line = self.line();
        let mut path = stem.to_vec();
        loop {
            match self.peek(0) {
                "::" => {}
                "{" => {
                    self.at += 1;
                    while !matches!(self.peek(0), "}" | ";" | "") {
                        let before = self.at;
                        self.branch(&path, is_reexport);
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
        let mut name = path.last().cloned().unwrap_or_default();
        if self.peek(0) == "as" {
            name = self.peek(1).to_owned();
            self.at += 2;
        }
        self.mention(line, path, Kind::Import { name, is_outermost: self.depth == 0, is_reexport });
    }

    /// Reads a path in code.
    fn path(&mut self) {
        let line = self.line();
        let mut path = vec![self.peek(0).to_owned()];
        self.words.insert(self.peek(0).to_owned());
        self.at += 1;
        while self.peek(0) == "::" && is_name(self.peek(1)) {
            path.push(self.peek(1).to_owned());
            self.at += 2;
        }
        if path.len() > 1 {
            self.mention(line, path, Kind::Code);
        }
    }

    fn line(&self) -> usize {
        self.tokens.get(self.at).map_or(0, |&(_, line)| line)
    }

    fn mention(&mut self, line: usize, path: Module, kind: Kind) {
        let inside = self.inside.iter().map(|(module, _)| module.clone()).collect();
        self.mentions.push(Mention { line, inside, path, kind });
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| is_word(c) && !c.is_numeric())
}

/// Splits code into words and signs, with their lines. `::` is one sign.
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

/// Returns the text with comments, strings and characters replaced by spaces. All other text stays on its line.
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

/// Returns the length of the comment at the start of the text, with the comments inside it.
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

/// Returns the length of the string at the start of the text.
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

/// Returns the length of the raw string at the start of the text; `None` if the text does not start with one.
fn raw_string(text: &str) -> Option<usize> {
    let start = text.strip_prefix(['b', 'c']).unwrap_or(text).strip_prefix('r')?;
    let hashes = start.len() - start.trim_start_matches('#').len();
    let body = start[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = body.find(&end).map_or(body.len(), |at| at + end.len());
    Some(text.len() - body.len() + length)
}

/// Returns the length of the character literal at the start of the text; `None` if the text starts with a lifetime.
fn character(text: &str) -> Option<usize> {
    let body = text.strip_prefix('\'')?;
    let first = body.chars().next()?;
    // The character after a backslash belongs to the escape, even a quote.
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
pub(super) use l::M;
fn n() { a::o(); s.p::<u8>(); <Q as R>::t(); mod_u::V::w() }
"##;
    let read = Source::new("k.rs", text);
    let show = |mention: &Mention| {
        let kind = match &mention.kind {
            Kind::Code => "-".to_owned(),
            Kind::Import { name, is_outermost, is_reexport } => {
                let scope = if *is_outermost { "" } else { " inner" };
                format!("{name}{scope}{}", if *is_reexport { " re-exported" } else { "" })
            }
        };
        format!("{} {} {} {kind}", mention.line, mention.inside.join("::"), mention.path.join("::"))
    };
    let expected = [
        "2  crate::a a",
        "2  crate::a::b::C C",
        "2  crate::a::b::D E",
        "2  crate::a::f::* *",
        "4  super::g::h -",
        "6 tests super::super::i i inner",
        "8  crate::j -",
        "9  l::M M re-exported",
        "10  a::o -",
        "10  mod_u::V::w -",
    ];
    let found = read.mentions.iter().map(show).collect::<Vec<_>>();
    assert_eq!(found, expected, "line, module inside the file, path, bound name");
    assert_eq!(read.items.iter().collect::<Vec<_>>(), ["K", "f", "n", "tests"], "the items that the file defines");
    let words = ["a", "g", "super", "K"].map(|word| read.words.contains(word));
    assert_eq!(words, [true; 4], "the names in code are words");
    let words = ["C", "E", "M", "i", "tests"].map(|word| read.words.contains(word));
    assert_eq!(words, [false; 5], "names of `use` and `mod` items are not words");
}
