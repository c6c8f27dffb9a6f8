//! A restricted unpickler for dictionaries that NumPy has saved.
//!
//! In: the bytes of a pickle of protocol 2 to 4, as `numpy.save` writes it for an object. Out: a [`Pickle`]:
//! dictionaries, lists, texts, numbers and arrays of numbers, read one by one.
//!
//! Only the opcodes and objects of such files are accepted; everything else is refused by name, and nothing is ever
//! executed. Every step adds at most one value of a fixed size, values refer to each other by index (so nothing
//! recurses), and the bytes of arrays stay in the file until their numbers are asked for: time and memory are bounded
//! by the length of the input, and by the number of numbers asked for. The unpickler of checkpoints
//! (`codec::checkpoint`) is another one: theirs have protocol 2, and tensors whose values are in other files.

use crate::codec::text::printable;
use std::borrow::Cow;
use std::collections::HashMap;

/// Most values. The largest known file has 5 million.
const MAX_VALUES: usize = 1 << 24;
/// Most axes of an array.
const MAX_AXES: usize = 8;

/// Index of a value in a [`Pickle`].
pub(super) type Id = u32;

/// A value.
#[derive(Debug)]
enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    /// Bytes as characters below 256, as protocol 2 has them.
    Latin1(&'a str),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    /// Keys and values, alternating.
    Dict(Vec<Id>),
    Global(Global),
    Dtype(Dtype),
    /// An array; `None` before its contents are known.
    Array(Option<Box<Array>>),
}

/// The Python objects that such a file may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Global {
    Reconstruct,
    Ndarray,
    Scalar,
    Dtype,
    Encode,
    Bytes,
    OrderedDict,
}

impl Global {
    fn of(module: &str, name: &str) -> Option<Self> {
        Some(match (module, name) {
            ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Self::Reconstruct,
            ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Self::Scalar,
            ("numpy", "ndarray") => Self::Ndarray,
            ("numpy", "dtype") => Self::Dtype,
            ("_codecs", "encode") => Self::Encode,
            ("builtins" | "__builtin__", "bytes") => Self::Bytes,
            ("collections", "OrderedDict") => Self::OrderedDict,
            _ => return None,
        })
    }
}

/// The type of the values of an array.
#[derive(Debug, Clone, Copy)]
struct Dtype {
    kind: Kind,
    is_big_endian: bool,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Double,
    Single,
    Long,
    Int,
    /// The values are other values of the pickle.
    Object,
    /// A type whose values are not read.
    Other,
}

/// An array of any number of axes.
#[derive(Debug)]
struct Array {
    shape: Vec<usize>,
    dtype: Dtype,
    is_fortran: bool,
    /// Bytes, or a list of objects.
    data: Id,
}

/// The values of a pickle.
#[derive(Debug)]
pub(super) struct Pickle<'a> {
    values: Vec<Value<'a>>,
    root: Id,
}

