//! The stack of an unpickler: indices of values, marks between them, and the memo of those that are used again.
//!
//! In: what the opcodes do. Out: indices; `None` where a pickle takes what is not there.

use std::collections::HashMap;

/// Index of a value of a pickle.
pub(crate) type Id = u32;

/// The stack of an unpickler.
#[derive(Default)]
pub(crate) struct Stack {
    ids: Vec<Id>,
    /// Lengths of the stack at each MARK.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

impl Stack {
    /// Puts a value on top.
    pub(crate) fn push(&mut self, id: Id) {
        self.ids.push(id);
    }

    /// Puts a mark on top.
    pub(crate) fn mark(&mut self) {
        self.marks.push(self.ids.len());
    }

    /// Returns the number of values above the last mark, which an opcode may take.
    fn available(&self) -> usize {
        self.ids.len() - self.marks.last().copied().unwrap_or(0)
    }

    /// Returns the value on top.
    pub(crate) fn top(&self) -> Option<Id> {
        self.ids.last().copied().filter(|_| self.available() > 0)
    }

    /// Takes the value on top.
    pub(crate) fn pop(&mut self) -> Option<Id> {
        self.top()?;
        self.ids.pop()
    }

    /// Takes the mark on top. Returns whether there is one, with no value above it.
    pub(crate) fn pop_mark(&mut self) -> bool {
        self.available() == 0 && self.marks.pop().is_some()
    }

    /// Takes so many values, the lowest first.
    pub(crate) fn pop_many(&mut self, count: usize) -> Option<Vec<Id>> {
        (self.available() >= count).then(|| self.ids.split_off(self.ids.len() - count))
    }

    /// Takes the last mark and the values above it.
    pub(crate) fn pop_to_mark(&mut self) -> Option<Vec<Id>> {
        self.marks.pop().map(|mark| self.ids.split_off(mark))
    }

    /// Keeps the value on top in the memo, under an index or, without one, under the next.
    pub(crate) fn memoize(&mut self, index: Option<u32>) -> Option<()> {
        // At most one entry for each byte of a file of limited size: the cast is lossless.
        let index = index.unwrap_or(self.memo.len() as u32);
        self.memo.insert(index, self.top()?);
        Some(())
    }

    /// Puts a value of the memo on top.
    pub(crate) fn recall(&mut self, index: u32) -> Option<()> {
        self.ids.push(*self.memo.get(&index)?);
        Some(())
    }
}
