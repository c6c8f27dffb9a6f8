//! What a point is placed on, as it moves.
//!
//! In: a small thing in the air, or the shape around a point, whichever `follow` has found. Out: [`Part`], which moves
//! as either.

use super::cloud::Cloud;
use super::shape::Shape;
use super::small::Small;
use glam::{DQuat, DVec3};

/// What a point is placed on.
#[derive(Clone)]
pub(super) enum Part<'a> {
    /// A small thing, which does not turn.
    Small(Small<'a>),
    /// A shape, which is as rigid as it can be.
    Shape(Shape<'a>),
}

impl<'a> Part<'a> {
    /// Returns the same kind of part around a point at another time, at which it has been followed to there; `None` if
    /// nothing is there.
    pub(super) fn again(&self, cloud: &'a Cloud, point: DVec3, time: f64) -> Option<Self> {
        match self {
            Self::Small(small) => small.again(point, time).map(Self::Small),
            Self::Shape(_) => Shape::around(cloud, point, time).map(Self::Shape),
        }
    }

    /// Moves the part to a time. Returns whether it has moved: it does not if it would be far from where it is expected,
    /// unless that is `forced`, which a small thing never is.
    pub(super) fn advance(&mut self, time: f64, forced: bool) -> bool {
        match self {
            Self::Small(small) => small.advance(time),
            Self::Shape(shape) => shape.advance(time, forced),
        }
    }

    /// Returns whether enough of what is around the point is still there.
    pub(super) fn is_held(&self) -> bool {
        match self {
            Self::Small(small) => small.is_held(),
            Self::Shape(shape) => shape.is_held(),
        }
    }

    /// Returns where the point is, capture space.
    pub(super) fn place(&self) -> DVec3 {
        match self {
            Self::Small(small) => small.place(),
            Self::Shape(shape) => shape.place(),
        }
    }

    /// Returns how the point is turned, from the start.
    pub(super) fn rotation(&self) -> DQuat {
        match self {
            Self::Small(_) => DQuat::IDENTITY,
            Self::Shape(shape) => shape.rotation(),
        }
    }

    /// Returns an estimate of the error of the place, capture units.
    pub(super) fn error(&self) -> f64 {
        match self {
            Self::Small(small) => small.error(),
            Self::Shape(shape) => shape.error(),
        }
    }
}
