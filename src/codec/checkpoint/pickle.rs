//! A restricted unpickler for `data.pkl`.
//!
//! In: the bytes of a protocol 2 pickle. Out: a [`Pickle`], a flat arena of values in which tensors are lazy: they
//! contain the location of their values only.
//!
//! Only the opcodes and objects that `torch.save` writes for checkpoints of the trainer are accepted; everything else
//! is refused by name, and nothing is ever executed. In the files of other trainers, further objects and the results of
//! calls are kept as names ([`Value::Inert`]). Every step adds at most one value, values refer to each other by index
//! (so nothing recurses), and no value is copied: time and memory are bounded by the length of the input.

use super::error::CheckpointError;
use super::tensor::{Storage, Tensor};
use crate::codec::text::printable;
use std::collections::HashMap;
use std::fmt;

/// Index of a value in a [`Pickle`].
pub(super) type Id = u32;

/// A value of a pickle.
#[derive(Debug)]
pub(super) enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(Vec<u8>),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    /// Keys and values, alternating.
    Dict(Vec<Id>),
    Global(Global),
    Storage(Storage<'a>),
    Tensor(Box<Tensor<'a>>),
    /// A numpy floating-point type, with its size in bytes.
    Dtype(usize),
    /// A Python object that is not known, or what a call of it would return.
    Inert(Name<'a>),
}

/// The name of a Python object: module and name, as in the pickle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name<'a> {
    module: &'a [u8],
    name: &'a [u8],
}

impl fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = format!("{} {}", String::from_utf8_lossy(self.module), String::from_utf8_lossy(self.name));
        f.write_str(&printable(name.trim()))
    }
}

impl Value<'_> {
    /// Returns the kind of the value, for messages.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) => "an int",
            Self::Float(_) => "a float",
            Self::Text(_) => "a text",
            Self::Bytes(_) => "bytes",
            Self::Tuple(_) => "a tuple",
            Self::List(_) => "a list",
            Self::Dict(_) => "a dictionary",
            Self::Global(_) | Self::Dtype(_) | Self::Inert(_) => "a Python object",
            Self::Storage(_) => "a storage without a tensor",
            Self::Tensor(_) => "a tensor",
        }
    }
}

/// The Python objects that a checkpoint may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Global {
    RebuildParameter,
    RebuildTensor,
    FloatStorage,
    OrderedDict,
    NumpyScalar,
    NumpyDtype,
    Encode,
}

impl Global {
    fn of(module: &[u8], name: &[u8]) -> Option<Self> {
        Some(match (module, name) {
            (b"torch._utils", b"_rebuild_parameter") => Self::RebuildParameter,
            (b"torch._utils", b"_rebuild_tensor_v2") => Self::RebuildTensor,
            (b"torch", b"FloatStorage") => Self::FloatStorage,
            (b"collections", b"OrderedDict") => Self::OrderedDict,
            (b"numpy.core.multiarray" | b"numpy._core.multiarray", b"scalar") => Self::NumpyScalar,
            (b"numpy", b"dtype") => Self::NumpyDtype,
            (b"_codecs", b"encode") => Self::Encode,
            _ => return None,
        })
    }
}

/// The values of a pickle.
#[derive(Debug)]
pub(super) struct Pickle<'a> {
    values: Vec<Value<'a>>,
    root: Id,
    /// Bytes of the pickle.
    length: usize,
    /// Bytes of a value of each storage.
    sizes: HashMap<&'a str, u64>,
}

