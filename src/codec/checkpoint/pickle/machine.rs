//! The stack machine that interprets the pickle of a checkpoint, opcode by opcode.
//!
//! In: the bytes. Out: the values, each at most once; an error at the first opcode, object or argument that is not one
//! of a checkpoint. In files of other programs, objects that are not known are kept as their names.

use super::op;
use super::value::{Global, Name, Value};
use crate::codec::checkpoint::error::CheckpointError;
use crate::codec::checkpoint::tensor::{Storage, Tensor};
use crate::codec::pickle::{Id, Stack, Tape};
use std::collections::HashMap;

/// Largest number of axes of a tensor; tensors that are read have at most three.
const AXES: usize = 8;
/// Largest length in bytes of a numpy scalar in its text form, which has one or two bytes for each byte of the scalar.
const SCALAR_TEXT: usize = 16;

/// Why a pickle that is cut is refused.
const ENDS: &str = "the pickle ends too early";
/// Why an opcode without its value is refused.
const LACKS: &str = "a value is missing";

/// The stack machine that interprets a pickle.
#[derive(Default)]
pub(super) struct Machine<'a> {
    tape: Tape<'a>,
    /// Offset of the current opcode, for messages.
    opcode_at: usize,
    pub(super) values: Vec<Value<'a>>,
    stack: Stack,
    /// Whether objects that are not known are kept as their names.
    is_inert: bool,
    /// Bytes of a value of each storage.
    pub(super) sizes: HashMap<&'a str, u64>,
}

impl<'a> Machine<'a> {
    /// Starts at the first byte. `is_inert`: objects that are not known are kept as their names.
    pub(super) fn new(bytes: &'a [u8], is_inert: bool) -> Self {
        Self { tape: Tape::new(bytes), is_inert, ..Self::default() }
    }

    /// Returns the number of bytes that have been read.
    pub(super) fn length(&self) -> usize {
        self.tape.at()
    }

