// place_bins: gives each bin room for exactly the splats that `project_bin` has counted, one bin after the other; one
// workgroup.
// In: the number of splats of each bin. Out: the index of the first entry of each bin. Only for frames whose bins
// differ too much to have room for the same number of splats, or that have so many splats that a bin without room would
// take seconds; `fill_bins` writes the entries.
#import gs4d::types::{FrameUniforms, BIN_COUNTERS}
#import gs4d::bins::{bin_grid, bin_side}
#import gs4d::scan::{exclusive_scan, saturating_add}

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
// As in gs4d::filling.
@group(0) @binding(2) var<storage, read_write> bins: array<u32>;

// Greater than the number of entries of any buffer; the number of splats of a bin can be added without wrapping.
const BEYOND: u32 = 0x80000000u;

@compute @workgroup_size(256)
fn place_bins(@builtin(local_invocation_index) thread: u32) {
    let grid = bin_grid(frame.tiles, bin_side(frame.binning));
    let count = grid.x * grid.y;
    let counts = BIN_COUNTERS + frame.binning.w;
    let each = (count + 255u) / 256u;
    let first = min(thread * each, count);
    let end = min(first + each, count);
    var sum = 0u;
    for (var bin = first; bin < end; bin++) {
        sum = saturating_add(sum, bins[counts + bin]);
    }
    var place = exclusive_scan(sum, thread);
    for (var bin = first; bin < end; bin++) {
        bins[counts + count + bin] = min(place, BEYOND);
        place = saturating_add(place, bins[counts + bin]);
    }
}
