//! Captures in chunk files on the GPU: files in pages that come and go.
//!
//! In: synthetic scenes of each form and with each kind of filter, cut into files. Out: proof that the files have the
//! picture of the whole scene bit for bit, in whichever order they come, after others had their pages and after the pages
//! have moved; errors for files of other captures. Skipped where there is no GPU.

use crate::support::gpu;
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::renderer::{ChunkFiles, FileUpload, GpuCapture, GpuContext, GpuError, Headless};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{
    ActiveSets, ChunkFile, ChunkTable, Form, GaussianScene, PackedColors, PackedScene, Packing, RuntimeScene, Sliced,
    TemporalFilter,
};
use bevy_gs4d::view::{Background, Camera, Frame, RasterFov, View};
use glam::{UVec2, Vec3};
use std::ops::Range;
use std::sync::Arc;

const COUNT: usize = 5000;
const BLACK: Background = Background::Color([0.0; 3]);
/// Ends of files: whole blocks, as packed scenes are cut.
const ENDS: [usize; 6] = [256, 1280, 1536, 3072, 4608, COUNT];

fn scene() -> RuntimeScene {
    let settings = SynthSettings { count: COUNT, seed: 4, degree: 1, ..SynthSettings::default() };
    synthesize(&settings).into_runtime().expect("synthetic scenes are valid")
}

fn with_filter(scene: &RuntimeScene, segments: u32, as_bits: bool) -> RuntimeScene {
    let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
    let filter = TemporalFilter::support(scene.iter(), interval, cutoff, segments);
    let sets = match as_bits {
        true => ActiveSets::Bits(filter.to_bits()),
        false => filter.sets.clone(),
    };
    assert_eq!(matches!(sets, ActiveSets::Bits(_)), as_bits, "{segments} segments are stored as asked for");
    RuntimeScene { filter: Some(TemporalFilter { sets, ..filter }), ..scene.clone() }
}

/// Returns some Gaussians of a scene, without filter.
fn cut(scene: &RuntimeScene, own: Range<usize>) -> RuntimeScene {
    let harmonics = |all: &Harmonics| {
        let stride = all.values.len() / COUNT;
        Harmonics { values: all.values[own.start * stride..own.end * stride].to_vec(), ..all.clone() }
    };
    let form = match &scene.form {
        Form::Sliced(sliced) => Form::Sliced(Sliced {
            gaussians: sliced.gaussians[own.clone()].to_vec(),
            harmonics: harmonics(&sliced.harmonics),
        }),
        Form::Packed(packed) => {
            let PackedColors::Whole(colors) = &packed.colors else { panic!("colors without codebooks") };
            let blocks = 3 + 2 * (own.start / 256)..3 + 2 * own.end.div_ceil(256);
            Form::Packed(PackedScene {
                records: packed.records[own.clone()].to_vec(),
                ranges: [&packed.ranges[..3], &packed.ranges[blocks]].concat(),
                colors: PackedColors::Whole(harmonics(colors)),
                layers: Vec::new(),
                runs: None,
            })
        }
    };
    RuntimeScene { form, filter: None, ..scene.clone() }
}

/// A capture in chunk files, not yet on the GPU.
struct Files {
    whole: RuntimeScene,
    index: RuntimeScene,
    files: Vec<Arc<RuntimeScene>>,
    table: Arc<ChunkTable>,
}

impl Files {
    fn of(whole: RuntimeScene) -> Self {
        let starts = [0].into_iter().chain(ENDS);
        let file = |own: Range<usize>| {
            let keep: Vec<u32> = (own.start as u32..own.end as u32).collect();
            let filter = whole.filter.as_ref().map(|filter| filter.select(&keep));
            Arc::new(RuntimeScene { filter, ..cut(&whole, own) })
        };
        let files: Vec<Arc<RuntimeScene>> = starts.zip(ENDS).map(|(start, end)| file(start..end)).collect();
        let row = |file: &Arc<RuntimeScene>| ChunkFile {
            stretches: [0, 3],
            layer: 0,
            gaussians: file.len() as u64,
            bytes: 1,
        };
        let gaussian_bytes = GaussianScene::from(whole.clone()).gaussian_bytes();
        let table = ChunkTable {
            stretches: 4,
            gaussian_bytes,
            files: files.iter().map(row).collect(),
            utilities: Vec::new(),
            first_byte: None,
        };
        Self { index: cut(&whole, 0..0), whole, files, table: table.into() }
    }