    /// Interprets one opcode. Returns the outermost value at the last opcode, else `None`.
    pub(super) fn step(&mut self) -> Result<Option<Id>, CheckpointError> {
        self.opcode_at = self.tape.at();
        let code = self.byte()?;
        match code {
            op::PROTO if self.byte()? == 2 => {}
            op::MARK => self.stack.mark(),
            op::STOP => return self.pop().map(Some),
            op::NONE => self.push(Value::None),
            op::NEWTRUE => self.push(Value::Bool(true)),
            op::NEWFALSE => self.push(Value::Bool(false)),
            op::BININT => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()));
            }
            op::BININT1 => {
                let value = self.byte()?;
                self.push(Value::Int(value.into()));
            }
            op::BININT2 => {
                let value = u16::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()));
            }
            op::BINFLOAT => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Value::Float(value));
            }
            op::BINUNICODE => {
                let text = self.text()?;
                self.push(Value::Text(text));
            }
            op::EMPTY_TUPLE => self.push(Value::Tuple(Vec::new())),
            op::TUPLE => {
                let items = self.pop_to_mark()?;
                self.push(Value::Tuple(items));
            }
            op::TUPLE1..=op::TUPLE3 => {
                let items = self.pop_many(usize::from(code - op::TUPLE1) + 1)?;
                self.push(Value::Tuple(items));
            }
            op::EMPTY_LIST => self.push(Value::List(Vec::new())),
            op::APPEND => {
                let items = self.pop_many(1)?;
                self.append(items)?;
            }
            op::APPENDS => {
                let items = self.pop_to_mark()?;
                self.append(items)?;
            }
            op::EMPTY_DICT => self.push(Value::Dict(Vec::new())),
            op::SETITEM => {
                let items = self.pop_many(2)?;
                self.set_items(items)?;
            }
            op::SETITEMS => {
                let items = self.pop_to_mark()?;
                self.set_items(items)?;
            }
            op::GLOBAL => {
                let global = self.global()?;
                self.push(global);
            }
            op::REDUCE => {
                let (arguments, callable) = (self.pop()?, self.pop()?);
                self.reduce(callable, arguments)?;
            }
            op::BUILD => {
                let state = self.pop()?;
                // The state of an object that is not known is not needed either.
                if !self.is_inert {
                    self.expect_little_endian(state)?;
                }
            }
            op::BINPERSID => {
                let id = self.pop()?;
                let storage = self.storage(id)?;
                self.push(storage);
            }
            op::BINPUT => {
                let index = self.byte()?;
                self.memoize(index.into())?;
            }
            op::LONG_BINPUT => {
                let index = u32::from_le_bytes(self.array()?);
                self.memoize(index)?;
            }
            op::BINGET => {
                let index = self.byte()?;
                self.recall(index.into())?;
            }
            op::LONG_BINGET => {
                let index = u32::from_le_bytes(self.array()?);
                self.recall(index)?;
            }
            _ if self.is_inert => self.other(code)?,
            _ => return Err(CheckpointError::Opcode { offset: self.opcode_at, code }),
        }
        Ok(None)
    }

    /// Interprets an opcode that only files of other programs have.
    fn other(&mut self, code: u8) -> Result<(), CheckpointError> {
        match code {
            op::LONG1 => {
                let length = self.byte()?;
                self.long(length.into())?;
            }
            op::LONG4 => {
                let length = u32::from_le_bytes(self.array()?);
                self.long(length as usize)?;
            }
            op::NEWOBJ => {
                self.pop()?;
                let class = self.pop()?;
                self.push(Value::Inert(self.name_of(class)));
            }
            // A mark on top counts as a value.
            op::POP if self.stack.pop_mark() => {}
            op::POP => {
                self.pop()?;
            }
            op::POP_MARK => {
                self.pop_to_mark()?;
            }
            op::DUP => {
                let top = self.top()?;
                self.stack.push(top);
            }
            _ => return Err(CheckpointError::Opcode { offset: self.opcode_at, code }),
        }
        Ok(())
    }

    pub(super) fn error(&self, reason: impl Into<String>) -> CheckpointError {
        CheckpointError::Pickle { offset: self.opcode_at, reason: reason.into() }
    }

    // Input.

    fn take(&mut self, count: usize) -> Result<&'a [u8], CheckpointError> {
        self.tape.take(count).ok_or_else(|| self.error(ENDS))
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CheckpointError> {
        self.tape.array().ok_or_else(|| self.error(ENDS))
    }

    fn byte(&mut self) -> Result<u8, CheckpointError> {
        self.array::<1>().map(|[byte]| byte)
    }

    fn text(&mut self) -> Result<&'a str, CheckpointError> {
        let length = u32::from_le_bytes(self.array()?);
        let bytes = self.take(length as usize)?;
        std::str::from_utf8(bytes).map_err(|_| self.error("a text that is not UTF-8"))
    }

    fn line(&mut self) -> Result<&'a [u8], CheckpointError> {
        self.tape.line().ok_or_else(|| self.error(ENDS))
    }

    fn global(&mut self) -> Result<Value<'a>, CheckpointError> {
        let (module, name) = (self.line()?, self.line()?);
        let inert = Name { module, name };
        match Global::of(module, name) {
            Some(global) => Ok(Value::Global(global)),
            None if self.is_inert => Ok(Value::Inert(inert)),
            None => Err(CheckpointError::Global { offset: self.opcode_at, name: inert.to_string() }),
        }
    }

    /// Pushes an int of so many bytes, the most significant one last.
    fn long(&mut self, length: usize) -> Result<(), CheckpointError> {
        let bytes = self.take(length)?;
        let value = match bytes.last() {
            None => Value::Int(0),
            Some(last) if length <= 8 => {
                let mut all = [if last & 0x80 == 0 { 0 } else { 0xff }; 8];
                all[..length].copy_from_slice(bytes);
                Value::Int(i64::from_le_bytes(all))
            }
            Some(_) => Value::Inert(Name { module: b"builtins", name: b"int" }),
        };
        self.push(value);
        Ok(())
    }

    // The stack.

    fn value(&self, id: Id) -> &Value<'a> {
        &self.values[id as usize]
    }

    fn push(&mut self, value: Value<'a>) {
        // At most one value for each byte of a pickle of limited size: the cast is lossless.
        self.stack.push(self.values.len() as Id);
        self.values.push(value);
    }

    fn top(&self) -> Result<Id, CheckpointError> {
        self.stack.top().ok_or_else(|| self.error(LACKS))
    }

    fn pop(&mut self) -> Result<Id, CheckpointError> {
        self.stack.pop().ok_or_else(|| self.error(LACKS))
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, CheckpointError> {
        self.stack.pop_many(count).ok_or_else(|| self.error(LACKS))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, CheckpointError> {
        self.stack.pop_to_mark().ok_or_else(|| self.error("a mark is missing"))
    }

    fn memoize(&mut self, index: u32) -> Result<(), CheckpointError> {
        self.stack.memoize(Some(index)).ok_or_else(|| self.error(LACKS))
    }

    fn recall(&mut self, index: u32) -> Result<(), CheckpointError> {
        self.stack.recall(index).ok_or_else(|| self.error(format!("the memo has no value {index}")))
    }

    /// Appends items to the list on top.
    fn append(&mut self, items: Vec<Id>) -> Result<(), CheckpointError> {
        let top = self.top()?;
        match &mut self.values[top as usize] {
            Value::List(all) => all.extend(items),
            _ if self.is_inert => {}
            other => {
                let kind = other.kind();
                return Err(self.error(format!("items to be added to {kind}, not a list")));
            }
        }
        Ok(())
    }

    /// Adds keys and values to the dictionary on top.
    fn set_items(&mut self, items: Vec<Id>) -> Result<(), CheckpointError> {
        let top = self.top()?;
        match &mut self.values[top as usize] {
            Value::Dict(all) if items.len().is_multiple_of(2) => all.extend(items),
            _ if self.is_inert => {}
            _ => return Err(self.error("items without a dictionary to add them to")),
        }
        Ok(())
    }

    // The objects.

    /// Checks the state of BUILD: only numpy types have one, whose second item is the byte order.
    fn expect_little_endian(&self, state: Id) -> Result<(), CheckpointError> {
        if let (Value::Dtype(_), Value::Tuple(items)) = (self.value(self.top()?), self.value(state))
            && let Some(&order) = items.get(1)
            && matches!(self.value(order), Value::Text("<"))
        {
            return Ok(());
        }
        Err(self.error("a state other than that of a little-endian numpy type"))
    }

    /// Returns the storage of a persistent id: `("storage", FloatStorage, key, location, element count)`, in files of
    /// torch before 1.6 with `None` after it: the storage is a part of no other.
    fn storage(&mut self, id: Id) -> Result<Value<'a>, CheckpointError> {
        if let Value::Tuple(items) = self.value(id)
            && let &[tag, class, key, _, count, ref view @ ..] = items.as_slice()
            && let (Value::Text("storage"), &Value::Text(key)) = (self.value(tag), self.value(key))
            && let Some(count) = self.count(count)
            && view.iter().all(|&view| matches!(self.value(view), Value::None))
        {
            let (is_float, name) =
                (matches!(self.value(class), Value::Global(Global::FloatStorage)), self.name_of(class));
            if is_float || self.is_inert {
                self.sizes.extend(size_of_value(name.name).map(|size| (key, size)));
                return Ok(if is_float { Value::Storage(Storage { key, count }) } else { Value::Inert(name) });
            }
        }
        Err(self.error("a persistent id that is not that of a float storage"))
    }

    /// Returns the name of an object, which is the kind of a value that has none.
    fn name_of(&self, id: Id) -> Name<'a> {
        match self.value(id) {
            Value::Inert(name) => *name,
            Value::Global(Global::FloatStorage) => Name { module: b"torch", name: b"FloatStorage" },
            other => Name { module: b"", name: other.kind().as_bytes() },
        }
    }

    fn count(&self, id: Id) -> Option<u64> {
        match *self.value(id) {
            Value::Int(value) => value.try_into().ok(),
            _ => None,
        }
    }

    /// Evaluates a call of `callable` and pushes the result.
    fn reduce(&mut self, callable: Id, arguments: Id) -> Result<(), CheckpointError> {
        let (&Value::Global(global), Value::Tuple(arguments)) = (self.value(callable), self.value(arguments)) else {
            return self.keep(callable, "a call of a value that is not a function".to_owned());
        };
        let result = match (global, arguments.as_slice()) {
            (Global::RebuildParameter, &[data, _, _]) if matches!(self.value(data), Value::Tensor(_)) => {
                self.stack.push(data);
                return Ok(());
            }
            // Newer versions of torch may add a seventh argument, metadata.
            (
                Global::RebuildTensor,
                &[storage, offset, size, stride, _, _] | &[storage, offset, size, stride, _, _, _],
            ) => self.tensor(storage, offset, size, stride),
            (Global::OrderedDict, []) => Some(Value::Dict(Vec::new())),
            (Global::NumpyDtype, &[name, _, _]) => match self.value(name) {
                Value::Text("f8") => Some(Value::Dtype(8)),
                Value::Text("f4") => Some(Value::Dtype(4)),
                _ => None,
            },
            (Global::NumpyScalar, &[dtype, bytes]) => self.scalar(dtype, bytes),
            (Global::Encode, &[text, encoding]) => self.encode(text, encoding),
            _ => None,
        };
        let Some(value) = result else {
            // A tensor of another type of number is named by its storage.
            let is_named = |id: &&Id| matches!(self.value(**id), Value::Inert(_));
            let named = arguments.first().filter(is_named).copied().unwrap_or(callable);
            return self.keep(named, format!("{global:?} is called with arguments that no checkpoint has"));
        };
        self.push(value);
        Ok(())
    }

    /// Pushes what a call that is not evaluated would return, under the name of an object.
    ///
    /// # Errors
    /// The reason, in a checkpoint of the trainer.
    fn keep(&mut self, named: Id, reason: String) -> Result<(), CheckpointError> {
        if !self.is_inert {
            return Err(self.error(reason));
        }
        self.push(Value::Inert(self.name_of(named)));
        Ok(())
    }

    fn tensor(&self, storage: Id, offset: Id, size: Id, stride: Id) -> Option<Value<'a>> {
        let &Value::Storage(storage) = self.value(storage) else { return None };
        let (size, stride) = (self.counts(size)?, self.counts(stride)?);
        let offset = self.count(offset)?;
        (size.len() == stride.len()).then(|| Value::Tensor(Box::new(Tensor { storage, offset, size, stride })))
    }

    fn counts(&self, id: Id) -> Option<Vec<u64>> {
        match self.value(id) {
            Value::Tuple(items) if items.len() <= AXES => items.iter().map(|&item| self.count(item)).collect(),
            _ => None,
        }
    }

    fn scalar(&self, dtype: Id, bytes: Id) -> Option<Value<'a>> {
        let (&Value::Dtype(size), Value::Bytes(bytes)) = (self.value(dtype), self.value(bytes)) else { return None };
        let value = match size {
            8 => f64::from_le_bytes(bytes.as_slice().try_into().ok()?),
            _ => f32::from_le_bytes(bytes.as_slice().try_into().ok()?).into(),
        };
        Some(Value::Float(value))
    }

    /// Returns bytes, which protocol 2 writes as a text of characters below 256.
    fn encode(&self, text: Id, encoding: Id) -> Option<Value<'a>> {
        match (self.value(text), self.value(encoding)) {
            (&Value::Text(text), Value::Text("latin1")) if text.len() <= SCALAR_TEXT => {
                let bytes = text.chars().map(|c| u8::try_from(u32::from(c))).collect::<Result<_, _>>();
                bytes.ok().map(Value::Bytes)
            }
            _ => None,
        }
    }
}

/// Returns the bytes of a value in a storage of this class.
fn size_of_value(class: &[u8]) -> Option<u64> {
    Some(match class {
        b"ByteStorage" | b"CharStorage" | b"BoolStorage" => 1,
        b"HalfStorage" | b"BFloat16Storage" | b"ShortStorage" => 2,
        b"FloatStorage" | b"IntStorage" => 4,
        b"DoubleStorage" | b"LongStorage" | b"ComplexFloatStorage" => 8,
        b"ComplexDoubleStorage" => 16,
        _ => return None,
    })
}
