//! The passes that an app has recorded, by Bevy's diagnostics.
//!
//! In: an app with Bevy's `RenderDiagnosticsPlugin`, the name of a pass. Out: whether the pass has been recorded.

use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;

/// Returns whether the pass has been recorded so far. Spans arrive some frames later.
pub fn has_recorded(app: &App, pass: &str) -> bool {
    app.world().resource::<DiagnosticsStore>().iter().any(|known| known.path().as_str().contains(pass))
}
