//! A pause of a long task, so that a browser can draw and answer: there all tasks run on the thread of the page.
//!
//! In: nothing. Out: a future that is ready after the browser has had its turn; elsewhere at once.

#[cfg(not(target_arch = "wasm32"))]
pub(super) async fn pause() {}

#[cfg(target_arch = "wasm32")]
pub(super) async fn pause() {
    use js_sys::{Function, Promise, Reflect, global};
    let turn = Promise::new(&mut |resolve, _| {
        let timer = Reflect::get(&global(), &"setTimeout".into()).map(Function::from);
        // A program that embeds no page may have no timer.
        if timer.and_then(|timer| timer.call1(&global(), &resolve)).is_err() {
            let _ = resolve.call0(&global());
        }
    });
    // The promise is never rejected.
    let _ = wasm_bindgen_futures::JsFuture::from(turn).await;
}
