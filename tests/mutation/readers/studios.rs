//! The files of small folders of `PanopticSports`, `EasyVolcap` and `ZJU-MoCap`.
//!
//! In: nothing. Out: the names and the contents of the files of a folder, of which a reader changes one; for the pickle
//! of `ZJU-MoCap` a reader that changes its opcodes, too.

use super::datasets::Datasets;
use super::rigs::{Files, picture};
use super::{Outcome, Reader};
use crate::change::{bytes, pickle};
use crate::support::pth::{flag, float, int, text, tuple};
use crate::support::random::Random;
use serde_json::{Value, json};

/// Number of cameras.
const CAMERAS: usize = 3;
/// Name of the file of `ZJU-MoCap`.
const ANNOTATIONS: &str = "annots.npy";

/// Three cameras at two moments, one of them for the test.
pub fn panoptic() -> Files {
    let k = json!([[50.0, 0.0, 19.0], [0.0, 51.0, 16.0], [0.0, 0.0, 1.0]]);
    let w2c = |camera: &usize| json!([[1, 0, 0, camera], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]);
    let meta = |cameras: &[usize]| {
        let names =
            |moment: usize| cameras.iter().map(|camera| format!("{camera}/{moment:06}.jpg")).collect::<Vec<_>>();
        let matrices: Vec<Value> = cameras.iter().map(w2c).collect();
        let lenses = vec![k.clone(); cameras.len()];
        json!({
            "w": 40, "h": 30, "k": [lenses, lenses], "w2c": [matrices, matrices], "fn": [names(3), names(5)],
            "cam_id": [cameras, cameras],
        })
    };
    vec![
        ("train_meta.json", meta(&[1, 2]).to_string().into_bytes()),
        ("test_meta.json", meta(&[0]).to_string().into_bytes()),
    ]
}

/// Three cameras with a frame each, and the offsets of their clocks.
pub fn easyvolcap() -> Files {
    let names = "%YAML:1.0\n---\nnames:\n  - \"00\"\n  - \"01\"\n  - \"02\"\n";
    let matrix = |name: &str, rows: usize, columns: usize, data: &str| {
        format!("{name}: !!opencv-matrix\n  rows: {rows}\n  cols: {columns}\n  dt: d\n  data: [{data}]\n")
    };
    let lens = |camera: usize| {
        matrix(&format!("K_0{camera}"), 3, 3, "50.0, 0.0, 19.0, 0.0, 51.0, 16.0, 0.0, 0.0, 1.0")
            + &matrix(&format!("D_0{camera}"), 5, 1, "0.01, -0.01, 0.0, 0.001, 0.0")
            + &format!("H_0{camera}: 30.0\nW_0{camera}: 40.0\n")
    };
    let pose = |camera: usize| {
        matrix(&format!("R_0{camera}"), 3, 1, "0.0, 0.0, 0.0")
            + &matrix(&format!("Rot_0{camera}"), 3, 3, "1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0")
            + &matrix(&format!("T_0{camera}"), 3, 1, &format!("{camera}.0, 0.0, 3.0"))
    };
    let all = |of: &dyn Fn(usize) -> String| {
        let cameras: String = (0..CAMERAS).map(of).collect();
        format!("{names}{cameras}").into_bytes()
    };
    let frames = ["images/00/0.png", "images/01/0.png", "images/02/1.png"].map(|name| (name, picture()));
    let sync = br#"{"00": 0.01, "01": -0.02, "02": 0.0}"#.to_vec();
    let files = [("intri.yml", all(&lens)), ("extri.yml", all(&pose)), ("sync.json", sync)];
    files.into_iter().chain(frames).collect()
}

/// The reader of `annots.npy`.
pub struct Annotations {
    datasets: Datasets,
    /// The header of the array before the pickle.
    header: Vec<u8>,
    pickles: [Vec<u8>; 2],
}

