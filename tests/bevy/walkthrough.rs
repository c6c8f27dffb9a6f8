//! The unit tests of the example `walkthrough`, which Cargo does not run: it builds examples, but runs no tests in
//! them.
//!
//! In: bodies, heads and keys. Out: proof that walking, turning, teleporting and recorded paths work, and that the view
//! closes in as comfort requires. Needs neither a GPU nor a window.

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
