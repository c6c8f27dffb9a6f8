//! Damaged, hostile and invalid checkpoints.
//!
//! In: a small crafted checkpoint with changes. Out: proof that each is refused with an error that names the reason,
//! without a panic, and that no damaged file is read as another scene.

use crate::support::pth::{self, Pth};
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::codec::checkpoint::{self, CheckpointError};
use bevy_gs4d::scene::GaussianScene;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use std::io::Cursor;

/// Reads a checkpoint with default options.
pub fn read(bytes: &[u8]) -> Result<GaussianScene, CheckpointError> {
    checkpoint::read(Cursor::new(bytes), &ReadOptions::default(), None)
}

/// Checks that the file is refused with a message that contains all of `words`.
fn assert_refused(bytes: &[u8], words: &[&str]) {
    let message = read(bytes).expect_err("must be refused").to_string();
    assert!(words.iter().all(|word| message.contains(word)), "{words:?} in: {message}");
}

/// Returns the small checkpoint as changed by `change`.
fn changed(change: impl FnOnce(&mut Pth)) -> Vec<u8> {
    let mut pth = Pth::rotating(3, 48);
    change(&mut pth);
    pth.bytes()
}

/// Writes `value` at `offset` from every occurrence of a zip signature.
fn patch(bytes: &mut [u8], signature: &[u8; 4], offset: usize, value: &[u8]) {
    for at in 0..bytes.len() - 4 {
        if bytes[at..].starts_with(signature) {
            bytes[at + offset..][..value.len()].copy_from_slice(value);
        }
    }
}

#[test]
fn the_unchanged_checkpoint_is_read() {
    assert_eq!(read(&changed(|_| {})).expect("valid").len(), 3, "the file that the tests below change is valid");
}

#[test]
fn foreign_objects_are_refused_by_name() {
    let call = [&b"cos\nsystem\n"[..], &pth::tuple(&[pth::text("true")]), b"R"].concat();
    assert_refused(&changed(|pth| pth.slots[11] = call.clone()), &["`os system`", "refused"]);
    assert_refused(&changed(|pth| pth.slots.push(b"ctorch\nDoubleStorage\n".to_vec())), &["`torch DoubleStorage`"]);
}

#[test]
fn compressed_entries_are_refused_by_name() {
    let mut bytes = changed(|_| {});
    patch(&mut bytes, b"PK\x01\x02", 10, &[8, 0]);
    patch(&mut bytes, b"PK\x03\x04", 8, &[8, 0]);
    assert_refused(&bytes, &["archive/data.pkl", "compressed"]);
}

#[test]
fn entries_beyond_the_file_are_refused() {
    let mut bytes = changed(|_| {});
    patch(&mut bytes, b"PK\x01\x02", 20, &[0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f]);
    assert_refused(&bytes, &["archive/data.pkl", "2147483647"]);
}

#[test]
fn foreign_archives_are_refused() {
    let entry = |name: &str, bytes: &[u8]| (name.to_owned(), bytes.to_vec());
    assert_refused(b"", &["zip"]);
    assert_refused(&pth::archive(&[entry("readme.txt", b"hello")]), &["0 entries", "data.pkl"]);
    let twice = [entry("a/data.pkl", b"\x80\x02N."), entry("b/data.pkl", b"\x80\x02N.")];
    assert_refused(&pth::archive(&twice), &["2 entries", "data.pkl"]);
    let big = [entry("a/data.pkl", b"\x80\x02N."), entry("a/byteorder", b"big")];
    assert_refused(&pth::archive(&big), &["byte order", "big"]);
    let long = [entry("a/data.pkl", &b"N".repeat(2 << 20))];
    assert_refused(&pth::archive(&long), &["data.pkl", "2097152"]);
    assert_refused(&pth::archive(&[entry("a/data.pkl", b"\x80\x02N.")]), &["None", "pair"]);
    assert_refused(&pth::archive(&[entry("a/data.pkl", b"\x80\x02}.")]), &["a dictionary", "pair"]);
    assert_refused(&pth::archive(&[entry("a/data.pkl", b"\x80\x04N.")]), &["protocol 2"]);
}

#[test]
fn shapes_must_agree_with_the_number_of_gaussians() {
    assert_refused(&changed(|pth| pth.set(4, &[2, 3], vec![0.1; 6])), &["slot 4 (_scaling)", "[2, 3]", "[3, 3]"]);
    assert_refused(&changed(|pth| pth.set(1, &[9], vec![0.1; 9])), &["slot 1 (_xyz)", "[9]", "[N, 3]"]);
    assert_refused(&changed(|pth| pth.set(15, &[0], vec![])), &["slot 15 (_rotation_r)", "[0]", "[3, 4]"]);
    assert_refused(&changed(|pth| pth.set(3, &[3, 99, 3], vec![0.1; 891])), &["slot 3", "[3, 99, 3]", "48"]);
    assert_refused(&changed(|pth| pth.set(17, &[3, 2, 4], vec![0.1; 24])), &["slot 17 (env_map)", "[3, 2, 4]"]);
    assert_refused(&changed(|pth| pth.slots[5] = pth::int(4)), &["slot 5 (_rotation)", "an int", "a tensor"]);
    assert_refused(&changed(|pth| pth.slots[18] = pth::int(3)), &["slot 18", "is 3"]);
    assert_refused(&changed(|pth| pth.slots.truncate(11)), &["11 entries"]);
}

