//! The errors of beginning a capture.
//!
//! In: views that no capture can be trained on. Out: [`StartError`]; a command adds the option that mends it.

/// Why no capture can be begun.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// All views are from one place, from which depth cannot be found.
    #[error("{}: a capture needs views from several places", one_place(*.views))]
    OnePlace {
        /// Number of views.
        views: usize,
    },
    /// A time that is not a finite number.
    #[error("the view {view} has no finite time")]
    Time {
        /// Name of the view.
        view: String,
    },
    /// An interval whose ends are one number in single precision.
    #[error(
        "the time interval {},{} has no length in single precision: give the first and the last time of the dataset",
        .interval[0], .interval[1]
    )]
    Interval {
        /// First and last time, as given.
        interval: [f64; 2],
    },
    /// The cameras look at nothing together.
    #[error(
        "the training cameras look away from each other, so that they have no region in common (are they inside of what \
         they show?)"
    )]
    NoRegion,
    /// There are no points.
    #[error(
        "the dataset has no file of points (points3d.ply, sparse/0/points3D.bin, ply_file_path of transforms.json)"
    )]
    NoPoints,
    /// A file of points that was asked for has none that can be used.
    #[error("has no points with finite places")]
    NoFinitePoints,
    /// There are no silhouettes.
    #[error("the images have no transparent pixels and no masks, so that they have no hull")]
    NoSilhouettes,
    /// Images that do not show what is behind the scene.
    #[error("the images have transparent pixels or masks, which do not show what is behind the scene")]
    NoSurroundings,
    /// There is nothing inside the silhouettes.
    #[error("no point is inside the silhouettes of the views of a moment (masks or poses of another scene?)")]
    NoHull,
}

/// Says that there is no depth in so many views.
fn one_place(views: usize) -> String {
    match views {
        1 => "a single training view has no depth".to_owned(),
        _ => format!("all {views} training views are taken from one place, from which no depth can be found"),
    }
}
