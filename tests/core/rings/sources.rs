//! The files of a crate as modules, and which of them use which.
//!
//! In: files with their paths below `src`. Out: the module that each path in them leads to, also through re-exports;
//! the paths that an order of the modules forbids; the files that use each other in a circle.

use super::paths::{Mention, Module, Source};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::Path;

/// An order of modules: what each of them may use beside itself.
pub type Order = [(&'static str, &'static [&'static str])];

/// The files of a crate.
pub struct Sources {
    /// Each by the module that it is.
    pub modules: BTreeMap<Module, Source>,
}

/// A path that leads to a module of the crate.
pub struct Use<'a> {
    module: &'a Module,
    source: &'a Source,
    mention: &'a Mention,
    target: Module,
}

impl Sources {
    /// Returns the files of this crate, without its binaries.
    pub fn of_this_crate() -> Self {
        let mut files = Vec::new();
        collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut files);
        Self::new(files.iter().map(|(file, text)| (file.as_str(), text.as_str())))
    }

    /// Reads files, given their paths below `src`, with forward slashes, and their contents.
    pub fn new<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut modules = BTreeMap::new();
        for (file, text) in files {
            let mut module: Module = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if file.ends_with("/mod.rs") || file == "lib.rs" {
                module.pop();
            }
            modules.insert(module, Source::new(file, text));
        }
        Self { modules }
    }

    /// Returns every path that leads to a module of the crate.
    pub fn uses(&self) -> Vec<Use<'_>> {
        let mut uses = Vec::new();
        for (module, source) in &self.modules {
            for mention in &source.mentions {
                if let Some(target) = self.target(module, mention) {
                    uses.push(Use { module, source, mention, target });
                }
            }
        }
        uses
    }

    /// Returns the module that a path leads to; `None` if it is one of another crate.
    fn target(&self, module: &Module, mention: &Mention) -> Option<Module> {
        let module = [module.as_slice(), mention.inside.as_slice()].concat();
        let (base, path) = self.start(&module, &mention.path)?;
        Some(self.find(&base, path, 8).unwrap_or_else(|| self.descend(&base, path).0))
    }

    /// Returns the module at which a path starts, and the rest of the path; `None` for a path of another crate.
    fn start<'a>(&self, module: &[String], path: &'a [String]) -> Option<(Module, &'a [String])> {
        let mut base = module.to_vec();
        let (first, mut rest) = path.split_first()?;
        match first.as_str() {
            "crate" => base.clear(),
            "self" => {}
            "super" => {
                base.pop()?;
                while rest.first().is_some_and(|name| name == "super") {
                    base.pop()?;
                    rest = &rest[1..];
                }
            }
            child => {
                base.push(child.to_owned());
                self.modules.get(&base)?;
            }
        }
        Some((base, rest))
    }

    /// Follows a path as far as it names modules. Returns the last of them and the rest of the path.
    fn descend<'a>(&self, base: &[String], mut path: &'a [String]) -> (Module, &'a [String]) {
        let mut module = base.to_vec();
        while let Some((name, rest)) = path.split_first() {
            module.push(name.clone());
            if !self.modules.contains_key(&module) {
                module.pop();
                break;
            }
            path = rest;
        }
        (module, path)
    }

    /// Returns the module that defines the item of a path, behind at most `reexports` re-exports; `None` if there is
    /// none.
    fn find(&self, base: &[String], path: &[String], reexports: usize) -> Option<Module> {
        let (module, rest) = self.descend(base, path);
        let source = self.modules.get(&module)?;
        let Some((item, after)) = rest.split_first().filter(|(item, _)| *item != "*") else { return Some(module) };
        let reexports = reexports.checked_sub(1)?;
        let named = source.mentions.iter().find(|mention| mention.name.as_ref() == Some(item));
        if let Some(reexport) = named {
            let (base, path) = self.start(&module, &reexport.path)?;
            return self.find(&base, &[path, after].concat(), reexports);
        }
        if source.items.contains(item) {
            return Some(module);
        }
        let mut globs = source.mentions.iter().filter(|mention| mention.name.as_deref() == Some("*"));
        let behind = |glob: &Mention| {
            let (base, path) = self.start(&module, &glob.path)?;
            self.find(&self.descend(&base, path).0, rest, reexports)
        };
        globs.find_map(behind)
    }

    /// Returns the paths that are forbidden by the order of the outermost modules, or by that inside the module
    /// `plugin`.
    pub fn outward(&self, rings: &Order, plugin: &Order) -> Vec<String> {
        let mut outward = Vec::new();
        for Use { module, source, mention, target } in self.uses() {
            let in_plugin = |module: &Module| module.first().is_some_and(|name| name == "plugin");
            let inner = in_plugin(module) && in_plugin(&target);
            let (order, depth): (&Order, usize) = if inner { (plugin, 1) } else { (rings, 0) };
            let name = |module: &Module| module.get(depth).cloned().unwrap_or_default();
            if !may_use(order, &name(module), &name(&target)) {
                let show = |module: &Module| module[..module.len().min(depth + 1)].join("::");
                let to = if target.is_empty() { "the crate root".to_owned() } else { show(&target) };
                let path = position(source, mention);
                outward.push(format!("{path} leads to {to}, which {} may not use", show(module)));
            }
        }
        outward
    }

    /// Returns the shortest circle through each file, each circle once: the paths that it consists of, one a line. A
    /// `mod.rs` is a file like the others: an item that it defines is its own. A re-export is no use, unless the code of
    /// the file has the name, too. The modules `tests` of unit tests may use anything.
    pub fn cycles(&self) -> Vec<String> {
        let counts = |source: &Source, mention: &Mention| {
            let has_name = mention.name.as_ref().is_some_and(|name| source.words.contains(name));
            (!mention.exported || has_name) && !mention.inside.iter().any(|module| module == "tests")
        };
        let mut edges: BTreeMap<&Module, BTreeMap<Module, String>> = BTreeMap::new();
        for Use { module, source, mention, target } in self.uses() {
            if *module != target && counts(source, mention) && self.modules.contains_key(&target) {
                edges.entry(module).or_default().entry(target).or_insert_with(|| position(source, mention));
            }
        }
        let mut cycles = BTreeSet::new();
        for &start in edges.keys() {
            let mut reached = BTreeSet::new();
            let mut queue = VecDeque::from([(start, Vec::new())]);
            while let Some((file, way)) = queue.pop_front() {
                if file == start && !way.is_empty() {
                    cycles.insert(way.into_iter().collect::<BTreeSet<&str>>());
                    break;
                }
                for (next, step) in edges.get(file).into_iter().flatten() {
                    if reached.insert(next) {
                        queue.push_back((next, [way.as_slice(), &[step.as_str()]].concat()));
                    }
                }
            }
        }
        cycles.iter().map(|steps| steps.iter().map(|step| format!("{step}\n")).collect()).collect()
    }
}

/// Returns whether an order lets one module use another. A module that is not in it may use all others and be used by
/// none.
fn may_use(order: &Order, from: &str, to: &str) -> bool {
    let row = order.iter().find(|(name, _)| *name == from);
    row.is_none_or(|(_, inner)| from == to || inner.contains(&to))
}

fn position(source: &Source, mention: &Mention) -> String {
    format!("src/{}:{}: {}", source.file, mention.line, mention.path.join("::"))
}

/// Collects every Rust file below a folder with its text. Binaries are left out: they are crates of their own.
fn collect(folder: &Path, prefix: &str, files: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).expect("the folder can be listed") {
        let path = entry.expect("the entry can be read").path();
        let name = path.file_name().expect("an entry has a name").to_string_lossy().into_owned();
        let file = format!("{prefix}{name}");
        if path.is_dir() {
            if file != "bin" {
                collect(&path, &format!("{file}/"), files);
            }
        } else if file.ends_with(".rs") {
            files.push((file, fs::read_to_string(&path).expect("the file is text")));
        }
    }
}
