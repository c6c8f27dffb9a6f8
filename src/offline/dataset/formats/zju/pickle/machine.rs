//! The stack machine that interprets the pickle of a saved dictionary, opcode by opcode.
//!
//! In: the bytes. Out: the values, at most [`MAX_VALUES`]; an error at the first opcode, object or argument that such a
//! file does not have.

use super::op;
use super::value::{Array, Dtype, Global, Value};
use crate::codec::pickle::{Id, Stack, Tape};
use crate::codec::text::printable;

/// Most values. The largest known file has 5 million.
const MAX_VALUES: usize = 1 << 24;
/// Most axes of an array.
const MAX_AXES: usize = 8;
/// What a file that is cut has.
const ENDS: &str = "a sudden end";
/// What a pickle has that takes more values than it makes.
const LACKS: &str = "an opcode without its value";

/// The stack machine that interprets a pickle.
#[derive(Default)]
pub(super) struct Machine<'a> {
    tape: Tape<'a>,
    /// Offset of the current opcode, for messages.
    opcode_at: usize,
    pub(super) values: Vec<Value<'a>>,
    stack: Stack,
}

impl<'a> Machine<'a> {
    /// Starts at the first byte.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { tape: Tape::new(bytes), ..Self::default() }
    }

    /// Interprets one opcode. Returns the outermost value at the last opcode, else `None`.
    pub(super) fn step(&mut self) -> Result<Option<Id>, String> {
        self.opcode_at = self.tape.at();
        let code = self.byte()?;
        match code {
            op::PROTO => self.skip(1)?,
            op::FRAME => self.skip(8)?,
            op::MARK => self.stack.mark(),
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
        self.tape.take(count).ok_or_else(|| self.fault(ENDS))
    }

    fn skip(&mut self, count: usize) -> Result<(), String> {
        self.take(count).map(|_| ())
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.tape.array().ok_or_else(|| self.fault(ENDS))
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
        let line = self.tape.line().ok_or_else(|| self.fault(ENDS))?;
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

    fn top(&self) -> Result<Id, String> {
        self.stack.top().ok_or_else(|| self.fault(LACKS))
    }

    fn pop(&mut self) -> Result<Id, String> {
        self.stack.pop().ok_or_else(|| self.fault(LACKS))
    }

    fn pop_text(&mut self) -> Result<&'a str, String> {
        let id = self.pop()?;
        match *self.value(id) {
            Value::Text(text) => Ok(text),
            _ => Err(self.fault("an object whose name is no text")),
        }
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, String> {
        self.stack.pop_many(count).ok_or_else(|| self.fault(LACKS))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, String> {
        self.stack.pop_to_mark().ok_or_else(|| self.fault("an opcode without its mark"))
    }

    fn memoize(&mut self, code: u8) -> Result<(), String> {
        let index = match code {
            op::BINPUT => Some(self.byte()?.into()),
            op::LONG_BINPUT => Some(u32::from_le_bytes(self.array()?)),
            _ => None,
        };
        self.stack.memoize(index).ok_or_else(|| self.fault(LACKS))
    }

    fn recall(&mut self, code: u8) -> Result<(), String> {
        let index = if code == op::BINGET { self.byte()?.into() } else { u32::from_le_bytes(self.array()?) };
        self.stack.recall(index).ok_or_else(|| self.fault("a reference to nothing"))
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