impl<'a> Pickle<'a> {
    /// Parses a pickle.
    ///
    /// # Errors
    /// The first opcode, object or argument that such a file does not have.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let mut machine = Machine { bytes, ..Machine::default() };
        if !matches!(bytes, [op::PROTO, 2..=4, ..]) {
            return Err("its object is no pickle of protocol 2, 3 or 4: save it again with numpy.save".to_owned());
        }
        loop {
            if let Some(root) = machine.step()? {
                return Ok(Self { values: machine.values, root });
            }
        }
    }

    /// Returns the outermost value; of an array of one object that object.
    pub(super) fn root(&self) -> Id {
        match self.get(self.root) {
            Value::Array(Some(array)) => match self.get(array.data) {
                Value::List(items) if items.len() == 1 => items[0],
                _ => self.root,
            },
            _ => self.root,
        }
    }

    /// Returns the value of a key of a dictionary, the last one if there are several.
    pub(super) fn entry(&self, dictionary: Id, key: &str) -> Option<Id> {
        let Value::Dict(ids) = self.get(dictionary) else { return None };
        ids.as_chunks::<2>().0.iter().rfind(|[found, _]| self.text(*found) == Some(key)).map(|&[_, value]| value)
    }

    /// Returns the values of a list or a tuple.
    pub(super) fn items(&self, list: Id) -> Option<&[Id]> {
        match self.get(list) {
            Value::List(items) | Value::Tuple(items) => Some(items),
            _ => None,
        }
    }

    /// Returns a text.
    pub(super) fn text(&self, text: Id) -> Option<&'a str> {
        match *self.get(text) {
            Value::Text(text) => Some(text),
            Value::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    /// Returns the numbers of a value, which may be an array, a number, or a list of any of these: row by row, at most
    /// `most`.
    ///
    /// # Errors
    /// More numbers, a value that has none, an array whose bytes are not those of its shape.
    pub(super) fn numbers(&self, value: Id, most: usize) -> Result<Vec<f64>, String> {
        // Each number may be in a list of its own, and these in others.
        let limit = 4 * most + 16;
        let (mut numbers, mut pending, mut steps) = (Vec::new(), vec![value], 0);
        while let Some(id) = pending.pop() {
            steps += 1;
            let nested: &[Id] = match self.get(id) {
                Value::Int(value) => {
                    numbers.push(*value as f64);
                    &[]
                }
                Value::Float(value) => {
                    numbers.push(*value);
                    &[]
                }
                Value::List(items) | Value::Tuple(items) => items,
                Value::Array(Some(array)) if array.is_of_objects() => {
                    self.items(array.data).ok_or("an array of objects without a list of them")?
                }
                Value::Array(Some(array)) => {
                    numbers.extend(self.values_of(array, most)?);
                    &[]
                }
                other => return Err(format!("{} in place of a number", other.kind())),
            };
            if numbers.len() > most || pending.len() + nested.len() > limit || steps > limit {
                return Err(format!("more than {most} numbers"));
            }
            pending.extend(nested.iter().rev());
        }
        Ok(numbers)
    }

    /// Returns the numbers of an array, the last index changing fastest.
    fn values_of(&self, array: &Array, most: usize) -> Result<Vec<f64>, String> {
        let count = array.shape.iter().try_fold(1usize, |product, &side| product.checked_mul(side));
        let count = count.filter(|count| *count <= most).ok_or_else(|| format!("more than {most} numbers"))?;
        let size = match array.dtype.kind {
            Kind::Double | Kind::Long => 8,
            Kind::Single | Kind::Int => 4,
            Kind::Object | Kind::Other => return Err("an array of a type other than f8, f4, i8 and i4".to_owned()),
        };
        let bytes = self.bytes(array.data, count * size).ok_or("an array whose bytes are not those of its shape")?;
        let value = |index: usize| array.dtype.number(&bytes[array.place(index, count) * size..][..size]);
        Ok((0..count).map(value).collect())
    }

    /// Returns the bytes of a value, if they are so many.
    fn bytes(&self, value: Id, count: usize) -> Option<Cow<'a, [u8]>> {
        let bytes = match *self.get(value) {
            Value::Bytes(bytes) => Cow::Borrowed(bytes),
            // A character below 256 has one or two bytes.
            Value::Latin1(text) if text.len() <= 2 * count => {
                Cow::Owned(text.chars().map(|c| u8::try_from(u32::from(c))).collect::<Result<Vec<u8>, _>>().ok()?)
            }
            _ => return None,
        };
        (bytes.len() == count).then_some(bytes)
    }

    fn get(&self, id: Id) -> &Value<'a> {
        &self.values[id as usize]
    }
}

impl Value<'_> {
    /// Returns the kind of the value, for messages.
    fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) | Self::Float(_) => "a number",
            Self::Text(_) => "a text",
            Self::Bytes(_) | Self::Latin1(_) => "bytes",
            Self::Tuple(_) => "a tuple",
            Self::List(_) => "a list",
            Self::Dict(_) => "a dictionary",
            Self::Global(_) | Self::Dtype(_) => "a Python object",
            Self::Array(_) => "an array",
        }
    }
}

impl Array {
    fn is_of_objects(&self) -> bool {
        matches!(self.dtype.kind, Kind::Object)
    }