impl<'a> Pickle<'a> {
    /// Parses a pickle.
    ///
    /// # Errors
    /// The first opcode, object or argument that is not one of a checkpoint.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, CheckpointError> {
        Self::run(Machine { bytes, ..Machine::default() })
    }

    /// Parses a pickle of another program: objects that no checkpoint of the trainer contains are kept as their names.
    ///
    /// # Errors
    /// The first opcode that `torch.save` does not write; a pickle that is cut.
    pub(super) fn parse_inert(bytes: &'a [u8]) -> Result<Self, CheckpointError> {
        Self::run(Machine { bytes, is_inert: true, ..Machine::default() })
    }

    fn run(mut machine: Machine<'a>) -> Result<Self, CheckpointError> {
        if !machine.bytes.starts_with(&[op::PROTO, 2]) {
            return Err(machine.error(
                "not a pickle of protocol 2, which torch.save writes unless it is told otherwise; save it again with \
                 torch.save(torch.load(path, map_location=\"cpu\", weights_only=False), path)",
            ));
        }
        loop {
            if let Some(root) = machine.step()? {
                let Machine { values, at, sizes, .. } = machine;
                return Ok(Self { values, root, length: at, sizes });
            }
        }
    }

    /// Returns the number of bytes of the pickle, which others may follow.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Returns the number of bytes of each value of a storage; `None` if no tensor has it.
    pub(super) fn size_of_storage(&self, key: &str) -> Option<u64> {
        self.sizes.get(key).copied()
    }

    /// Returns the keys that are texts, and the values, of a dictionary; nothing of another value.
    pub(super) fn entries(&self, dictionary: &Value<'a>) -> impl DoubleEndedIterator<Item = (&'a str, &Value<'a>)> {
        let ids = if let Value::Dict(ids) = dictionary { &ids[..] } else { &[] };
        ids.as_chunks::<2>().0.iter().filter_map(move |&[key, value]| match self.get(key) {
            &Value::Text(key) => Some((key, self.get(value))),
            _ => None,
        })
    }

    /// Returns the value of a key of a dictionary.
    pub(super) fn entry(&self, dictionary: &Value<'a>, key: &str) -> Option<&Value<'a>> {
        self.entries(dictionary).rfind(|&(found, _)| found == key).map(|(_, value)| value)
    }

    /// Returns the outermost value.
    pub(super) fn root(&self) -> &Value<'a> {
        self.get(self.root)
    }

    /// Returns the value that a tuple of this pickle refers to.
    pub(super) fn get(&self, id: Id) -> &Value<'a> {
        &self.values[id as usize]
    }
}

/// The opcodes of checkpoints, by their names in Python's `pickletools`.
mod op {
    pub(super) const PROTO: u8 = 0x80;
    pub(super) const MARK: u8 = b'(';
    pub(super) const STOP: u8 = b'.';
    pub(super) const NONE: u8 = b'N';
    pub(super) const NEWTRUE: u8 = 0x88;
    pub(super) const NEWFALSE: u8 = 0x89;
    pub(super) const BININT: u8 = b'J';
    pub(super) const BININT1: u8 = b'K';
    pub(super) const BININT2: u8 = b'M';
    pub(super) const BINFLOAT: u8 = b'G';
    pub(super) const BINUNICODE: u8 = b'X';
    pub(super) const EMPTY_TUPLE: u8 = b')';
    pub(super) const TUPLE: u8 = b't';
    pub(super) const TUPLE1: u8 = 0x85;
    pub(super) const TUPLE3: u8 = 0x87;
    pub(super) const EMPTY_LIST: u8 = b']';
    pub(super) const APPEND: u8 = b'a';
    pub(super) const APPENDS: u8 = b'e';
    pub(super) const EMPTY_DICT: u8 = b'}';
    pub(super) const SETITEM: u8 = b's';
    pub(super) const SETITEMS: u8 = b'u';
    pub(super) const GLOBAL: u8 = b'c';
    pub(super) const REDUCE: u8 = b'R';
    pub(super) const BUILD: u8 = b'b';
    pub(super) const BINPERSID: u8 = b'Q';
    pub(super) const BINPUT: u8 = b'q';
    pub(super) const LONG_BINPUT: u8 = b'r';
    pub(super) const BINGET: u8 = b'h';
    pub(super) const LONG_BINGET: u8 = b'j';
    // Only in files of other programs.
    pub(super) const LONG1: u8 = 0x8a;
    pub(super) const LONG4: u8 = 0x8b;
    pub(super) const NEWOBJ: u8 = 0x81;
    pub(super) const POP: u8 = b'0';
    pub(super) const POP_MARK: u8 = b'1';
    pub(super) const DUP: u8 = b'2';
}

