//! Uniform control flow around barriers, as browsers require it. naga does not check it for values in workgroup memory.
//!
//! In: the shaders of all passes. Out: proof that no barrier depends on a value that may differ between the threads of
//! a workgroup: a thread index, workgroup memory that is not read by `workgroupUniformLoad`, a buffer that the shader
//! writes, the result of an atomic. The members of a variable are not distinguished, as in browsers.

use crate::support::composed::{compose, pass_names};
use bevy_gs4d::internal::renderer::AtOnce;
use bevy_gs4d::internal::renderer::{Blending, COUNTED, EIGHT_AT_ONCE, LARGE_BATCHES, Lists, OPAQUE};
use bevy_gs4d::internal::renderer::{COPIED_INSTANCE, MULTISAMPLED};
use bevy_gs4d::renderer::Storage;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use wgpu::naga::{
    AddressSpace, Binding, Block, BuiltIn, Expression, Function, Handle, LocalVariable, Module, Statement,
    StorageAccess,
};

/// The results of checks: for each function and the indices of its arguments that vary, whether its value varies, and
/// the faults in it and in the functions that it calls.
type Results = RefCell<BTreeMap<(usize, BTreeSet<u32>), (bool, Vec<String>)>>;

/// The check of one function.
struct Check<'a> {
    module: &'a Module,
    function: &'a Function,
    is_entry: bool,
    /// Arguments of this function, and local variables, that may differ between threads.
    arguments: BTreeSet<u32>,
    locals: BTreeSet<Handle<LocalVariable>>,
    /// Results of calls that vary.
    calls: BTreeSet<Handle<Expression>>,
    results: &'a Results,
    faults: Vec<String>,
}

/// Returns whether a block contains a barrier, also in functions that it calls.
fn has_barrier(module: &Module, block: &Block) -> bool {
    block.iter().any(|statement| is_or_has_barrier(module, statement))
}

fn is_or_has_barrier(module: &Module, statement: &Statement) -> bool {
    match statement {
        Statement::ControlBarrier(_) | Statement::WorkGroupUniformLoad { .. } => true,
        Statement::Block(inner) => has_barrier(module, inner),
        Statement::If { accept, reject, .. } => has_barrier(module, accept) || has_barrier(module, reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| has_barrier(module, &case.body)),
        Statement::Loop { body, continuing, .. } => has_barrier(module, body) || has_barrier(module, continuing),
        Statement::Call { function, .. } => has_barrier(module, &module.functions[*function].body),
        _ => false,
    }
}

/// Returns whether a block leaves the loop around it.
fn breaks(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Break | Statement::Continue => true,
        Statement::Block(inner) => breaks(inner),
        Statement::If { accept, reject, .. } => breaks(accept) || breaks(reject),
        _ => false,
    })
}

/// Returns whether a block leaves the function.
fn returns(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Return { .. } | Statement::Kill => true,
        Statement::Block(inner) => returns(inner),
        Statement::If { accept, reject, .. } => returns(accept) || returns(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| returns(&case.body)),
        Statement::Loop { body, continuing, .. } => returns(body) || returns(continuing),
        _ => false,
    })
}