    /// Returns the place in the data of a value by its index, for which the last axis changes fastest.
    fn place(&self, index: usize, count: usize) -> usize {
        if !self.is_fortran {
            return index;
        }
        let (mut rest, mut stride, mut place) = (index, count, 0);
        for side in self.shape.iter().rev() {
            // There is an index, so that no side is 0.
            stride /= side;
            place += rest % side * stride;
            rest /= side;
        }
        place
    }
}

impl Dtype {
    /// Returns the type of this name.
    fn of(name: &str) -> Self {
        let kind = match name {
            "f8" => Kind::Double,
            "f4" => Kind::Single,
            "i8" => Kind::Long,
            "i4" => Kind::Int,
            "O" | "O8" | "O4" => Kind::Object,
            _ => Kind::Other,
        };
        Self { kind, is_big_endian: false }
    }

    /// Returns the number of these bytes, as many as the type has.
    fn number(self, bytes: &[u8]) -> f64 {
        let mut ordered = [0; 8];
        for (to, from) in ordered.iter_mut().zip(bytes) {
            *to = *from;
        }
        if self.is_big_endian {
            ordered[..bytes.len().min(8)].reverse();
        }
        let [a, b, c, d, ..] = ordered;
        match self.kind {
            Kind::Double => f64::from_le_bytes(ordered),
            Kind::Single => f32::from_le_bytes([a, b, c, d]).into(),
            Kind::Long => i64::from_le_bytes(ordered) as f64,
            Kind::Int | Kind::Object | Kind::Other => i32::from_le_bytes([a, b, c, d]).into(),
        }
    }
}

/// The opcodes of such files, by their names in Python's `pickletools`.
mod op {
    pub(super) const PROTO: u8 = 0x80;
    pub(super) const FRAME: u8 = 0x95;
    pub(super) const MARK: u8 = b'(';
    pub(super) const STOP: u8 = b'.';
    pub(super) const NONE: u8 = b'N';
    pub(super) const NEWTRUE: u8 = 0x88;
    pub(super) const NEWFALSE: u8 = 0x89;
    pub(super) const BININT: u8 = b'J';
    pub(super) const BININT1: u8 = b'K';
    pub(super) const BININT2: u8 = b'M';
    pub(super) const LONG1: u8 = 0x8a;
    pub(super) const BINFLOAT: u8 = b'G';
    pub(super) const SHORT_BINSTRING: u8 = b'U';
    pub(super) const BINSTRING: u8 = b'T';
    pub(super) const SHORT_BINUNICODE: u8 = 0x8c;
    pub(super) const BINUNICODE: u8 = b'X';
    pub(super) const SHORT_BINBYTES: u8 = b'C';
    pub(super) const BINBYTES: u8 = b'B';
    pub(super) const BINBYTES8: u8 = 0x8e;
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
    pub(super) const STACK_GLOBAL: u8 = 0x93;
    pub(super) const REDUCE: u8 = b'R';
    pub(super) const BUILD: u8 = b'b';
    pub(super) const BINPUT: u8 = b'q';
    pub(super) const LONG_BINPUT: u8 = b'r';
    pub(super) const MEMOIZE: u8 = 0x94;
    pub(super) const BINGET: u8 = b'h';
    pub(super) const LONG_BINGET: u8 = b'j';
}

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
}

impl<'a> Machine<'a> {
    /// Interprets one opcode. Returns the outermost value at the last opcode, else `None`.
    fn step(&mut self) -> Result<Option<Id>, String> {
        self.opcode_at = self.at;
        let code = self.byte()?;
        match code {
            op::PROTO => self.skip(1)?,
            op::FRAME => self.skip(8)?,
            op::MARK => self.marks.push(self.stack.len()),
            op::STOP => return self.pop().map(Some),
            op::REDUCE => self.reduce()?,
            op::BUILD => self.build()?,
            op::BINPUT | op::LONG_BINPUT | op::MEMOIZE => self.memoize(code)?,
            op::BINGET | op::LONG_BINGET => self.recall(code)?,
            op::APPEND | op::APPENDS | op::SETITEM | op::SETITEMS => self.fill(code)?,
            _ => {
                let value = self.simple(code)?;
                self.push(value)?;
            }
        }
        Ok(None)
    }

