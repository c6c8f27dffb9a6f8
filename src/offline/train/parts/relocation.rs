//! The relocation of faded Gaussians.
//!
//! In: the raw parameters after a step. Out: [`Relocation`], which moves the Gaussians that have faded to live ones if
//! that is due.
//!
//! Three places decide on a relocation: [`Growth`] after which steps there is one, the [CPU
//! reference](crate::offline::train::reference::relocation) which Gaussians move, and where to; this part carries it
//! out.

use super::moves::Moves;
use super::part::Part;
use super::request::Request;
use crate::offline::train::densification::Growth;
use crate::offline::train::gpu::{Quantity, Workspace};
use crate::offline::train::reference::relocation::relocate;
use crate::offline::train::schedule::{Step, relocation_seed};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::GpuError;
use std::mem::take;

/// Relocations after some steps.
#[derive(Debug)]
pub(super) struct Relocation {
    growth: Growth,
    seed: u64,
    moves: Moves,
    /// Number of Gaussians that have moved since the last report.
    relocated: usize,
}

impl Relocation {
    /// Makes the part in training from pictures alone, unless the densification of the original takes its place.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        let seed = request.settings.seed;
        match request.settings.growth {
            Some(growth) if growth.relocate_every.is_some() || growth.cloning.is_none() => {
                Ok(Some(Box::new(Self { growth, seed, moves: Moves::new(work)?, relocated: 0 })))
            }
            _ => Ok(None),
        }
    }
}

impl Part for Relocation {
    fn after_step(&mut self, work: &Workspace<'_>, step: &Step) -> Result<bool, GpuError> {
        let steps = step.index + 1;
        if !step.grows || !self.growth.relocates_after(steps) {
            return Ok(false);
        }
        let mut records = work.parameters.read_records(work.headless, Quantity::Values)?;
        let moves = relocate(&mut records, relocation_seed(self.seed, steps));
        // Moments are 0 at both ends, as in 3DGS-MCMC: they are of a Gaussian of another opacity and scale.
        self.moves.apply(work, &records, &moves, false);
        self.relocated += moves.len();
        Ok(true)
    }

    fn report(&mut self) -> Option<String> {
        Some(format!("{} relocated", take(&mut self.relocated)))
    }
}