    /// Returns the bytes of a number of pages.
    fn bytes(&self, pages: u64) -> u64 {
        pages * ChunkTable::PAGE * u64::from(self.table.gaussian_bytes)
    }

    /// Returns the capture with its pages, without files.
    fn open(&self, headless: &Headless, pages: u64) -> Result<GpuCapture, GpuError> {
        let GpuContext { device, queue, .. } = headless.context();
        let mut capture = headless.upload(&self.index)?;
        let files = ChunkFiles { table: &self.table, index: Some(&self.index), first: &self.files[0] };
        capture.open_pages(device, queue, headless.renderer(), files, self.bytes(pages))?;
        Ok(capture)
    }

    /// Uploads a file in small steps.
    fn add(&self, headless: &Headless, capture: &mut GpuCapture, file: usize) -> Result<(), GpuError> {
        let mut upload = FileUpload::new(capture, file, self.files[file].clone())?;
        let before = capture.len();
        while !upload.is_complete(capture) {
            assert_eq!(capture.len(), before, "file {file} is drawn once it is complete");
            let written = upload.advance(&headless.context().queue, headless.renderer(), capture, 30_000)?;
            assert!(written > 0, "every step uploads something");
        }
        assert_eq!(capture.len(), before + self.files[file].len(), "file {file} is drawn");
        Ok(())
    }
}

fn view(time: f32) -> View {
    let eye = Vec3::new(2.0, -1.5, 1.2);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(90, 61)).view(time, RasterFov::Reference)
}

fn bits_of(frame: &Frame) -> Vec<u32> {
    let colors = frame.picture.pixels.iter().flat_map(|p| p.to_array());
    colors.chain(frame.transmittance.iter().copied()).chain(frame.depth.iter().copied()).map(f32::to_bits).collect()
}

/// Checks that two captures have the same pictures.
fn check(headless: &mut Headless, found: &GpuCapture, expected: &GpuCapture, what: &str) {
    for time in [0.0, 0.27, 0.5, 0.93, 1.0] {
        let [found, expected] =
            [found, expected].map(|capture| headless.render(capture, &view(time), BLACK).expect("the view is drawn"));
        assert_eq!(found.counts, expected.counts, "{what}, at {time}: the numbers of splats and pairs");
        assert!(bits_of(&found) == bits_of(&expected), "{what}, at {time}: the picture is the same bit for bit");
    }
}

#[test]
fn files_in_pages_have_the_picture_of_the_whole_capture() {
    let Some(mut headless) = gpu::headless() else { return };
    let sliced = scene();
    let packed = sliced.clone().pack(&Packing::default()).expect("the scene can be packed");
    let scenes = [
        ("sliced, no filter", sliced.clone()),
        ("sliced, intervals", with_filter(&sliced, 40, false)),
        ("packed, bits", with_filter(&packed, 9, true)),
        ("packed, intervals", with_filter(&packed, 40, false)),
    ];
    for (what, scene) in scenes {
        let files = Files::of(scene);
        let whole = headless.upload(&files.whole).expect("the scene fits the GPU");
        // Two pages more than the files need.
        let mut capture = files.open(&headless, 22).expect("the pages fit the GPU");
        assert_eq!(capture.paged_bytes(), Some(files.bytes(20)), "{what}: no more pages than the files need");
        for file in [3, 0, 5, 1, 4, 2] {
            files.add(&headless, &mut capture, file).expect("a file of the capture");
        }
        check(&mut headless, &capture, &whole, what);
        // Files change places: each takes pages that others had.
        for file in [3, 1, 0] {
            capture.remove_file(file);
        }
        let few = headless.render(&capture, &view(0.5), BLACK).expect("the view is drawn").counts.visible;
        let all = headless.render(&whole, &view(0.5), BLACK).expect("the view is drawn").counts.visible;
        assert!(few < all, "{what}: {few} of {all} splats without three files");
        for file in [0, 1, 3] {
            files.add(&headless, &mut capture, file).expect("a file of the capture");
        }
        check(&mut headless, &capture, &whole, &format!("{what}, in other pages"));
    }
}

