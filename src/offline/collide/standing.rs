//! What never moves, and what else is solid.
//!
//! In: the cells that are solid at every moment; those that are solid at some moment of a stretch of time. Out: what
//! stands ([`Standing`]), and what moves in that stretch: the rest, without the lining of what stands.

use super::solid::Solid;

/// The cells that are solid at every moment.
#[derive(Debug)]
pub(super) struct Standing {
    pub cells: Solid,
    /// These, and those beside them.
    near: Solid,
}

impl Standing {
    /// Returns what stands, of the cells that are solid at every moment. `thickness` is the smallest of each cell.
    pub(super) fn of(solid: &Solid, thickness: &[f32], smallest: usize) -> Self {
        let rank = |index: usize| thickness[index];
        let cells = solid.closed().joined(rank).filled().without_small(smallest);
        let near = cells.grown();
        Self { cells, near }
    }

    /// Returns what moves, of the cells that are solid at some moment. `thickness` is the largest of each cell. Cells
    /// that stand are not among them, except where two parts that move touch at an edge alone beside what stands.
    ///
    /// At its surface what stands is more opaque at some moments than at others, which lines it with cells that do not
    /// move: of the cells beside what stands only those remain that are also beside cells farther away.
    pub(super) fn moving(&self, solid: &Solid, thickness: &[f32], smallest: usize) -> Solid {
        let closed = solid.closed().without(&self.cells);
        let away = closed.without(&self.near);
        if away.count() == 0 {
            return away;
        }
        let moving = away.grown().in_both(&closed);
        // The bottom of what stands on the ground is the ground.
        let moving = moving.and(&self.cells).filled().without(&self.cells);
        let rank = |index: usize| if self.cells.cells[index] { f32::NEG_INFINITY } else { thickness[index] };
        moving.joined(rank).without_small(smallest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [12, 12, 12];

    fn thickness() -> Vec<f32> {
        vec![1.0; 12 * 12 * 12]
    }

    /// Returns the standing ground of three layers.
    fn ground() -> Standing {
        Standing::of(&Solid::in_size(SIZE, |[_, _, z]| z < 3), &thickness(), 27)
    }

    #[test]
    fn the_lining_of_what_stands_does_not_move_and_what_is_on_it_does() {
        let ground = ground();
        assert_eq!(ground.cells.count(), 3 * 144, "three layers stand");
        let is_block = |[x, y, z]: [usize; 3]| (4..8).contains(&x) && (4..8).contains(&y) && (3..7).contains(&z);
        let block = Solid::in_size(SIZE, is_block);
        let lined = Solid::in_size(SIZE, |place| place[2] < 4 || is_block(place));
        let moving = ground.moving(&lined, &thickness(), 27);
        assert_eq!(block.without(&moving).count(), 0, "the block moves, down to the ground");
        // Closing rounds the corner between the block and the layer.
        assert_eq!(moving.without(&block.grown()).count(), 0, "the layer around it does not");
        let lining = Solid::in_size(SIZE, |[_, _, z]| z < 4);
        assert_eq!(ground.moving(&lining, &thickness(), 1).count(), 0, "a lining alone is nothing");
    }

    #[test]
    fn what_is_hollow_above_the_ground_is_filled_down_to_the_ground() {
        let is_block = |[x, y, z]: [usize; 3]| (3..9).contains(&x) && (3..9).contains(&y) && (3..9).contains(&z);
        let is_inside = |[x, y, z]: [usize; 3]| (4..8).contains(&x) && (4..8).contains(&y) && (3..8).contains(&z);
        let bell = Solid::in_size(SIZE, |place| place[2] < 3 || (is_block(place) && !is_inside(place)));
        let moving = ground().moving(&bell, &thickness(), 27);
        assert_eq!(moving, Solid::in_size(SIZE, is_block), "the bell is whole");
    }

    #[test]
    fn specks_neither_stand_nor_move() {
        let specks = Solid::in_size(SIZE, |[x, y, z]| z < 3 || (x == 5 && y == 5 && (6..8).contains(&z)));
        let standing = Standing::of(&specks, &thickness(), 27);
        assert_eq!(standing.cells, ground().cells, "two cells do not stand");
        assert_eq!(standing.moving(&specks, &thickness(), 27).count(), 0, "nor do they move");
    }
}