    /// Returns the value of an opcode that pushes one.
    fn simple(&mut self, code: u8) -> Result<Value<'a>, String> {
        Ok(match code {
            op::NONE => Value::None,
            op::NEWTRUE | op::NEWFALSE => Value::Bool(code == op::NEWTRUE),
            op::BININT => Value::Int(i32::from_le_bytes(self.array()?).into()),
            op::BININT1 => Value::Int(self.byte()?.into()),
            op::BININT2 => Value::Int(u16::from_le_bytes(self.array()?).into()),
            op::LONG1 => self.long()?,
            op::BINFLOAT => Value::Float(f64::from_be_bytes(self.array()?)),
            op::SHORT_BINUNICODE | op::BINUNICODE => Value::Text(self.text(code)?),
            op::SHORT_BINSTRING | op::BINSTRING | op::SHORT_BINBYTES | op::BINBYTES | op::BINBYTES8 => {
                let length = self.length(code)?;
                Value::Bytes(self.take(length)?)
            }
            op::EMPTY_TUPLE => Value::Tuple(Vec::new()),
            op::TUPLE => Value::Tuple(self.pop_to_mark()?),
            op::TUPLE1..=op::TUPLE3 => Value::Tuple(self.pop_many(usize::from(code - op::TUPLE1) + 1)?),
            op::EMPTY_LIST => Value::List(Vec::new()),
            op::EMPTY_DICT => Value::Dict(Vec::new()),
            op::GLOBAL => {
                let (module, name) = (self.line()?, self.line()?);
                self.global(module, name)?
            }
            op::STACK_GLOBAL => {
                let (name, module) = (self.pop_text()?, self.pop_text()?);
                self.global(module, name)?
            }
            _ => return Err(self.fault(&format!("the opcode {code:#04x}"))),
        })
    }

    fn fault(&self, what: &str) -> String {
        format!(
            "byte {} of its pickle: {what}, which a dictionary of lists, texts and arrays that NumPy has saved does \
             not have; nothing in it was run: copy the file again, or save such a dictionary",
            self.opcode_at
        )
    }

    // Input.

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest.get(..count).ok_or_else(|| self.fault("a sudden end"))?;
        self.at += count;
        Ok(taken)
    }

    fn skip(&mut self, count: usize) -> Result<(), String> {
        self.take(count).map(|_| ())
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn byte(&mut self) -> Result<u8, String> {
        self.array::<1>().map(|[byte]| byte)
    }

    /// Reads the length of a text or of bytes.
    fn length(&mut self, code: u8) -> Result<usize, String> {
        let length: u64 = match code {
            op::SHORT_BINUNICODE | op::SHORT_BINSTRING | op::SHORT_BINBYTES => self.byte()?.into(),
            op::BINBYTES8 => u64::from_le_bytes(self.array()?),
            _ => u32::from_le_bytes(self.array()?).into(),
        };
        usize::try_from(length).map_err(|_| self.fault("a length beyond the file"))
    }

    fn text(&mut self, code: u8) -> Result<&'a str, String> {
        let length = self.length(code)?;
        let bytes = self.take(length)?;
        std::str::from_utf8(bytes).map_err(|_| self.fault("a text that is not UTF-8"))
    }

    /// Reads an int of any number of bytes, of which eight are kept.
    fn long(&mut self) -> Result<Value<'a>, String> {
        let length = self.byte()?;
        let bytes = self.take(length.into())?;
        let fill = if bytes.last().is_some_and(|last| last & 0x80 != 0) { 0xff } else { 0 };
        let mut all = [fill; 8];
        let Some(kept) = all.get_mut(..bytes.len()) else { return Err(self.fault("an int of more than 64 bits")) };
        kept.copy_from_slice(bytes);
        Ok(Value::Int(i64::from_le_bytes(all)))
    }

    fn line(&mut self) -> Result<&'a str, String> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let length = rest.iter().position(|&byte| byte == b'\n').ok_or_else(|| self.fault("a sudden end"))?;
        let line = self.take(length)?;
        self.skip(1)?;
        std::str::from_utf8(line).map_err(|_| self.fault("a name that is not UTF-8"))
    }

    fn global(&self, module: &str, name: &str) -> Result<Value<'a>, String> {
        let global = Global::of(module, name);
        let unknown = || self.fault(&format!("the Python object `{} {}`", printable(module), printable(name)));
        global.map(Value::Global).ok_or_else(unknown)
    }

    // The stack.

    fn push(&mut self, value: Value<'a>) -> Result<(), String> {
        if self.values.len() >= MAX_VALUES {
            return Err(self.fault(&format!("a value after {MAX_VALUES} others")));
        }
        // The limit is below 2³²: the cast is lossless.
        self.stack.push(self.values.len() as Id);
        self.values.push(value);
        Ok(())
    }

    fn value(&self, id: Id) -> &Value<'a> {
        &self.values[id as usize]
    }

    /// Returns the number of values above the last mark, which an opcode may take.
    fn available(&self) -> usize {
        self.stack.len() - self.marks.last().copied().unwrap_or(0)
    }

    fn top(&self) -> Result<Id, String> {
        let top = self.stack.last().copied().filter(|_| self.available() > 0);
        top.ok_or_else(|| self.fault("an opcode without its value"))
    }

    fn pop(&mut self) -> Result<Id, String> {
        let top = self.top()?;
        self.stack.pop();
        Ok(top)
    }

    fn pop_text(&mut self) -> Result<&'a str, String> {
        let id = self.pop()?;
        match *self.value(id) {
            Value::Text(text) => Ok(text),
            _ => Err(self.fault("an object whose name is no text")),
        }
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, String> {
        if self.available() < count {
            return Err(self.fault("an opcode without its value"));
        }
        Ok(self.stack.split_off(self.stack.len() - count))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, String> {
        let mark = self.marks.pop().ok_or_else(|| self.fault("an opcode without its mark"))?;
        Ok(self.stack.split_off(mark))
    }

    fn memoize(&mut self, code: u8) -> Result<(), String> {
        let index = match code {
            op::BINPUT => self.byte()?.into(),
            op::LONG_BINPUT => u32::from_le_bytes(self.array()?),
            // At most one entry for each byte of a file of limited size: the cast is lossless.
            _ => self.memo.len() as u32,
        };
        let top = self.top()?;
        self.memo.insert(index, top);
        Ok(())
    }

    fn recall(&mut self, code: u8) -> Result<(), String> {
        let index = if code == op::BINGET { self.byte()?.into() } else { u32::from_le_bytes(self.array()?) };
        let id = self.memo.get(&index).copied().ok_or_else(|| self.fault("a reference to nothing"))?;
        self.stack.push(id);
        Ok(())
    }

    /// Adds items to the list, or keys and values to the dictionary, on top.
    fn fill(&mut self, code: u8) -> Result<(), String> {
        let new = match code {
            op::APPEND => self.pop_many(1)?,
            op::SETITEM => self.pop_many(2)?,
            _ => self.pop_to_mark()?,
        };
        let is_list = matches!(code, op::APPEND | op::APPENDS);
        let top = self.top()?;
        match &mut self.values[top as usize] {
            Value::List(items) if is_list => items.extend(new),
            Value::Dict(items) if !is_list && new.len().is_multiple_of(2) => items.extend(new),
            other => {
                let kind = other.kind();
                return Err(self.fault(&format!("items to be added to {kind}")));
            }
        }
        Ok(())
    }

    // The objects.

    /// Evaluates a call, and pushes the result.
    fn reduce(&mut self) -> Result<(), String> {
        let (arguments, callable) = (self.pop()?, self.pop()?);
        let result = match (self.value(callable), self.value(arguments)) {
            (&Value::Global(global), Value::Tuple(arguments)) => self.result(global, arguments),
            _ => None,
        };
        let value = result.ok_or_else(|| self.fault("a call of another function, or with other arguments"))?;
        self.push(value)
    }

    fn result(&self, global: Global, arguments: &[Id]) -> Option<Value<'a>> {
        match (global, arguments) {
            (Global::Reconstruct, &[class, _, _]) => {
                matches!(self.value(class), Value::Global(Global::Ndarray)).then_some(Value::Array(None))
            }
            (Global::Dtype, &[name, ..]) => Some(Value::Dtype(Dtype::of(self.name(name)?))),
            (Global::Scalar, &[dtype, data]) => match *self.value(dtype) {
                Value::Dtype(dtype) => {
                    let array = Array { shape: Vec::new(), dtype, is_fortran: false, data };
                    Some(Value::Array(Some(Box::new(array))))
                }
                _ => None,
            },
            (Global::Encode, &[text, encoding]) => match (self.value(text), self.name(encoding)) {
                (&Value::Text(text), Some("latin1")) => Some(Value::Latin1(text)),
                _ => None,
            },
            (Global::Bytes, []) => Some(Value::Bytes(b"")),
            (Global::OrderedDict, []) => Some(Value::Dict(Vec::new())),
            _ => None,
        }
    }

    /// Returns a text of ASCII, which Python 2 writes as bytes.
    fn name(&self, id: Id) -> Option<&'a str> {
        match *self.value(id) {
            Value::Text(text) => Some(text),
            Value::Bytes(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    /// Sets the state of the array or the type on top.
    fn build(&mut self) -> Result<(), String> {
        let state = self.pop()?;
        let top = self.top()?;
        let parts = match self.value(state) {
            Value::Tuple(parts) => &parts[..],
            _ => &[],
        };
        let new = match (self.value(top), parts) {
            (Value::Array(_), &[_version, shape, dtype, is_fortran, data]) => {
                self.contents(shape, dtype, is_fortran, data).map(|array| Value::Array(Some(Box::new(array))))
            }
            (&Value::Dtype(Dtype { kind, .. }), &[_version, order, ..]) => {
                self.name(order).map(|order| Value::Dtype(Dtype { kind, is_big_endian: order == ">" }))
            }
            _ => None,
        };
        let new = new.ok_or_else(|| self.fault("a state that is not that of an array or of its type"))?;
        self.values[top as usize] = new;
        Ok(())
    }

    fn contents(&self, shape: Id, dtype: Id, is_fortran: Id, data: Id) -> Option<Array> {
        let (Value::Tuple(sides), &Value::Dtype(dtype)) = (self.value(shape), self.value(dtype)) else { return None };
        if sides.len() > MAX_AXES {
            return None;
        }
        let side = |&side: &Id| match *self.value(side) {
            Value::Int(side) => usize::try_from(side).ok(),
            _ => None,
        };
        let shape = sides.iter().map(side).collect::<Option<Vec<usize>>>()?;
        Some(Array { shape, dtype, is_fortran: matches!(self.value(is_fortran), Value::Bool(true)), data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // {'a': array([[1., 2.], [3., 4.]]), 'f': asfortranarray(array([[1, 2, 3], [4, 5, 6]], '>f4')), 'l': [[1, 2.5],
    // (float64(-3), array([7], '<i4'))], 'n': ['x', 'y']}, by NumPy 2.4 in protocols 2 and 4.
    const TWO: &[u8] = b"\
        \x80\x02cnumpy._core.multiarray\n_reconstruct\nq\0cnumpy\nndarray\nq\x01K\0\x85q\x02c_codecs\nencode\nq\
        \x03X\x01\0\0\0bq\x04X\x06\0\0\0latin1q\x05\x86q\x06Rq\x07\x87q\x08Rq\t(K\x01)cnumpy\ndtype\nq\nX\x02\0\0\
        \0O8q\x0b\x89\x88\x87q\x0cRq\r(K\x03X\x01\0\0\0|q\x0eNNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK?tq\x0fb\x89]q\
        \x10}q\x11(X\x01\0\0\0aq\x12h\0h\x01K\0\x85q\x13h\x07\x87q\x14Rq\x15(K\x01K\x02K\x02\x86q\x16h\nX\x02\0\0\
        \0f8q\x17\x89\x88\x87q\x18Rq\x19(K\x03X\x01\0\0\0<q\x1aNNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tq\x1bb\x89\
        h\x03X!\0\0\0\0\0\0\0\0\0\xc3\xb0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\x08@\0\0\0\0\0\0\x10@q\x1ch\x05\x86q\x1dRq\
        \x1etq\x1fbX\x01\0\0\0fq h\0h\x01K\0\x85q!h\x07\x87q\"Rq#(K\x01K\x02K\x03\x86q$h\nX\x02\0\0\0f4q%\x89\x88\
        \x87q&Rq'(K\x03X\x01\0\0\0>q(NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tq)b\x88h\x03X\x1c\0\0\0?\xc2\x80\0\0\
        @\xc2\x80\0\0@\0\0\0@\xc2\xa0\0\0@@\0\0@\xc3\x80\0\0q*h\x05\x86q+Rq,tq-bX\x01\0\0\0lq.]q/(]q0(K\x01G@\x04\
        \0\0\0\0\0\0ecnumpy._core.multiarray\nscalar\nq1h\x19h\x03X\t\0\0\0\0\0\0\0\0\0\x08\xc3\x80q2h\x05\x86q3Rq\
        4\x86q5Rq6h\0h\x01K\0\x85q7h\x07\x87q8Rq9(K\x01K\x01\x85q:h\nX\x02\0\0\0i4q;\x89\x88\x87q<Rq=(K\x03h\x1aNN\
        NJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tq>b\x89h\x03X\x04\0\0\0\x07\0\0\0q?h\x05\x86q@RqAtqBb\x86qCeX\x01\0\
        \0\0nqD]qE(X\x01\0\0\0xqFX\x01\0\0\0yqGeuatqHb.";
    const FOUR: &[u8] = b"\
        \x80\x04\x95\xdd\x01\0\0\0\0\0\0\x8c\x16numpy._core.multiarray\x94\x8c\x0c_reconstruct\x94\x93\x94\x8c\x05\
        numpy\x94\x8c\x07ndarray\x94\x93\x94K\0\x85\x94C\x01b\x94\x87\x94R\x94(K\x01)h\x03\x8c\x05dtype\x94\x93\
        \x94\x8c\x02O8\x94\x89\x88\x87\x94R\x94(K\x03\x8c\x01|\x94NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK?t\x94b\
        \x89]\x94}\x94(\x8c\x01a\x94h\x02h\x05K\0\x85\x94h\x07\x87\x94R\x94(K\x01K\x02K\x02\x86\x94h\x0b\x8c\x02f8\
        \x94\x89\x88\x87\x94R\x94(K\x03\x8c\x01<\x94NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0t\x94b\x89C \0\0\0\0\0\
        \0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\x08@\0\0\0\0\0\0\x10@\x94t\x94b\x8c\x01f\x94h\x02h\x05K\0\x85\x94h\x07\
        \x87\x94R\x94(K\x01K\x02K\x03\x86\x94h\x0b\x8c\x02f4\x94\x89\x88\x87\x94R\x94(K\x03\x8c\x01>\x94NNNJ\xff\
        \xff\xff\xffJ\xff\xff\xff\xffK\0t\x94b\x88C\x18?\x80\0\0@\x80\0\0@\0\0\0@\xa0\0\0@@\0\0@\xc0\0\0\x94t\x94b\
        \x8c\x01l\x94]\x94(]\x94(K\x01G@\x04\0\0\0\0\0\0eh\0\x8c\x06scalar\x94\x93\x94h\x1aC\x08\0\0\0\0\0\0\x08\
        \xc0\x94\x86\x94R\x94h\x02h\x05K\0\x85\x94h\x07\x87\x94R\x94(K\x01K\x01\x85\x94h\x0b\x8c\x02i4\x94\x89\x88\
        \x87\x94R\x94(K\x03h\x1bNNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0t\x94b\x89C\x04\x07\0\0\0\x94t\x94b\x86\
        \x94e\x8c\x01n\x94]\x94(\x8c\x01x\x94\x8c\x01y\x94euat\x94b.";

    fn fault(bytes: &[u8]) -> String {
        Pickle::parse(bytes).expect_err("the pickle is refused")
    }

    fn numbers(pickle: &Pickle<'_>, key: &str, most: usize) -> Result<Vec<f64>, String> {
        pickle.numbers(pickle.entry(pickle.root(), key).expect("the dictionary has this key"), most)
    }

    #[test]
    fn numbers_and_texts_of_every_form_are_read() {
        for (protocol, bytes) in [(2, TWO), (4, FOUR)] {
            let pickle = Pickle::parse(bytes).expect("as NumPy writes it");
            let all = |key: &str| numbers(&pickle, key, 6).expect("numbers");
            assert_eq!(all("a"), [1.0, 2.0, 3.0, 4.0], "protocol {protocol}: an array");
            assert_eq!(all("f"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "protocol {protocol}: column by column, big-endian");
            assert_eq!(all("l"), [1.0, 2.5, -3.0, 7.0], "protocol {protocol}: lists, a tuple, a number of NumPy");
            let list = pickle.entry(pickle.root(), "n").expect("a list");
            let texts: Vec<_> = pickle.items(list).expect("a list").iter().map(|text| pickle.text(*text)).collect();
            assert_eq!(texts, [Some("x"), Some("y")], "protocol {protocol}: texts");
            assert_eq!(pickle.entry(pickle.root(), "none"), None, "protocol {protocol}: a key that is not there");
            for (key, most, part) in [("a", 3, "more than 3"), ("l", 3, "more than 3"), ("n", 9, "a text in place")] {
                let error = numbers(&pickle, key, most).expect_err(part);
                assert!(error.contains(part), "protocol {protocol}: {part:?} is not in: {error}");
            }
        }
    }

    #[test]
    fn other_objects_and_opcodes_are_refused_by_name_and_never_run() {
        let cases: [(&[u8], &str); 8] = [
            (b"\x80\x02cos\nsystem\n(X\x02\0\0\0lstR.", "`os system`"),
            (b"\x80\x04\x8c\x02os\x8c\x06system\x93.", "`os system`"),
            (b"\x80\x02cos\n\x1b[2Jsystem\n.", "`os \\u{1b}[2Jsystem`"),
            (b"\x80\x02(S'ls'\nios\nsystem\n.", "byte 3 of its pickle: the opcode 0x53"),
            (b"\x80\x02cnumpy\nndarray\n)R.", "a call"),
            (b"\x80\x02}}b.", "a state"),
            (b"\x80\x05N.", "protocol"),
            (b"{}", "protocol"),
        ];
        for (bytes, part) in cases {
            let error = fault(bytes);
            assert!(error.contains(part) && !error.contains('\x1b'), "{part:?} is not in: {error}");
        }
    }

    #[test]
    fn damaged_pickles_are_refused() {
        for codes in ["t.", "(.", "NR.", "q\0.", "h\x07.", "Na.", "."] {
            fault(&[&b"\x80\x02"[..], codes.as_bytes()].concat());
        }
        for whole in [TWO, FOUR] {
            for length in 0..whole.len() {
                fault(&whole[..length]);
            }
        }
        // A shape of more values than there are bytes.
        let (shape, larger) = (b"K\x02K\x02\x86", b"K\x02K\x03\x86");
        let at = FOUR.windows(shape.len()).position(|part| part == shape).expect("the shape of an array");
        let mut changed = FOUR.to_vec();
        changed[at..at + shape.len()].copy_from_slice(larger);
        let pickle = Pickle::parse(&changed).expect("the values are not read yet");
        let error = numbers(&pickle, "a", 9).expect_err("two values are missing");
        assert!(error.contains("bytes are not those of its shape"), "{error}");
    }

    #[test]
    fn nested_and_endless_lists_have_no_numbers() {
        let mut deep = b"\x80\x02N".to_vec();
        deep.extend(std::iter::repeat_n(op::TUPLE1, 500_000));
        deep.push(op::STOP);
        for bytes in [&deep[..], b"\x80\x02]q\0h\0a."] {
            let pickle = Pickle::parse(bytes).expect("a valid pickle");
            assert!(pickle.numbers(pickle.root(), 9).is_err(), "half a million tuples, or a list in itself");
        }
    }
}
