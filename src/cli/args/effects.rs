//! When options have an effect: one table for all verbs.
//!
//! In: what an input or the other options lack. Out: the options that have no effect without it, and why.
//! [`Given::require`](super::Given::require) refuses these options. Rules about two options that hold for all of their
//! values are clap's (`conflicts_with`, `requires`). `tests/cli/options.rs` checks every option of every verb: it
//! always has an effect, or is refused where it has none.

/// What some options need to have an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Need {
    // Of a capture that is read.
    /// A file that counts frames and leaves their rate open.
    FrameRate,
    /// No duration beside the rate of frames.
    OpenDuration,
    /// Paths that are curved in the file.
    CurvedPaths,
    /// Native 4D rotations, whose convention is open if the file does not have it.
    NativeRotations,
    /// A file of the 4DGS trainer, or a package of one.
    Trainer,
    /// A capture, and not a dataset.
    Capture,
    /// A trained capture, and not pictures that one is trained from.
    Trained,
    /// The folder of a dataset, and not a capture.
    Dataset,
    /// Pictures that a capture is trained from.
    Pictures,
    /// A temporal filter.
    Filter,
    /// A temporal filter that depends on what views see.
    SeenFilter,
    /// Gaussians in the packed form.
    Packed,
    /// Native 4D Gaussians, which move.
    Motion,
    /// No environment map.
    OpenBackground,
    /// An edit that asks what the training cameras see.
    Cameras,
    // Of the result.
    /// A result that is played, or has a duration.
    Playback,
    /// A result that has a background.
    Background,
    /// Views on an orbit, or a package.
    UpAxis,
    /// All Gaussians, and no level of detail.
    AllGaussians,
    /// Files of one time each.
    OneTime,
    /// Work that is not divided into shards, or the merge of its shards.
    Whole,
    /// The computation itself, and not only the parts of its shards.
    Work,
    /// Pictures that are written.
    WrittenPictures,
    // Of the engine.
    /// An engine that may be a GPU.
    Gpu,
    /// An engine that is a GPU.
    FoundGpu,
    // Of scores and filters.
    /// A score that uses the volume.
    VolumeScore,
    /// A weight of the volume in the score.
    VolumeWeight,
    /// A comparison of scores.
    ComparedScores,
    /// A comparison of pictures, to prune by.
    ComparedPictures,
    /// Views that are drawn, to prune by.
    PrunedViews,
    /// A filter that depends on what views see.
    FilteredViews,
    /// Views whose times determine the key-frames.
    KeyFrameViews,
    /// Validation views that are divided from the training views.
    DividedViews,
    // Of compression.
    /// Views that are compared with the original.
    VerifiedViews,
    /// Layers of chunk files that are measured.
    MeasuredLayers,
    /// A quality that changes values.
    Quantized,
    /// A quality that changes the order of the Gaussians.
    Layers,
    /// A result that is compressed.
    Compressed,
    /// A capture that has not been cut into chunks when it was compressed.
    Uncut,
    /// Colors that are not coded.
    WholeColors,
    /// Colors that are coded.
    Codebooks,
    /// Codebooks that are trained.
    TrainedCodebooks,
    /// Colors that depend on time.
    ColorInTime,
    /// Raw pictures, which do not have their size.
    RawPictures,
    // Of training.
    /// Validation views, by which evaluations are compared.
    ValidationViews,
    /// Images with gaps: transparent pixels or masks.
    Gaps,
    /// Relocation and noise.
    Relocation,
    /// A fixed number of Gaussians.
    FixedNumber,
    /// A start at points.
    StartAtPoints,
    /// Steps after which the capture is checked.
    CheckedSteps,
    /// Degrees of color that are raised.
    Degrees,
    /// Gaussians that are trained after they are pruned.
    Tuning,
    // Of many machines.
    /// A score in shards.
    Shards,
    /// The stage score.
    ScoreStage,
}

/// The options that have no effect without what they need.
#[derive(Debug)]
pub(crate) struct Rule {
    /// The need of the options.
    pub need: Need,
    /// The options (`--name`). A verb that states the need has some of them.
    pub options: &'static [&'static str],
    /// Completes the sentence "OPTION has no effect ..." and names what would give it one, unless that is obvious.
    pub reason: &'static str,
}

/// The options of [`CheckpointArgs`](super::CheckpointArgs) that have no effect on captures trained from pictures.
const OF_TRAINED: &[&str] = &[
    "--rotation-convention",
    "--raster-fov",
    "--trained-cameras",
    "--sh-direction",
    "--force-sh-3d",
    "--prefilter-var",
    "--up",
    "--cutoff",
    "--fps",
    "--tolerance",
];
/// The other options of [`CheckpointArgs`](super::CheckpointArgs).
const OF_BOTH: &[&str] = &["--time-interval", "--background", "--duration"];
/// The options that have an effect only on a GPU, of verbs that choose an engine.
const OF_GPU: &[&str] = &["--adapter", "--checks", "--renderer", "--steps", "--batch", "--rounds", "--exposure"];

