//! A restricted unpickler for `data.pkl`.
//!
//! In: the bytes of a protocol 2 pickle. Out: a [`Pickle`], a flat arena of values in which tensors are lazy: they
//! contain the location of their values only.
//!
//! Only the opcodes and objects that `torch.save` writes for checkpoints of the trainer are accepted; everything else
//! is refused by name, and nothing is ever executed. In the files of other trainers, further objects and the results of
//! calls are kept as names ([`Value::Inert`]). Every step adds at most one value, values refer to each other by index
//! (so nothing recurses), and no value is copied: time and memory are bounded by the length of the input.

mod machine;
mod op;
mod value;

pub(super) use crate::codec::pickle::Id;
pub(super) use value::Value;

use super::error::CheckpointError;
use machine::Machine;
use std::collections::HashMap;

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
        Self::run(bytes, false)
    }

    /// Parses a pickle of another program: objects that no checkpoint of the trainer contains are kept as their names.
    ///
    /// # Errors
    /// The first opcode that `torch.save` does not write; a pickle that is cut.
    pub(super) fn parse_inert(bytes: &'a [u8]) -> Result<Self, CheckpointError> {
        Self::run(bytes, true)
    }

    fn run(bytes: &'a [u8], is_inert: bool) -> Result<Self, CheckpointError> {
        let mut machine = Machine::new(bytes, is_inert);
        if !bytes.starts_with(&[op::PROTO, 2]) {
            return Err(machine.error(
                "not a pickle of protocol 2, which torch.save writes unless it is told otherwise; save it again with \
                 torch.save(torch.load(path, map_location=\"cpu\", weights_only=False), path)",
            ));
        }
        loop {
            if let Some(root) = machine.step()? {
                let length = machine.length();
                let Machine { values, sizes, .. } = machine;
                return Ok(Self { values, root, length, sizes });
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