impl Annotations {
    /// Makes a pickle of lists and one of arrays, and the pictures that they name.
    pub fn new() -> Self {
        let text = "{'descr': '|O', 'fortran_order': False, 'shape': (), }\n";
        let header = [&b"\x93NUMPY\x01\x00"[..], &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat();
        let pickles = [annotations(&nested), annotations(&array)];
        let whole = [header.clone(), pickles[0].clone()].concat();
        let pictures = ["a/0.png", "b/0.png", "c/0.png"].map(|name| (name, picture()));
        let files: Files = [(ANNOTATIONS, whole)].into_iter().chain(pictures).collect();
        Self { datasets: Datasets::of(ANNOTATIONS, &files), header, pickles }
    }
}

impl Reader for Annotations {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (seed, other) = (random.pick(&self.pickles), random.pick(&self.pickles));
        let changed = pickle::change(seed, other, random);
        let mut file = [&self.header[..], &changed].concat();
        if random.one_in(4) {
            bytes::change(&mut file, other, random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        self.datasets.read(bytes)
    }
}

/// Returns the pickle of a dictionary of three cameras at two moments, whose matrices are made so: of rows of so many
/// numbers.
fn annotations(matrix: &dyn Fn(usize, &[f64]) -> Vec<u8>) -> Vec<u8> {
    let of = |columns: usize, numbers: &dyn Fn(usize) -> Vec<f64>| {
        list((0..CAMERAS).map(|camera| matrix(columns, &numbers(camera))))
    };
    let cams = dictionary(&[
        ("K", of(3, &|_| vec![50.0, 0.0, 19.0, 0.0, 51.0, 16.0, 0.0, 0.0, 1.0])),
        ("D", of(1, &|_| vec![0.01, -0.01, 0.0, 0.001, 0.0])),
        ("R", of(3, &|_| vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])),
        ("T", of(1, &|camera| vec![1000.0 * camera as f64, 0.0, 3000.0])),
    ]);
    let names = |frame: &str| list(["a", "b", "c"].map(|camera| text(&format!("{camera}/{frame}.png"))));
    let moments = list(["0", "2"].map(|frame| dictionary(&[("ims", names(frame))])));
    let object = dictionary(&[("cams", cams), ("ims", moments)]);
    let whole = reconstructed(&[int(1), b")".to_vec(), dtype("O8", "|"), flag(false), list([object])]);
    [&b"\x80\x02"[..], &whole, b"."].concat()
}

/// Returns a matrix as nested lists.
fn nested(columns: usize, numbers: &[f64]) -> Vec<u8> {
    list(numbers.chunks(columns).map(|row| list(row.iter().map(|number| float(*number)))))
}

/// Returns a matrix as an array, column by column if it is no vector.
fn array(columns: usize, numbers: &[f64]) -> Vec<u8> {
    let rows = numbers.len() / columns;
    let by_columns = (0..columns).flat_map(|column| (0..rows).map(move |row| numbers[row * columns + column]));
    let characters: String = by_columns.flat_map(f64::to_le_bytes).map(char::from).collect();
    let shape = tuple(&[int(rows), int(columns)]);
    reconstructed(&[int(1), shape, dtype("f8", "<"), flag(columns > 1), encoded(&characters)])
}

/// Returns an array of this state.
fn reconstructed(state: &[Vec<u8>]) -> Vec<u8> {
    let arguments = tuple(&[b"cnumpy\nndarray\n".to_vec(), tuple(&[int(0)]), encoded("b")]);
    [&b"cnumpy.core.multiarray\n_reconstruct\n"[..], &arguments, b"R", &tuple(state), b"b"].concat()
}

fn dtype(name: &str, order: &str) -> Vec<u8> {
    let none = || b"N".to_vec();
    let arguments = tuple(&[text(name), flag(false), flag(true)]);
    let state = tuple(&[int(3), text(order), none(), none(), none(), int(0), int(0), int(0)]);
    [&b"cnumpy\ndtype\n"[..], &arguments, b"R", &state, b"b"].concat()
}

fn encoded(characters: &str) -> Vec<u8> {
    [&b"c_codecs\nencode\n"[..], &tuple(&[text(characters), text("latin1")]), b"R"].concat()
}

fn list(items: impl IntoIterator<Item = Vec<u8>>) -> Vec<u8> {
    [&b"]("[..], &items.into_iter().collect::<Vec<_>>().concat(), b"e"].concat()
}

fn dictionary(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let entries: Vec<u8> = entries.iter().flat_map(|(key, value)| [text(key), value.clone()].concat()).collect();
    [&b"}("[..], &entries, b"u"].concat()
}
