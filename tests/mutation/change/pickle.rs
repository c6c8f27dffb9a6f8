//! Changes to pickles, opcode by opcode.
//!
//! In: a pickle of protocol 2, that of another seed. Out: a pickle whose opcodes mostly have complete arguments, in a
//! meaningless order.

use super::{bytes, change_list, numbers};
use crate::support::pth;
use crate::support::random::Random;

/// Makes one to four changes.
pub fn change(pickle: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let (mut changed, other) = (opcodes(pickle), opcodes(other));
    for _ in 0..=random.below(4) {
        change_once(&mut changed, &other, random);
    }
    let mut pickle = changed.concat();
    if random.one_in(16) {
        bytes::change(&mut pickle, &other.concat(), random);
    }
    pickle
}

fn change_once(opcodes: &mut Vec<Vec<u8>>, others: &[Vec<u8>], random: &mut Random) {
    let kinds: &[u8] = match random.below(8) {
        0..=3 => b"JKM",
        4 => b"G",
        5 => b"X",
        6 => b"c",
        _ => b"",
    };
    let of_kind: Vec<usize> = (0..opcodes.len()).filter(|&at| kinds.contains(&opcodes[at][0])).collect();
    if of_kind.is_empty() {
        match random.below(4) {
            0 => {
                let at = random.below(opcodes.len());
                opcodes.insert(at, any(random));
            }
            1 => {
                // Deep nesting, or a deep stack.
                let code = *random.pick(b"(\x85]N)");
                opcodes.insert(random.below(opcodes.len()), vec![code; *random.pick(&[1, 100, 100_000, 900_000])]);
            }
            _ => change_list(opcodes, others, random),
        }
        return;
    }
    let at = *random.pick(&of_kind);
    opcodes[at] = match opcodes[at][0] {
        b'G' => pth::float(f64::from(numbers::float(random))),
        b'X' => text(random),
        b'c' => global(random),
        _ => int(random),
    };
}

/// Returns an opcode for a whole number.
fn int(random: &mut Random) -> Vec<u8> {
    let whole = numbers::whole(random);
    match random.below(4) {
        0 => vec![b'K', whole as u8],
        1 => [&b"M"[..], &(whole as u16).to_le_bytes()].concat(),
        _ => [&b"J"[..], &(whole as i32).to_le_bytes()].concat(),
    }
}

/// Returns an opcode for a text: the key of a storage, a byte order, something else.
fn text(random: &mut Random) -> Vec<u8> {
    const TEXTS: [&str; 14] =
        ["0", "1", "2", "8", "999", "", "storage", "<", ">", "f4", "f8", "latin1", "\u{1b}[2J", "../0"];
    let mut opcode = match random.below(8) {
        0 => pth::text(&"0".repeat(*random.pick(&[17, 300, 1 << 16]))),
        _ => pth::text(random.pick::<&str>(&TEXTS)),
    };
    if random.one_in(8) {
        // A length that is not that of the text.
        let length = (numbers::whole(random) as u32).to_le_bytes();
        opcode[1..5].copy_from_slice(&length);
    }
    opcode
}

/// Returns an opcode that names an object.
fn global(random: &mut Random) -> Vec<u8> {
    let names = [
        "torch._utils\n_rebuild_parameter",
        "torch._utils\n_rebuild_tensor_v2",
        "torch\nFloatStorage",
        "torch\nDoubleStorage",
        "collections\nOrderedDict",
        "numpy._core.multiarray\nscalar",
        "numpy\ndtype",
        "_codecs\nencode",
        "os\nsystem",
        "\u{1b}[2J\nb",
    ];
    format!("c{}\n", random.pick(&names)).into_bytes()
}

/// Returns any opcode that checkpoints have.
fn any(random: &mut Random) -> Vec<u8> {
    match random.below(5) {
        0 => int(random),
        1 => text(random),
        2 => global(random),
        3 => {
            let code = *random.pick(b"qh");
            vec![code, random.bits() as u8]
        }
        _ => vec![*random.pick(b"(.N\x88\x89)t\x85\x86\x87]ae}uRbQ")],
    }
}

/// Cuts a pickle into opcodes with their arguments.
fn opcodes(mut pickle: &[u8]) -> Vec<Vec<u8>> {
    let mut opcodes = Vec::new();
    while let Some(&code) = pickle.first() {
        let line = |from: usize| {
            let end = pickle.iter().skip(from).position(|&byte| byte == b'\n');
            end.map_or(pickle.len(), |at| from + at + 1)
        };
        let length = match code {
            0x80 | b'K' | b'q' | b'h' => 2,
            b'M' => 3,
            b'J' | b'r' | b'j' => 5,
            b'G' => 9,
            b'X' => 5 + pickle.get(1..5).map_or(0, |l| u32::from_le_bytes([l[0], l[1], l[2], l[3]]) as usize),
            b'c' => line(line(1)),
            _ => 1,
        };
        let (opcode, rest) = pickle.split_at(length.min(pickle.len()));
        opcodes.push(opcode.to_vec());
        pickle = rest;
    }
    opcodes
}
