// fill_bins: puts the visible splats into bins that `place_bins` has placed.
// In: splats, the list of the visible splats, the index of the first entry of each bin. Out: unordered bins; the index
// after the last entry of each bin. Entries beyond the end of the buffer are not written.
#import gs4d::types::{FrameUniforms, SplatShape, VisibleSplat, BIN_COUNTERS}
#import gs4d::bins::{bin_grid, bin_side, depth_order, stamp_bits, STAMP_MASK}
#import gs4d::filling::{begin_filling, bin_entries, count_splat, filling_of, put_splat, put_wide_splats, reserve_entries}

@group(0) @binding(0) var<uniform> frame: FrameUniforms;
@group(0) @binding(1) var<storage, read> splats: array<SplatShape>;
@group(0) @binding(4) var<storage, read> visible: array<VisibleSplat>;

@compute @workgroup_size(256)
fn fill_bins(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let side = bin_side(frame.binning);
    let grid = bin_grid(frame.tiles, side);
    // The index of the next entry of a bin, in place of their number, is reserved.
    let places = BIN_COUNTERS + frame.binning.w + grid.x * grid.y;
    let filling = filling_of(frame.tiles, side, places, 0u, arrayLength(&bin_entries));
    for (var first = 256u * group.x; first < frame.slots; first += 256u * groups.x) {
        var tiles = vec4(0u);
        var slot = 0u;
        var key = 0u;
        if first + thread < frame.slots {
            let words = visible[first + thread].words;
            // The list of a part may end before its last slot; the entries after it are those of earlier frames.
            if all((words.zw & vec2(STAMP_MASK)) == stamp_bits(frame.binning.x >> 8u)) {
                tiles = unpack_tiles(words.zw & vec2(~STAMP_MASK));
                slot = words.x;
                key = depth_order(splats[slot].place.w);
            }
        }
        begin_filling(filling, thread);
        workgroupBarrier();
        let own = count_splat(filling, tiles, key, slot);
        let wide_count = reserve_entries(filling, thread);
        workgroupBarrier();
        put_splat(filling, own, tiles, key, slot);
        put_wide_splats(filling, wide_count, thread);
        workgroupBarrier();
    }
}
