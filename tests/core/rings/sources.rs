//! The files of a crate as modules, and the uses between them.
//!
//! In: files with their paths below `src`. Out: the module that each path leads to, behind imports and re-exports; the
//! paths that an order of the modules forbids; the files that use each other in a cycle.

use super::paths::{Kind, Mention, Module, Source};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::Path;

/// The most imports and re-exports that are followed from a path to the item that it names.
const MOST_REEXPORTS: usize = 8;

/// An order of modules: for each module, the other modules that it may use.
pub type Order = [(&'static str, &'static [&'static str])];

/// The files of a crate.
pub struct Sources {
    /// The files by their modules.
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

    /// Returns the module that a path leads to; `None` if it is a path of another crate.
    fn target(&self, file: &Module, mention: &Mention) -> Option<Module> {
        let (base, path) = self.start(file, &mention.inside, &mention.path, MOST_REEXPORTS)?;
        Some(self.find(&base, &path, MOST_REEXPORTS).unwrap_or_else(|| self.descend(&base, &path).0))
    }

    /// Returns the module at which a path in the module `inside` of a file starts, and the rest of the path; `None` for
    /// a path of another crate. An imported first name is replaced by the path of the import, at most `imports` times.
    fn start(&self, file: &[String], inside: &[String], path: &[String], imports: usize) -> Option<(Module, Module)> {
        let mut base = [file, inside].concat();
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
            name => {
                let child = [file, &[name.to_owned()]].concat();
                if self.modules.contains_key(&child) {
                    return Some((child, rest.to_vec()));
                }
                let imported = |mention: &&Mention| mention.binds(name) && mention.path != path;
                let import = self.modules.get(file)?.mentions.iter().find(imported)?;
                let (base, stem) = self.start(file, &import.inside, &import.path, imports.checked_sub(1)?)?;
                return Some((base, [&stem, rest].concat()));
            }
        }
        Some((base, rest.to_vec()))
    }

    /// Follows a path as far as it names modules. Returns the last module and the rest of the path.
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

    /// Returns the module that defines the item of a path, behind at most `reexports` re-exports; `None` if no file
    /// defines the item.
    fn find(&self, base: &[String], path: &[String], reexports: usize) -> Option<Module> {
        let (module, rest) = self.descend(base, path);
        let source = self.modules.get(&module)?;
        let Some((item, after)) = rest.split_first().filter(|(item, _)| *item != "*") else { return Some(module) };
        let reexports = reexports.checked_sub(1)?;
        let named = source.mentions.iter().find(|mention| mention.exports(item));
        if let Some(reexport) = named {
            let (base, path) = self.start(&module, &[], &reexport.path, reexports)?;
            return self.find(&base, &[&path, after].concat(), reexports);
        }
        if source.items.contains(item) {
            return Some(module);
        }
        let mut globs = source.mentions.iter().filter(|mention| mention.exports("*"));
        let behind = |glob: &Mention| {
            let (base, path) = self.start(&module, &[], &glob.path, reexports)?;
            self.find(&self.descend(&base, &path).0, rest, reexports)
        };
        globs.find_map(behind)
    }

    /// Returns the paths that are forbidden by the order of the outermost modules, or by the order inside the module
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

    /// Returns the shortest cycle through each file, each cycle once: its paths, one on each line.
    pub fn cycles(&self) -> Vec<String> {
        let mut edges: BTreeMap<&Module, BTreeMap<Module, String>> = BTreeMap::new();
        for used in self.uses().into_iter().filter(|used| self.depends(used)) {
            let Use { module, source, mention, target } = used;
            edges.entry(module).or_default().entry(target).or_insert_with(|| position(source, mention));
        }
        shortest_circles(&edges)
    }

    /// Returns the circles among folders: for each two folders of one parent where each leads to the other, over any
    /// number of folders of that parent, one path of each step. A path between two files counts for the two folders
    /// where their places diverge.
    pub fn folder_cycles(&self) -> Vec<String> {
        let mut edges: BTreeMap<Module, BTreeMap<Module, String>> = BTreeMap::new();
        for Use { module, source, mention, target } in self.uses() {
            let shared = module.iter().zip(&target).take_while(|(from, to)| from == to).count();
            let folders = [module, &target].map(|file| file[..file.len().min(shared + 1)].to_vec());
            let diverge = folders.iter().all(|folder| folder.len() == shared + 1 && self.is_folder(folder));
            if diverge {
                let [from, to] = folders;
                edges.entry(from).or_default().entry(to).or_insert_with(|| position(source, mention));
            }
        }
        shortest_circles(&edges.iter().map(|(from, to)| (from, to.clone())).collect())
    }

    /// Returns whether a module is a folder.
    fn is_folder(&self, module: &Module) -> bool {
        self.modules.get(module).is_some_and(is_mod)
    }

    /// Returns whether a path makes its file depend on the file that the path leads to.
    fn depends(&self, used: &Use<'_>) -> bool {
        let Use { module, source, mention, target } = used;
        if *module == target {
            return false;
        }
        // A `mod.rs` that only re-exports an item of a child does not depend on it.
        if let Some(name) = mention.reexported()
            && is_mod(source)
            && target.starts_with(module)
        {
            let items = match name {
                "*" => self.modules.get(target).map(|globbed| &globbed.items),
                _ => None,
            };
            return source.words.contains(name) || items.is_some_and(|items| !items.is_disjoint(&source.words));
        }
        // An import of a folder is not a use of its `mod.rs`: the paths that begin with the imported name lead to the
        // items.
        let is_import = mention.kind != Kind::Code && !mention.binds("*");
        let is_folder = self.modules.get(target).is_some_and(is_mod);
        !(is_import && is_folder && self.names_module(module, mention))
    }

    /// Returns whether a path names a module itself, not an item of it.
    fn names_module(&self, file: &Module, mention: &Mention) -> bool {
        let start = self.start(file, &mention.inside, &mention.path, MOST_REEXPORTS);
        start.is_some_and(|(base, path)| self.modules.contains_key(&[base, path].concat()))
    }
}

/// Returns the shortest circle through each node of a graph, each circle once: the texts of its edges, one on each
/// line.
fn shortest_circles(edges: &BTreeMap<&Module, BTreeMap<Module, String>>) -> Vec<String> {
    let mut cycles = BTreeSet::new();
    for &start in edges.keys() {
        let mut reached = BTreeSet::new();
        let mut queue = VecDeque::from([(start, Vec::new())]);
        while let Some((node, way)) = queue.pop_front() {
            if node == start && !way.is_empty() {
                cycles.insert(way.into_iter().collect::<BTreeSet<&str>>());
                break;
            }
            for (next, step) in edges.get(node).into_iter().flatten() {
                if reached.insert(next) {
                    queue.push_back((next, [way.as_slice(), &[step.as_str()]].concat()));
                }
            }
        }
    }
    cycles.iter().map(|steps| steps.iter().map(|step| format!("{step}\n")).collect()).collect()
}

/// Returns whether a file is a `mod.rs` or the root of the crate.
fn is_mod(source: &Source) -> bool {
    source.file == "lib.rs" || source.file == "mod.rs" || source.file.ends_with("/mod.rs")
}

/// Returns whether an order lets one module use another. A module that is not in the order may use every module and be
/// used by none.
fn may_use(order: &Order, from: &str, to: &str) -> bool {
    let row = order.iter().find(|(name, _)| *name == from);
    row.is_none_or(|(_, inner)| from == to || inner.contains(&to))
}

fn position(source: &Source, mention: &Mention) -> String {
    format!("src/{}:{}: {}", source.file, mention.line, mention.path.join("::"))
}

/// Collects every Rust file below a folder with its text. Binaries are left out, since they are separate crates.
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
