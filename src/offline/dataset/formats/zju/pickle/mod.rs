//! A restricted unpickler for dictionaries that NumPy has saved.
//!
//! In: the bytes of a pickle of protocol 2 to 4, as `numpy.save` writes it for an object. Out: a [`Pickle`]:
//! dictionaries, lists, texts, numbers and arrays of numbers, read one by one.
//!
//! Only the opcodes and objects of such files are accepted; everything else is refused by name, and nothing is ever
//! executed. Every step adds at most one value of a fixed size, values refer to each other by index (so nothing
//! recurses), and the bytes of arrays stay in the file until their numbers are asked for: time and memory are bounded
//! by the length of the input, and by the number of numbers asked for. The unpickler of checkpoints
//! (`codec::checkpoint`) is another one, which shares `codec::pickle` with this one: theirs have protocol 2, and tensors
//! whose values are in other files.

mod machine;
mod op;
mod value;

pub(super) use crate::codec::pickle::Id;

use machine::Machine;
use std::borrow::Cow;
use value::{Array, Kind, Value};

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
        let mut machine = Machine::new(bytes);
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
