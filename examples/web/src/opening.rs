//! A file that is opened in steps short enough for a page.
//!
//! In: the name of a file, then its bytes, piece by piece. Out: after some steps, a scene ready to draw; an error
//! message for a file that cannot be read.

use bevy_gs4d::codec::{CodecError, Loading, ReadOptions};
use bevy_gs4d::scene::RuntimeScene;

/// A file that is being opened.
pub struct Opening(State);

enum State {
    Receiving(String, Vec<u8>),
    Reading(Box<Loading>),
    Empty,
}

/// What a step has done.
pub enum Step {
    /// A part of the work.
    Part,
    /// All of it.
    Scene(Box<RuntimeScene>),
}

impl Opening {
    /// Begins to open a file with this name and, if it is known, length.
    pub fn new(name: &str, length: usize) -> Self {
        let mut bytes = Vec::new();
        // Memory that is not written to yet costs nothing; a file that grows is copied in a step that takes long. What
        // has no room is refused when it has been received.
        let _ = bytes.try_reserve_exact(length);
        Self(State::Receiving(name.to_owned(), bytes))
    }

    /// Adds bytes to the file.
    ///
    /// # Errors
    /// A message about a file that is larger than the memory, or that has been received.
    pub fn receive(&mut self, piece: &[u8]) -> Result<(), String> {
        let State::Receiving(_, bytes) = &mut self.0 else { return Err("the file has been received".to_owned()) };
        let has_room = bytes.try_reserve(piece.len());
        has_room.map_err(|_| format!("{} bytes are more than a page has memory for", bytes.len() + piece.len()))?;
        bytes.extend_from_slice(piece);
        Ok(())
    }

    /// Does one step, once all bytes have been received.
    ///
    /// # Errors
    /// A message about a file of an unknown format, or a damaged one.
    pub fn advance(&mut self) -> Result<Step, String> {
        // The page names the file.
        let message = |error: CodecError| error.kind.to_string();
        match std::mem::replace(&mut self.0, State::Empty) {
            State::Receiving(name, bytes) => {
                let loading = Loading::new(&name, bytes, &ReadOptions::default());
                self.0 = State::Reading(Box::new(loading.map_err(message)?));
                Ok(Step::Part)
            }
            State::Reading(mut loading) => {
                if !loading.advance(Loading::STEP).map_err(message)? {
                    return Ok(Step::Scene(Box::new(loading.finish().map_err(message)?)));
                }
                self.0 = State::Reading(loading);
                Ok(Step::Part)
            }
            State::Empty => Err("the file has been opened".to_owned()),
        }
    }

    /// Returns the part of the work that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.0 {
            State::Receiving(..) => 0.0,
            State::Reading(loading) => loading.progress(),
            State::Empty => 1.0,
        }
    }
}