impl Check<'_> {
    /// Returns whether a value may differ between the threads of a workgroup.
    fn varies(&self, expression: Handle<Expression>) -> bool {
        use Expression as E;
        let any = |all: &[Handle<Expression>]| all.iter().any(|&one| self.varies(one));
        match &self.function.expressions[expression] {
            E::FunctionArgument(index) => self.argument_varies(*index),
            E::Load { pointer } => self.load_varies(*pointer),
            E::CallResult(_) => self.calls.contains(&expression),
            E::AtomicResult { .. } | E::SubgroupBallotResult | E::SubgroupOperationResult { .. } => true,
            E::Compose { components, .. } => any(components),
            E::Access { base, index } => any(&[*base, *index]),
            E::AccessIndex { base, .. } | E::Splat { value: base, .. } | E::Swizzle { vector: base, .. } => {
                any(&[*base])
            }
            E::Unary { expr, .. } | E::As { expr, .. } => any(&[*expr]),
            E::Binary { left, right, .. } => any(&[*left, *right]),
            E::Select { condition, accept, reject } => any(&[*condition, *accept, *reject]),
            E::Relational { argument, .. } => any(&[*argument]),
            E::Math { arg, arg1, arg2, arg3, .. } => {
                self.varies(*arg) || [arg1, arg2, arg3].into_iter().flatten().any(|&one| self.varies(one))
            }
            E::ImageLoad { coordinate, .. } => any(&[*coordinate]),
            _ => false,
        }
    }

    fn argument_varies(&self, index: u32) -> bool {
        if !self.is_entry {
            return self.arguments.contains(&index);
        }
        let binding = &self.function.arguments[index as usize].binding;
        !matches!(binding, Some(Binding::BuiltIn(BuiltIn::WorkGroupId | BuiltIn::NumWorkGroups)))
    }

    fn load_varies(&self, pointer: Handle<Expression>) -> bool {
        match &self.function.expressions[pointer] {
            Expression::Access { base, index } => self.varies(*index) || self.load_varies(*base),
            Expression::AccessIndex { base, .. } => self.load_varies(*base),
            Expression::LocalVariable(local) => self.locals.contains(local),
            Expression::FunctionArgument(index) => self.argument_varies(*index),
            Expression::GlobalVariable(global) => match self.module.global_variables[*global].space {
                AddressSpace::WorkGroup => true,
                AddressSpace::Storage { access } => access.contains(StorageAccess::STORE),
                _ => false,
            },
            _ => false,
        }
    }

    /// Returns the local variable to which a pointer points.
    fn local(&self, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        match &self.function.expressions[pointer] {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.local(*base),
            Expression::LocalVariable(local) => Some(*local),
            _ => None,
        }
    }

    /// Returns whether an argument varies; a pointer to a local variable varies with the variable.
    fn varies_or_points(&self, argument: Handle<Expression>) -> bool {
        self.local(argument).map_or_else(|| self.varies(argument), |local| self.locals.contains(&local))
    }

    /// Visits a block. `differs`: only some threads may execute the block. `later`: a barrier follows the block, or is
    /// in a loop around it. `looped`: a barrier is in the innermost loop around the block.
    fn visit(&mut self, block: &Block, differs: bool, later: bool, looped: bool) {
        for (index, statement) in block.iter().enumerate() {
            let later = later || block[index + 1..].iter().any(|next| is_or_has_barrier(self.module, next));
            match statement {
                Statement::Store { pointer, value } => {
                    if let Some(local) = self.local(*pointer)
                        && (differs || self.varies(*value))
                    {
                        self.locals.insert(local);
                    }
                }
                Statement::Block(inner) => self.visit(inner, differs, later, looped),
                Statement::If { condition, accept, reject } => {
                    let varies = self.varies(*condition);
                    let inside = has_barrier(self.module, accept) || has_barrier(self.module, reject);
                    let broken = looped && (breaks(accept) || breaks(reject));
                    let left = broken || later && (returns(accept) || returns(reject));
                    if varies && (inside || left) {
                        let what = if inside { "a barrier is in" } else { "a barrier follows" };
                        let name = self.function.name.clone().unwrap_or_else(|| "the entry point".into());
                        let condition = &self.function.expressions[*condition];
                        self.faults.push(format!("{name}: {what} a branch on a varying value, {condition:?}"));
                    }
                    self.visit(accept, differs || varies, later, looped);
                    self.visit(reject, differs || varies, later, looped);
                }
                Statement::Switch { selector, cases } => {
                    let varies = self.varies(*selector);
                    for case in cases {
                        self.visit(&case.body, differs || varies, later, looped);
                    }
                }
                Statement::Loop { body, continuing, .. } => {
                    let inside = has_barrier(self.module, body) || has_barrier(self.module, continuing);
                    self.visit(body, differs, later || inside, inside);
                    self.visit(continuing, differs, later || inside, inside);
                }
                Statement::Call { function, arguments, result } => {
                    let varying = (0..).zip(arguments).filter(|(_, argument)| self.varies_or_points(**argument));
                    let varying = varying.map(|(index, _)| index).collect();
                    let callee = &self.module.functions[*function];
                    let (varies, mut faults) =
                        check(self.module, callee, function.index(), &varying, false, self.results);
                    self.faults.append(&mut faults);
                    if let (true, Some(result)) = (varies, result) {
                        self.calls.insert(*result);
                    }
                    // The function may write through pointers.
                    let written: Vec<_> = arguments.iter().filter_map(|&argument| self.local(argument)).collect();
                    self.locals.extend(written);
                }
                _ => {}
            }
        }
    }
}

