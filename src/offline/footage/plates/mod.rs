//! Background plates and masks of cameras that stand still.
//!
//! In: the pictures of one camera, of one size, and masks that are known. Out: the [`Plate`], which shows what stands
//! still, and masks, which say what moves: 255 where it surely does, 0 where it does not, a ramp of a few pixels
//! between.
//!
//! Who stands still is part of the background, as far as pictures can tell: the plate has the places of a person who
//! steps aside for less than half of the take. Its confidence is low there, and masks have these places whole, in all
//! pictures. Nothing tells a person who never moves, or whose clothes have one color, from the background.
//!
//! | file | subject |
//! |---|---|
//! | `exposure` | the gain between two pictures of a camera |
//! | `plate` | the plate, its confidence, the noise of the camera |
//! | `reference` | what pictures are compared with: the plate, prepared |
//! | `shadow` | pixels whose light has changed, but not their surface |
//! | `mask` | masks |
//! | `morphology` | opening, closing, holes, specks |
//! | `window` | what squares around pixels hold |

mod exposure;
mod mask;
mod morphology;
mod plate;
mod reference;
mod shadow;
mod window;

pub(crate) use mask::masks;
pub(crate) use plate::plate;