#[test]
fn tensors_must_lie_within_their_storage() {
    let view = |count, offset, size: &[usize], stride: &[usize]| {
        changed(|pth| {
            pth.slots[1] = pth::tensor(0, count, offset, size, stride);
        })
    };
    assert_refused(&view(9, 1, &[3, 3], &[3, 1]), &["slot 1 (_xyz)", "beyond the end"]);
    assert_refused(&view(9, 0, &[3, 3], &[4, 1]), &["slot 1 (_xyz)", "beyond the end"]);
    assert_refused(&view(900, 0, &[300, 3], &[3, 1]), &["slot 1 (_xyz)", "900 values", "36 bytes"]);
    assert_refused(&view(9, 0, &[1 << 30, 3], &[0, 0]), &["slot 1 (_xyz)", "more values"]);
    let missing = changed(|pth| pth.slots[1] = pth::tensor(77, 9, 0, &[3, 3], &[3, 1]));
    assert_refused(&missing, &["slot 1 (_xyz)", "data/77", "missing"]);
}

#[test]
fn values_must_be_finite() {
    for poison in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_refused(&changed(|pth| pth.storages[0][4] = poison), &["Gaussian 1", "_xyz", "not finite"]);
        assert_refused(&changed(|pth| pth.storages[5][2] = poison), &["Gaussian 2", "_opacity", "not finite"]);
        assert_refused(&changed(|pth| pth.storages[2][141] = poison), &["Gaussian 1", "_features_rest", "not finite"]);
        assert_refused(&changed(|pth| pth.set(17, &[3, 1, 1], vec![0.0, 0.0, poison])), &["channel 2", "env_map"]);
    }
    for poison in [f64::NAN, f64::INFINITY, -1.0] {
        assert_refused(&changed(|pth| pth.slots[12] = pth::float(poison)), &["slot 12 (spatial_lr_scale)"]);
    }
}

#[test]
fn quaternions_must_have_a_direction() {
    assert_refused(&changed(|pth| pth.storages[4][4..8].fill(0.0)), &["Gaussian 1", "length zero", "_rotation"]);
    assert_refused(&changed(|pth| pth.storages[8][8..].fill(0.0)), &["Gaussian 2", "length zero", "_rotation_r"]);
}

#[test]
fn damaged_values_do_not_match_their_checksum() {
    let mut bytes = changed(|_| {});
    let value = Pth::rotating(3, 48).storages[2][7].to_le_bytes();
    let at = bytes.windows(4).position(|window| window == value).expect("the value is in the file");
    bytes[at] ^= 1;
    assert_refused(&bytes, &["checksum"]);
}

/// The opcodes that the unpickler supports.
const OPCODES: &[u8] = b"\x80(.N\x88\x89JKMGX)t\x85\x86\x87]ae}ucRbQqrhj";

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn truncated_files_are_refused(cut in any::<Index>()) {
        let bytes = changed(|_| {});
        prop_assert!(read(&bytes[..cut.index(bytes.len())]).is_err(), "a truncated file is not a checkpoint");
    }

    #[test]
    fn flipped_bits_never_change_the_scene(flips in vec((any::<Index>(), 0..8), 1..4)) {
        let mut bytes = changed(|_| {});
        let whole = read(&bytes).expect("valid");
        for (at, bit) in flips {
            let at = at.index(bytes.len());
            bytes[at] ^= 1u8 << bit;
        }
        // Some bytes are never read: time stamps, the version.
        if let Ok(scene) = read(&bytes) {
            prop_assert!(scene == whole, "a damaged file is read as the same scene or refused");
        }
    }

    #[test]
    fn changed_pickles_give_consistent_scenes_or_errors(changes in vec((any::<Index>(), any::<u8>()), 1..5)) {
        let pth = Pth::rotating(3, 48);
        let mut pickle = pth.pickle();
        for (at, byte) in changes {
            let at = at.index(pickle.len());
            pickle[at] = byte;
        }
        if let Ok(scene) = read(&pth.bytes_with(&pickle)) {
            let fits = scene.form.harmonics().is_some_and(|harmonics| harmonics.is_consistent(scene.len()));
            prop_assert!(fits, "every Gaussian has a color");
        }
    }

    #[test]
    fn random_pickles_are_refused(program in vec(prop_oneof![select(OPCODES), any::<u8>()], 0..300)) {
        let pickle = [&b"\x80\x02"[..], &program].concat();
        let bytes = Pth::rotating(1, 48).bytes_with(&pickle);
        prop_assert!(read(&bytes).is_err(), "random opcodes are no checkpoint");
    }
}