/// Largest number of axes of a tensor; tensors that are read have at most three.
const AXES: usize = 8;
/// Largest length in bytes of a numpy scalar in its text form, which has one or two bytes for each byte of the scalar.
const SCALAR_TEXT: usize = 16;

/// The stack machine that interprets a pickle.
#[derive(Default)]
struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Offset of the current opcode, for messages.
    opcode_at: usize,
    values: Vec<Value<'a>>,
    stack: Vec<Id>,
    /// Lengths of the stack at each MARK.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
    /// Whether objects that are not known are kept as their names.
    is_inert: bool,
    /// Bytes of a value of each storage.
    sizes: HashMap<&'a str, u64>,
}

impl<'a> Machine<'a> {
    /// Interprets one opcode. Returns the outermost value at the last opcode, else `None`.
    fn step(&mut self) -> Result<Option<Id>, CheckpointError> {
        self.opcode_at = self.at;
        let code = self.byte()?;
        match code {
            op::PROTO if self.byte()? == 2 => {}
            op::MARK => self.marks.push(self.stack.len()),
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
            op::POP if self.available() == 0 && !self.marks.is_empty() => {
                self.marks.pop();
            }
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

    fn error(&self, reason: impl Into<String>) -> CheckpointError {
        CheckpointError::Pickle { offset: self.opcode_at, reason: reason.into() }
    }

    // Input.

    fn take(&mut self, count: usize) -> Result<&'a [u8], CheckpointError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest.get(..count).ok_or_else(|| self.error("the pickle ends too early"))?;
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CheckpointError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
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
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let length =
            rest.iter().position(|&byte| byte == b'\n').ok_or_else(|| self.error("the pickle ends too early"))?;
        let line = self.take(length)?;
        self.take(1)?;
        Ok(line)
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

    /// Returns the number of values above the last mark, which an opcode may take.
    fn available(&self) -> usize {
        self.stack.len() - self.marks.last().copied().unwrap_or(0)
    }

    fn top(&self) -> Result<Id, CheckpointError> {
        match self.stack.last() {
            Some(&id) if self.available() > 0 => Ok(id),
            _ => Err(self.error("a value is missing")),
        }
    }

    fn pop(&mut self) -> Result<Id, CheckpointError> {
        let id = self.top()?;
        self.stack.pop();
        Ok(id)
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, CheckpointError> {
        if self.available() < count {
            return Err(self.error("a value is missing"));
        }
        Ok(self.stack.split_off(self.stack.len() - count))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, CheckpointError> {
        let mark = self.marks.pop().ok_or_else(|| self.error("a mark is missing"))?;
        Ok(self.stack.split_off(mark))
    }

    fn memoize(&mut self, index: u32) -> Result<(), CheckpointError> {
        let id = self.top()?;
        self.memo.insert(index, id);
        Ok(())
    }

    fn recall(&mut self, index: u32) -> Result<(), CheckpointError> {
        let id = *self.memo.get(&index).ok_or_else(|| self.error(format!("the memo has no value {index}")))?;
        self.stack.push(id);
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(bytes: &[u8]) -> String {
        Pickle::parse(bytes).expect_err("must be refused").to_string()
    }

    #[test]
    fn foreign_objects_are_refused_by_name() {
        let message = refusal(b"\x80\x02cos\nsystem\n(X\x02\x00\x00\x00lstR.");
        assert!(message.contains("`os system`"), "the object is named: {message}");
        let message = refusal(b"\x80\x02cos\n\x1b[2Jsystem\n.");
        assert!(!message.contains('\x1b'), "control characters are escaped: {message}");
    }

    #[test]
    fn foreign_opcodes_are_refused_by_name() {
        let message = refusal(b"\x80\x02(S'ls'\nios\nsystem\n.");
        assert!(
            message.contains("0x53") && message.contains("byte 3"),
            "the opcode and its offset are named: {message}"
        );
    }

    #[test]
    fn popping_an_empty_pickle_stack_is_an_error() {
        for bytes in [
            &b"\x80\x02."[..],
            b"\x80\x02t.",
            b"\x80\x02(.",
            b"\x80\x02\x87.",
            b"\x80\x02NR.",
            b"\x80\x02q\x00.",
            b"\x80\x02h\x07.",
        ] {
            assert!(Pickle::parse(bytes).is_err(), "{bytes:?} pops a value or a mark that is not on the stack");
        }
    }

    #[test]
    fn foreign_objects_in_files_of_other_programs_are_kept_as_names_and_never_called() {
        // {"a": os.system("ls"), "b": collections.OrderedDict, "c": 2 ** 65, "d": -2}: a call, a state, a big int.
        let bytes = b"\x80\x02}(X\x01\0\0\0acos\nsystem\n(X\x02\0\0\0lstR}bX\x01\0\0\0bcmy\nClass\n)\x81\
            X\x01\0\0\0c\x8a\x09\0\0\0\0\0\0\0\0\x02X\x01\0\0\0d\x8a\x01\xfeu.";
        assert!(Pickle::parse(bytes).is_err(), "no checkpoint of the trainer has these");
        let pickle = Pickle::parse_inert(bytes).expect("valid");
        let named = |key: &str| match pickle.entry(pickle.root(), key) {
            Some(Value::Inert(name)) => name.to_string(),
            other => panic!("{key} is inert: {other:?}"),
        };
        assert_eq!(
            [named("a"), named("b")],
            ["os system", "my Class"],
            "an object and the result of a call are kept as names"
        );
        assert_eq!(named("c"), "builtins int", "an int that is too large");
        assert!(matches!(pickle.entry(pickle.root(), "d"), Some(Value::Int(-2))), "a small int");
        assert_eq!(pickle.length(), bytes.len(), "all bytes");
        let keys: Vec<&str> = pickle.entries(pickle.root()).map(|(key, _)| key).collect();
        assert_eq!(keys, ["a", "b", "c", "d"], "the keys in order");
        assert_eq!(pickle.entry(pickle.root(), "e").map(Value::kind), None, "a key that is not there");
    }

    #[test]
    fn deep_nesting_does_not_recurse() {
        let mut bytes = b"\x80\x02N".to_vec();
        bytes.extend(std::iter::repeat_n(op::TUPLE1, 500_000));
        bytes.push(op::STOP);
        let pickle = Pickle::parse(&bytes).expect("valid");
        assert_eq!(pickle.root().kind(), "a tuple", "the outermost of half a million tuples");
    }

    #[test]
    fn numpy_scalars_of_both_sizes_are_floats() {
        for (module, dtype, text) in
            [("numpy.core.multiarray", "f8", "\0\0\0\0\0\0\u{f8}?"), ("numpy._core.multiarray", "f4", "\0\0\u{c0}?")]
        {
            let mut bytes = format!("\x02c{module}\nscalar\ncnumpy\ndtype\nX\x02\0\0\0{dtype}").into_bytes();
            bytes.insert(0, op::PROTO);
            bytes.extend([op::NEWFALSE, op::NEWTRUE, op::TUPLE3, op::REDUCE]);
            bytes.extend(b"(K\x03X\x01\0\0\0<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tbc_codecs\nencode\nX");
            bytes.extend((text.len() as u32).to_le_bytes());
            bytes.extend(text.as_bytes());
            bytes.extend(b"X\x06\0\0\0latin1\x86R\x86R.");
            let pickle = Pickle::parse(&bytes).expect("valid");
            assert!(matches!(pickle.root(), Value::Float(1.5)), "{dtype}: {:?}", pickle.root());
        }
    }
}
