//! A file that is opened in steps short enough for a page.
//!
//! In: the name of a file and, if it is known, its length; then its bytes, piece by piece. Out: while bytes are
//! missing, openings of the layers of a package that have been received; after some steps, a scene ready to draw; an
//! error message for a file that cannot be read. Of an index that chunk files follow, the page may receive no more than
//! the index.

use bevy_gs4d::codec::package::{Beginning, Following};
use bevy_gs4d::codec::{CodecError, Loading, ReadOptions};
use bevy_gs4d::scene::RuntimeScene;

/// A file, or the beginning of one, that is being opened.
pub struct Opening {
    state: State,
    share: f32,
}

enum State {
    Receiving(Receiving),
    Reading(Box<Loading>),
    Empty,
}

/// A file whose bytes are being received.
struct Receiving {
    name: String,
    /// Its length in bytes, 0 if it is not known.
    length: usize,
    bytes: Vec<u8>,
    layers: Layers,
    following: Following,
}

/// The layers of a file that can be drawn before all of its bytes are there.
enum Layers {
    /// The header has not been received whole.
    Unknown,
    /// With the number of layers that an opening was returned of.
    Known(Box<Beginning>, usize),
    /// The file is no package, or its header is damaged.
    None,
}

/// What a step has done.
pub enum OpeningStep {
    /// A part of the work.
    Part,
    /// All of it.
    Scene(Box<RuntimeScene>),
}

impl Opening {
    /// Begins to open a file with this name and this length, which is 0 if it is not known.
    pub fn new(name: &str, length: usize) -> Self {
        let mut bytes = Vec::new();
        // Memory that is not written to yet costs nothing; a file that grows is copied in a step that takes long. What
        // has no room is refused when it has been received.
        let _ = bytes.try_reserve_exact(length);
        let (layers, following) = (Layers::Unknown, Following::Undecided);
        let receiving = Receiving { name: name.to_owned(), length, bytes, layers, following };
        Self { state: State::Receiving(receiving), share: 1.0 }
    }

    /// Adds bytes to the file.
    ///
    /// # Errors
    /// A message about a file that is larger than the memory, or that has been received.
    pub fn receive(&mut self, piece: &[u8]) -> Result<(), String> {
        let State::Receiving(Receiving { bytes, .. }) = &mut self.state else {
            return Err("the file has been received".to_owned());
        };
        let has_room = bytes.try_reserve(piece.len());
        has_room.map_err(|_| {
            format!(
                "{} bytes are more than a page has memory for: make the capture smaller (gs4d compress), or cut it \
                 into chunk files (gs4d split), of which the page keeps some",
                bytes.len() + piece.len()
            )
        })?;
        bytes.extend_from_slice(piece);
        Ok(())
    }

    /// Returns the length of the index, if chunk files follow it in the file whose bytes are being received.
    pub fn index_length(&mut self) -> Option<u64> {
        let State::Receiving(Receiving { bytes, following, .. }) = &mut self.state else { return None };
        if *following == Following::Undecided {
            *following = Following::of(bytes);
        }
        match following {
            Following::From(first) => Some(*first),
            Following::Undecided | Following::Nothing => None,
        }
    }

    /// Ends receiving: of the file, the index alone is opened.
    ///
    /// # Errors
    /// A message about a damaged index, or one that has not been received.
    pub fn end_at_index(&mut self) -> Result<(), String> {
        let first = self.index_length().and_then(|first| usize::try_from(first).ok());
        match (std::mem::replace(&mut self.state, State::Empty), first) {
            (State::Receiving(Receiving { name, mut bytes, .. }), Some(first)) => {
                bytes.truncate(first);
                bytes.shrink_to_fit();
                let loading = Loading::of_index(&name, bytes, &ReadOptions::default());
                self.state = State::Reading(Box::new(loading.map_err(|error| error.kind.to_string())?));
                Ok(())
            }
            _ => Err("no index is being received".to_owned()),
        }
    }

    /// Returns an opening of the layers of the file that have been received, if there are more of them than at the last
    /// call and bytes of the file are missing. A fault of the file is no error here: [`advance`](Self::advance) reports
    /// it once all bytes have been received.
    pub fn beginning(&mut self) -> Option<Self> {
        let State::Receiving(receiving) = &mut self.state else { return None };
        let (package, share) = receiving.newest()?;
        let loading = Loading::new(&receiving.name, package, &ReadOptions::default()).ok()?;
        Some(Self { state: State::Reading(Box::new(loading)), share })
    }

    /// Returns the share of the Gaussians of the file that the scene will have, above 0; 1 if it is not only the
    /// beginning of a file.
    pub fn share(&self) -> f32 {
        self.share
    }

    /// Does one step, once all bytes have been received.
    ///
    /// # Errors
    /// A message about a file of an unknown format, or a damaged one.
    pub fn advance(&mut self) -> Result<OpeningStep, String> {
        // The page names the file.
        let message = |error: CodecError| error.kind.to_string();
        match std::mem::replace(&mut self.state, State::Empty) {
            State::Receiving(Receiving { name, bytes, .. }) => {
                let loading = Loading::new(&name, bytes, &ReadOptions::default());
                self.state = State::Reading(Box::new(loading.map_err(message)?));
                Ok(OpeningStep::Part)
            }
            State::Reading(mut loading) => {
                if !loading.advance(Loading::STEP).map_err(message)? {
                    return Ok(OpeningStep::Scene(Box::new(loading.finish().map_err(message)?)));
                }
                self.state = State::Reading(loading);
                Ok(OpeningStep::Part)
            }
            State::Empty => Err("the file has been opened".to_owned()),
        }
    }

    /// Returns the part of the work that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.state {
            State::Receiving(_) => 0.0,
            State::Reading(loading) => loading.progress(),
            State::Empty => 1.0,
        }
    }
}

impl Receiving {
    /// Returns a package of the layers that have been received, and the share of the Gaussians of the file that they
    /// have, if there are more layers than at the last call and bytes of the file are missing.
    fn newest(&mut self) -> Option<(Vec<u8>, f32)> {
        let received = self.bytes.len();
        if self.length > 0 && received >= self.length {
            return None;
        }
        if matches!(self.layers, Layers::Unknown) {
            self.layers = match Beginning::of(&self.bytes) {
                Ok(Some(beginning)) => Layers::Known(Box::new(beginning), 0),
                Ok(None) => Layers::Unknown,
                Err(_) => Layers::None,
            };
        }
        let Layers::Known(beginning, before) = &mut self.layers else { return None };
        let complete = beginning.layers().partition_point(|&end| end <= received);
        if complete <= *before {
            return None;
        }
        *before = complete;
        let package = beginning.package(&self.bytes, complete - 1).ok()?;
        Some((package, beginning.share(complete - 1)))
    }
}