#[test]
fn pages_that_are_made_anew_keep_the_files() {
    let Some(mut headless) = gpu::headless() else { return };
    let packed = scene().pack(&Packing::default()).expect("the scene can be packed");
    for scene in [with_filter(&scene(), 9, true), packed] {
        let mut files = Files::of(scene);
        let whole = headless.upload(&files.whole).expect("the scene fits the GPU");
        // The table has more files than are there.
        let extra = ChunkFile { gaussians: 10_000, ..files.table.files[0] };
        Arc::make_mut(&mut files.table).files.push(extra);
        let mut capture = files.open(&headless, 23).expect("the pages fit the GPU");
        let (device, queue) = (headless.context().device.clone(), headless.context().queue.clone());
        let resize = |headless: &Headless, capture: &mut GpuCapture, pages: u64| {
            let resized = capture.resize_pages(&device, &queue, headless.renderer(), files.bytes(pages));
            (resized.expect("the pages fit the GPU"), capture.paged_bytes().expect("pages") / files.bytes(1))
        };
        for file in [5, 4, 3, 2, 1, 0] {
            files.add(&headless, &mut capture, file).expect("a file of the capture");
        }
        assert_eq!(resize(&headless, &mut capture, 23), (false, 23), "as many pages");
        assert_eq!(resize(&headless, &mut capture, 19), (false, 23), "too few for the files");
        for (pages, expected) in [(40, 40), (20, 20), (1000, 60)] {
            assert_eq!(resize(&headless, &mut capture, pages), (true, expected), "at most those of all files");
            check(&mut headless, &capture, &whole, &format!("in {expected} pages"));
        }
        let bytes = capture.bytes();
        let mut other = headless.upload(&files.index).expect("the index fits the GPU");
        other.take_pages(&mut capture);
        assert_eq!((other.bytes(), other.len()), (bytes, COUNT), "another upload of the index takes over the pages");
        assert_eq!((capture.paged_bytes(), capture.len()), (None, 0), "this one has none");
        check(&mut headless, &other, &whole, "taken over");
    }
}

#[test]
fn files_of_other_captures_are_refused() {
    let Some(headless) = gpu::headless() else { return };
    let files = Files::of(scene().pack(&Packing::default()).expect("the scene can be packed"));
    let mut capture = files.open(&headless, 6).expect("the pages fit the GPU");
    let add = |capture: &mut GpuCapture, number: usize, scene: &RuntimeScene| {
        FileUpload::new(capture, number, scene).map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(capture.has_room(6 * 256) && !capture.has_room(6 * 256 + 1), "six pages");
    let refused = |result: Result<(), String>, words: &str| {
        let error = result.expect_err(words);
        assert!(error.contains(words), "{error}, expected {words}");
    };
    refused(add(&mut capture, 0, &files.files[1]), "more Gaussians than the index");
    refused(add(&mut capture, 9, &files.files[0]), "more Gaussians than the index");
    let mut ranges = (*files.files[0]).clone();
    if let Form::Packed(packed) = &mut ranges.form {
        packed.ranges[0][1] *= 2.0;
    }
    refused(add(&mut capture, 0, &ranges), "not those of the other chunk files");
    let mut settings = (*files.files[0]).clone();
    settings.trained_with.marginal_cutoff *= 0.5;
    refused(add(&mut capture, 0, &settings), "not those of the other chunk files");
    add(&mut capture, 1, &files.files[1]).expect("four pages");
    refused(add(&mut capture, 3, &files.files[3]), "too few pages");
    capture.remove_file(1);
    add(&mut capture, 3, &files.files[3]).expect("six pages");
    let mut other = headless.upload(&files.index).expect("the index fits the GPU");
    refused(add(&mut other, 0, &files.files[0]), "no pages");

    let open = |index: &RuntimeScene, gaussian_bytes: u32| {
        let GpuContext { device, queue, .. } = headless.context();
        let table = Arc::new(ChunkTable { gaussian_bytes, ..(*files.table).clone() });
        let opened = ChunkFiles { table: &table, index: Some(index), first: &files.files[0] };
        let mut capture = headless.upload(index).expect("the index fits the GPU");
        capture.open_pages(device, queue, headless.renderer(), opened, 1 << 20).map_err(|error| error.to_string())
    };
    let bytes = files.table.gaussian_bytes;
    refused(open(&files.index, bytes / 2), "more bytes than the index");
    refused(open(&cut(&scene(), 0..0), bytes), "not those of the index");
    open(&files.index, bytes).expect("the index of the files");
}
