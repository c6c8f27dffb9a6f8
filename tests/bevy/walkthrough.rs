//! The unit tests of the example `walkthrough`, included here because Cargo builds examples without running their
//! tests.
//!
//! In: bodies, heads and keys. Out: proof that walking, turning, teleporting and recorded paths work, and that the
//! vignette closes during motion. Needs neither a GPU nor a window.

#[path = "../../examples/walkthrough/body.rs"]
#[expect(dead_code, reason = "only the example uses the remaining items")]
mod body;
#[path = "../../examples/walkthrough/comfort.rs"]
mod comfort;
#[path = "../../examples/walkthrough/path.rs"]
#[expect(dead_code, reason = "only the example uses the remaining items")]
mod path;
#[path = "../../examples/walkthrough/teleport.rs"]
#[expect(dead_code, reason = "only the example uses the remaining items")]
mod teleport;