/// Every option that does not always have an effect.
pub(crate) const RULES: &[Rule] = &[
    Rule {
        need: Need::FrameRate,
        options: &["--fps"],
        reason: "on this capture: it is for sequences of files, and for formats that count frames and do not have a duration",
    },
    Rule {
        need: Need::OpenDuration,
        options: &["--fps"],
        reason: "with --duration, which already says how long the frames are played",
    },
    Rule {
        need: Need::CurvedPaths,
        options: &["--tolerance"],
        reason: "on this capture: it is for formats with curved paths, which become straight pieces",
    },
    Rule {
        need: Need::NativeRotations,
        options: &["--rotation-convention"],
        reason: "on this capture: it is for native 4D rotations, which checkpoints and PLY files of them have",
    },
    Rule {
        need: Need::Trainer,
        options: &["--force-sh-3d", "--prefilter-var"],
        reason: "on a file of another make: it is for checkpoints of the 4DGS trainer",
    },
    Rule { need: Need::Capture, options: OF_BOTH, reason: "on a dataset: it is for captures" },
    Rule { need: Need::Capture, options: OF_TRAINED, reason: "on a dataset: it is for captures" },
    Rule { need: Need::Trained, options: OF_TRAINED, reason: "with a dataset: it is for checkpoints" },
    Rule {
        need: Need::Dataset,
        options: &["--cameras", "--static"],
        reason: "on a capture: it is for the folder of a dataset",
    },
    Rule {
        need: Need::Pictures,
        options: &["--gaussians", "--train-steps", "--environment"],
        reason: "with a checkpoint: it is for training from pictures",
    },
    Rule {
        need: Need::Filter,
        options: &["--no-filter", "--filter"],
        reason: "on a capture without a temporal filter, which gs4d mask adds",
    },
    Rule {
        need: Need::SeenFilter,
        options: &["--refresh-filter"],
        reason: "on a scene without a temporal filter of the kind key-frame or interval",
    },
    Rule {
        need: Need::Packed,
        options: &["--form"],
        reason: "on a capture that is not packed, which gs4d compress does",
    },
    Rule {
        need: Need::Motion,
        options: &["--motion-weight", "--rigid-weight"],
        reason: "on a capture at rest: only native 4D Gaussians, with both rotations, move",
    },
    Rule {
        need: Need::OpenBackground,
        options: &["--behind"],
        reason: "on a capture with an environment map, which is behind all images",
    },
    Rule {
        need: Need::Cameras,
        options: &["--data", "--size", "--resolution", "--static"],
        reason: "on a list of edits without remove_floaters, which alone asks what cameras see",
    },
    Rule {
        need: Need::Playback,
        options: &["--duration"],
        reason: "on the result of this verb, which is not played: packages keep a duration, and sequences and formats with motion have one",
    },
    Rule {
        need: Need::Background,
        options: &["--background"],
        reason: "on the result of this verb, which has no background: pictures have one, and packages keep it",
    },
    Rule {
        need: Need::UpAxis,
        options: &["--up"],
        reason: "on the views of a dataset or a camera file: an orbit turns about the axis, and packages keep it",
    },
    Rule {
        need: Need::AllGaussians,
        options: &["--antialias"],
        reason: "with --level: levels of detail are anti-aliased in any case",
    },
    Rule {
        need: Need::OneTime,
        options: &["--time", "--sequence"],
        reason: "on a format with motion, whose file has all times",
    },
    Rule {
        need: Need::Whole,
        options: &["--ratio", "--trust-images", "--gain", "--level"],
        reason: "with --shard: give it with --merge",
    },
    Rule {
        need: Need::Work,
        options: &[
            "--data",
            "--size",
            "--resolution",
            "--static",
            "--views",
            "--volume-power",
            "--volume-rank",
            "--engine",
            "--adapter",
            "--checks",
        ],
        reason: "on parts alone: it is checked if the CHECKPOINT is given, too",
    },
    Rule {
        need: Need::Work,
        options: OF_TRAINED,
        reason: "on parts alone: it is checked if the CHECKPOINT is given, too",
    },
    Rule {
        need: Need::Work,
        options: OF_BOTH,
        reason: "on parts alone: it is checked if the CHECKPOINT is given, too",
    },
    Rule {
        need: Need::WrittenPictures,
        options: &["--out", "--gain"],
        reason: "with --merge, which draws no pictures",
    },
    Rule { need: Need::Gpu, options: OF_GPU, reason: "with --engine cpu" },
    Rule {
        need: Need::FoundGpu,
        options: OF_GPU,
        reason: "on the CPU, which --engine auto takes here (--engine gpu takes a software driver)",
    },
    Rule {
        need: Need::VolumeScore,
        options: &["--volume-power", "--volume-rank"],
        reason: "on scores that do not use the volume",
    },
    Rule { need: Need::VolumeWeight, options: &["--volume-rank"], reason: "with --volume-power 0" },
    Rule {
        need: Need::ComparedScores,
        options: &["--ratio", "--validation", "--trust-images"],
        reason: "without --variant auto, which alone compares scores",
    },
    Rule {
        need: Need::PrunedViews,
        options: &[
            "--data",
            "--size",
            "--resolution",
            "--static",
            "--engine",
            "--adapter",
            "--checks",
            "--validation",
            "--trust-images",
        ],
        reason: "with --scores unless --max-loss is given: no view is drawn",
    },
    Rule {
        need: Need::ComparedPictures,
        options: &["--validation", "--trust-images"],
        reason: "without --max-loss or --variant auto: no pictures are compared",
    },
    Rule {
        need: Need::FilteredViews,
        options: &["--size", "--resolution", "--engine", "--adapter", "--checks", "--shard", "--merge"],
        reason: "with --filter support: no view is drawn",
    },
    Rule {
        need: Need::KeyFrameViews,
        options: &["--data", "--static"],
        reason: "with --filter support unless --every is given",
    },
    Rule {
        need: Need::DividedViews,
        options: &["--validation"],
        reason: "with a --split of the dataset: the views that are scored are not divided",
    },
    Rule {
        need: Need::VerifiedViews,
        options: &["--cameras", "--orbit", "--time", "--size", "--resolution", "--engine", "--adapter", "--checks"],
        reason: "with --verify 0: no view is drawn",
    },
    Rule {
        need: Need::MeasuredLayers,
        options: &["--validation", "--trust-images", "--engine", "--adapter", "--checks"],
        reason: "without --data: no layer is measured",
    },
    Rule {
        need: Need::Quantized,
        options: &[
            "--mean-bits",
            "--mean-t-bits",
            "--velocity-bits",
            "--sigma-t-bits",
            "--scale-bits",
            "--rotation-bits",
            "--opacity-bits",
            "--escape",
            "--codebooks",
            "--base-bits",
            "--weights",
            "--color-step",
        ],
        reason: "with --quality lossless, which changes no value",
    },
    Rule {
        need: Need::Layers,
        options: &["--progressive", "--chunk"],
        reason: "with the quality lossless, which keeps the order of the Gaussians",
    },
    Rule { need: Need::Compressed, options: &["--progressive", "--chunk"], reason: "without --compress" },
    Rule {
        need: Need::Uncut,
        options: &["--chunk", "--layers"],
        reason: "on a packed capture, which is cut as gs4d compress --chunk has ordered it",
    },
    Rule { need: Need::WholeColors, options: &["--color-step"], reason: "on colors that are coded by codebooks" },
    Rule {
        need: Need::Codebooks,
        options: &["--codebooks", "--base-bits", "--weights"],
        reason: "without codebooks, which --codebooks adds",
    },
    Rule {
        need: Need::TrainedCodebooks,
        options: &["--compress-steps", "--round-geometry"],
        reason: "with a quality without codebooks: --compress small and balanced have some",
    },
    Rule {
        need: Need::ColorInTime,
        options: &["--sh-degree-t"],
        reason: "with --sh-degree below 3: only color of degree 3 depends on time",
    },
    Rule { need: Need::RawPictures, options: &["--size"], reason: "without .f32 pictures" },
    Rule {
        need: Need::ValidationViews,
        options: &["--patience"],
        reason: "without validation views, on which evaluations are compared: --validation cameras or times holds some out",
    },
    Rule {
        need: Need::Gaps,
        options: &["--mask-weight", "--behind"],
        reason: "on images without transparent pixels and masks",
    },
    Rule {
        need: Need::Relocation,
        options: &["--relocate-every", "--noise", "--dropout"],
        reason: "with --densify original, which neither relocates nor moves Gaussians at random",
    },
    Rule {
        need: Need::FixedNumber,
        options: &["--rigid-weight"],
        reason: "with --densify original: places without a Gaussian would be neighbors",
    },
    Rule {
        need: Need::StartAtPoints,
        options: &["--points", "--timed-share", "--untimed-scale"],
        reason: "with --start hull or random, which begin without points",
    },
    Rule {
        need: Need::CheckedSteps,
        options: &["--trust-images"],
        reason: "with fewer than 1000 steps, after which nothing is checked",
    },
    Rule { need: Need::Degrees, options: &["--raise-degree-every"], reason: "with --sh-degree 0: no degree is raised" },
    Rule {
        need: Need::Tuning,
        options: &["--steps", "--batch", "--rounds", "--exposure"],
        reason: "where no Gaussians are trained: that needs the trained form, and the images of all training views",
    },
    Rule { need: Need::Shards, options: &["--shards"], reason: "without --plan or --only score" },
    Rule {
        need: Need::ScoreStage,
        options: &["--shard", "--shards"],
        reason: "on this stage: they are of --only score",
    },
];