/// Checks a function with these varying arguments. Returns whether its value varies, and the faults.
fn check(
    module: &Module,
    function: &Function,
    index: usize,
    arguments: &BTreeSet<u32>,
    is_entry: bool,
    results: &Results,
) -> (bool, Vec<String>) {
    let key = (index, arguments.clone());
    if !is_entry && let Some(known) = results.borrow().get(&key) {
        return known.clone();
    }
    let arguments = arguments.clone();
    let (locals, calls) = Default::default();
    let mut check = Check { module, function, is_entry, arguments, locals, calls, results, faults: Vec::new() };
    // Until no further variable varies.
    loop {
        let before = (check.locals.len(), check.calls.len());
        check.faults.clear();
        check.visit(&function.body, false, false, false);
        if (check.locals.len(), check.calls.len()) == before {
            break;
        }
    }
    let varies = returned(&function.body).iter().any(|&value| check.varies(value));
    check.faults.sort();
    check.faults.dedup();
    let result = (varies, check.faults);
    if !is_entry {
        results.borrow_mut().insert(key, result.clone());
    }
    result
}

/// Returns the values that a function returns.
fn returned(block: &Block) -> Vec<Handle<Expression>> {
    let inner = |statement: &Statement| match statement {
        Statement::Return { value: Some(value) } => vec![*value],
        Statement::Block(inner) => returned(inner),
        Statement::If { accept, reject, .. } => [returned(accept), returned(reject)].concat(),
        Statement::Loop { body, continuing, .. } => [returned(body), returned(continuing)].concat(),
        _ => Vec::new(),
    };
    block.iter().flat_map(inner).collect()
}

/// Returns the faults of a shader.
fn faults(name: &str, definitions: &[&str]) -> Vec<String> {
    let module = compose(name, definitions).expect("the pass composes");
    let results = Results::default();
    let entries = module.entry_points.iter();
    let all = entries.flat_map(|entry| check(&module, &entry.function, 0, &BTreeSet::new(), true, &results).1);
    let all: BTreeSet<String> = all.collect();
    all.into_iter().map(|fault| format!("{name} with {definitions:?}: {fault}")).collect()
}

#[test]
fn no_barrier_depends_on_a_value_that_differs_between_threads() {
    let blending = Blending::ALL.into_iter().flat_map(|blending| {
        [&[][..], LARGE_BATCHES].map(|batches| ("blend_blocks", [blending.definitions(), batches].concat()))
    });
    let lists = Lists::ALL
        .into_iter()
        .flat_map(|lists| [&[][..], COUNTED].map(|counted| ("sort_bins", [lists.definitions(), counted].concat())));
    let at_once = AtOnce::ALL.into_iter().map(|at_once| ("blend", [at_once.definitions(), MULTISAMPLED].concat()));
    let readers = Storage::ALL.into_iter().flat_map(|storage| {
        [("project_bin", &[][..]), ("project_bin", OPAQUE), ("colors", COPIED_INSTANCE)]
            .map(|(name, own)| (name, [own, storage.definitions()].concat()))
    });
    let surfaces = ("find_surfaces", MULTISAMPLED.to_vec());
    let eight = ("blend_blocks", [Blending::ColorBehindSurfaces.definitions(), EIGHT_AT_ONCE].concat());
    let plain = pass_names().map(|name| (name, Vec::new()));
    let all = plain.chain(blending).chain(lists).chain(at_once).chain(readers).chain([surfaces, eight]);
    let faults: Vec<String> = all.flat_map(|(name, definitions)| faults(name, &definitions)).collect();
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
