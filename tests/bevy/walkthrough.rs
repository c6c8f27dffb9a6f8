//! The parts of the example `walkthrough`, by the tests that they carry: Cargo builds examples, but runs no tests in them.
//!
//! In: bodies, heads and keys. Out: proof that moving about is what comfort asks for. Needs neither a GPU nor a window.

#[path = "../../examples/walkthrough/body.rs"]
#[expect(dead_code, reason = "the example uses the rest")]
mod body;
#[path = "../../examples/walkthrough/comfort.rs"]
mod comfort;
#[path = "../../examples/walkthrough/path.rs"]
#[expect(dead_code, reason = "the example uses the rest")]
mod path;
#[path = "../../examples/walkthrough/teleport.rs"]
#[expect(dead_code, reason = "the example uses the rest")]
mod teleport;
