//! Captures of splaTV.
//!
//! In: the two captures in the folder that `GS4D_DATA` names. Out: proof that each splat is at most one Gaussian at any
//! time, although its path is split into pieces.

use crate::support::data::data;
use crate::support::skip::skip;
use bevy_gs4d::codec::{ReadOptions, load};

#[test]
fn pieces_of_paths_do_not_raise_the_number_of_gaussians_at_any_time() {
    let Some(folder) = data() else { return };
    for (name, splats, pieces) in [("coffeeshort2", 6_871, 15_000..60_000), ("spinach_4", 62_442, 400_000..1_200_000)] {
        let path = folder.join(format!("splatv/{name}.splatv"));
        if !path.exists() {
            skip(format!("no {}", path.display()));
            continue;
        }
        let scene = load(&path, &ReadOptions::default()).expect("a whole capture");
        let filter = scene.filter.as_ref().expect("pieces have a filter");
        let most = filter.active_counts(0..scene.len()).into_iter().max().unwrap_or_default();
        assert!(pieces.contains(&scene.len()), "{name}: {} pieces", scene.len());
        assert!(most > splats / 2 && most <= splats, "{name}: {most} of {splats} splats are active at most");
    }
}
