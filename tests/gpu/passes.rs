//! Individual passes against their CPU references.
//!
//! In: input buffers made by the tests, output buffers filled with an arbitrary value. Out: proof that the GPU writes
//! the results of the functions of [`reference`]. `blend`, which needs textures, is compared as part of whole frames.
//! Skipped where there is no GPU.

use crate::support::passes::{Gpu, Pass};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::internal::gaussian::TileRect;
use bevy_gs4d::internal::gaussian::conic_entries;
use bevy_gs4d::internal::reference::{self, Pair, Splat};
use bevy_gs4d::internal::renderer::{
    self, BLOCK, Counters, DEPTH_STEPS, DIGIT_BITS, DIGITS, FrameUniforms, INVISIBLE, InstanceUniforms, SortStep,
    SplatRecord,
};
use bevy_gs4d::reference::Layer;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::{Appearance, BlendSpace, Camera, DebugView, RasterFov};
use bytemuck::Zeroable;
use glam::{UVec2, Vec2, Vec3};
use std::fmt::{Debug, Display};

/// The value of buffers that have not been written.
const RUBBISH: u32 = 0xdead_beef;

/// Returns pseudorandom numbers that are the same on every platform.
fn noise(count: usize, seed: u32) -> Vec<u32> {
    let mut state = seed;
    let next = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    };
    std::iter::repeat_with(next).take(count).collect()
}

/// Checks that two lists are equal. On failure, only the first difference is printed.
fn assert_same<T: PartialEq + Debug>(found: &[T], expected: &[T], what: impl Display) {
    assert_eq!(found.len(), expected.len(), "{what}: the lengths are equal");
    if let Some(at) = found.iter().zip(expected).position(|(a, b)| a != b) {
        panic!("{what}: element {at} of {} is {:?}, expected {:?}", found.len(), found[at], expected[at]);
    }
}

/// The buffers of a sort.
struct Sort<'a> {
    gpu: &'a Gpu,
    pass: &'a Pass<'a>,
    stride: u32,
    frame: wgpu::Buffer,
    counters: wgpu::Buffer,
    arguments: wgpu::Buffer,
    histogram: wgpu::Buffer,
    /// Keys and values before a step.
    from: [wgpu::Buffer; 2],
    /// Keys and values after a step; `from` and `to` are swapped then.
    to: [wgpu::Buffer; 2],
}

impl<'a> Sort<'a> {
    fn new(gpu: &'a Gpu, pass: &'a Pass<'a>, keys: &[u32], values: &[u32], counters: Counters) -> Self {
        let slots = keys.len() as u32;
        let stride = slots.div_ceil(BLOCK);
        let rubbish = |count: u32| gpu.buffer(&vec![RUBBISH; count as usize]);
        Self {
            gpu,
            pass,
            stride,
            frame: gpu.buffer(&[FrameUniforms { slots, ..FrameUniforms::zeroed() }]),
            counters: gpu.buffer(&[counters]),
            arguments: rubbish(6),
            histogram: rubbish(DIGITS * (stride + 1)),
            from: [gpu.buffer(keys), gpu.buffer(values)],
            to: [rubbish(slots), rubbish(slots)],
        }
    }

    /// Sorts by one digit.
    fn step(&mut self, shift: u32, source: u32, blocks: u32) {
        let step = self.gpu.buffer(&[SortStep { shift, source, stride: self.stride, padding: 0 }]);
        let buffers = [
            ("sort_step", &step),
            ("frame", &self.frame),
            ("counters", &self.counters),
            ("keys_in", &self.from[0]),
            ("values_in", &self.from[1]),
            ("keys_out", &self.to[0]),
            ("values_out", &self.to[1]),
            ("histogram", &self.histogram),
            ("arguments", &self.arguments),
        ];
        self.pass.dispatch("count", blocks, &buffers);
        self.pass.dispatch("scan", DIGITS, &buffers);
        if source == renderer::SORT_SLOTS {
            self.pass.dispatch("visible", 1, &buffers);
        }
        self.pass.dispatch("scatter", blocks, &buffers);
        std::mem::swap(&mut self.from, &mut self.to);
    }

    /// Returns the current keys and values.
    fn pairs(&self) -> [Vec<u32>; 2] {
        [0, 1].map(|i| self.gpu.read(&self.from[i]))
    }
}

/// Sorts slots by their keys in all steps, and compares the order with the CPU reference.
fn check_sort_by_depth(gpu: &Gpu, pass: &Pass<'_>, keys: &[u32], what: impl Display) {
    let counters = Counters { visible: RUBBISH, ..Counters::default() };
    let mut sort = Sort::new(gpu, pass, keys, &vec![RUBBISH; keys.len()], counters);
    sort.step(0, renderer::SORT_SLOTS, (keys.len() as u32).div_ceil(BLOCK));
    let mut expected: Vec<u32> = (0..keys.len() as u32).filter(|&slot| keys[slot as usize] != INVISIBLE).collect();
    reference::sort(&mut expected, |&slot| keys[slot as usize]);

    let visible = gpu.read::<Counters>(&sort.counters)[0].visible;
    assert_eq!(visible as usize, expected.len(), "{what}: the number of visible slots");
    let arguments: Vec<u32> = gpu.read(&sort.arguments);
    let blocks = visible.div_ceil(BLOCK);
    assert_eq!(arguments, [blocks, 1, 1, RUBBISH, RUBBISH, RUBBISH], "{what}: the dispatch size of the later steps");
    for step in 1..DEPTH_STEPS {
        sort.step(step * DIGIT_BITS, renderer::SORT_VISIBLE, blocks);
    }
    let [sorted, order] = sort.pairs().map(|list| list[..visible as usize].to_vec());
    assert_same(&order, &expected, format_args!("{what}: the order"));
    let expected: Vec<u32> = expected.iter().map(|&slot| keys[slot as usize]).collect();
    assert_same(&sorted, &expected, format_args!("{what}: the keys"));
}

#[test]
fn sort_by_depth_is_stable_and_drops_invisible_slots() {
    let Some(gpu) = Gpu::new() else { return };
    let pass = gpu.pass("sort");
    for count in [0, 1, 2047, 2048, 2049, 100_000] {
        let random = noise(count, 1);
        let kinds = [
            ("random keys", random.clone()),
            ("keys of three values", random.iter().map(|key| key % 3).collect()),
            ("equal keys", vec![0x3f80_0000; count]),
            ("falling keys", (0..count as u32).rev().map(|key| key * 41).collect()),
            (
                "a third invisible",
                random.iter().map(|&key| if key.is_multiple_of(3) { INVISIBLE } else { key }).collect(),
            ),
            ("all invisible", vec![INVISIBLE; count]),
        ];
        for (kind, keys) in kinds {
            check_sort_by_depth(&gpu, &pass, &keys, format_args!("{count} slots, {kind}"));
        }
    }
}

#[test]
fn sort_scans_more_blocks_than_a_workgroup_has_threads() {
    let Some(gpu) = Gpu::new() else { return };
    let count = 256 * BLOCK as usize + 76_543;
    check_sort_by_depth(&gpu, &gpu.pass("sort"), &noise(count, 2), "more than 256 blocks");
}

#[test]
fn sort_by_tile_is_stable_and_changes_only_the_pairs() {
    let Some(gpu) = Gpu::new() else { return };
    let pass = gpu.pass("sort");
    let capacity = 6_000;
    for count in [0, 1, 2048, 5_000] {
        let tiles = noise(count, 3).into_iter().map(|random| random % 300);
        let mut pairs: Vec<Pair> = tiles.zip(0..).map(|(tile, splat)| Pair { tile, splat }).collect();
        let lists = |pairs: &[Pair]| {
            let list = |part: fn(&Pair) -> u32| {
                let mut list: Vec<u32> = pairs.iter().map(part).collect();
                list.resize(capacity, RUBBISH);
                list
            };
            [list(|pair| pair.tile), list(|pair| pair.splat)]
        };
        let [keys, values] = lists(&pairs);
        let counters = Counters { pairs: count as u32, visible: RUBBISH, ..Counters::default() };
        let mut sort = Sort::new(&gpu, &pass, &keys, &values, counters);
        // 300 tiles need nine bits.
        for step in 0..3 {
            sort.step(step * DIGIT_BITS, renderer::SORT_PAIRS, (count as u32).div_ceil(BLOCK));
        }
        reference::sort(&mut pairs, |pair| pair.tile);
        let [found, expected] = [sort.pairs(), lists(&pairs)];
        assert_same(&found[0], &expected[0], format_args!("{count} pairs: the tiles"));
        assert_same(&found[1], &expected[1], format_args!("{count} pairs: the splats"));
    }
}

/// Returns a splat that covers these tiles; all other values are arbitrary.
fn splat([x0, y0, x1, y1]: [u32; 4]) -> Splat {
    let tiles = TileRect { low: UVec2::new(x0, y0), high: UVec2::new(x1, y1) };
    Splat { center: Vec2::ZERO, conic: Vec3::ZERO, opacity: 1.0, color: Vec3::ZERO, depth: 1.0, tiles }
}

/// Returns random splats: most are small, one in a hundred covers the whole grid.
fn random_splats(count: usize, grid: UVec2) -> Vec<Splat> {
    let random = noise(4 * count, 4);
    let one = |r: &[u32]| {
        if r[0].is_multiple_of(100) {
            return splat([0, 0, grid.x, grid.y]);
        }
        let (x, y) = (r[0] % grid.x, r[1] % grid.y);
        splat([x, y, (x + 1 + r[2] % 5).min(grid.x), (y + 1 + r[3] % 5).min(grid.y)])
    };
    random.chunks_exact(4).map(one).collect()
}

/// Returns the shuffled indices of three quarters of `count` splats.
fn random_order(count: usize) -> Vec<u32> {
    let random = noise(count, 5);
    let mut order: Vec<u32> = (0..count as u32).filter(|&i| !random[i as usize].is_multiple_of(4)).collect();
    reference::sort(&mut order, |&i| random[i as usize]);
    order
}

/// Runs `bin` with a capacity of `capacity` pairs, and compares. `expected` are at least the pairs that fit; `wanted`
/// is the number of all pairs.
fn check_bin(gpu: &Gpu, splats: &[Splat], order: &[u32], grid: UVec2, capacity: u32, expected: &[Pair], wanted: u32) {
    let what = format!("{} splats, capacity {capacity} of {wanted} pairs", order.len());
    let pass = gpu.pass("bin");
    let rubbish = |count: u32| gpu.buffer(&vec![RUBBISH; count as usize]);
    let record = |splat: &Splat| {
        let [x0, y0, x1, y1] = splat.tiles.to_array();
        SplatRecord { tiles_low: x0 | (y0 << 16), tiles_high: x1 | (y1 << 16), ..SplatRecord::zeroed() }
    };
    let (slots, visible) = (splats.len() as u32, order.len() as u32);
    let frame = FrameUniforms { slots, tiles: grid.to_array(), pair_capacity: capacity, ..FrameUniforms::zeroed() };
    let counters = Counters { visible, pairs: RUBBISH, pairs_wanted: RUBBISH, padding: 0 };
    let [frame, counters] = [gpu.buffer(&[frame]), gpu.buffer(&[counters])];
    let [arguments, offsets] = [rubbish(6), rubbish(slots + slots.div_ceil(BLOCK))];
    // Larger than the capacity, to check that the rest is unchanged.
    let [pair_tiles, pair_splats] = [rubbish(capacity + 100), rubbish(capacity + 100)];
    let splats = gpu.buffer(&splats.iter().map(record).collect::<Vec<_>>());
    let order = gpu.buffer(order);
    let buffers = [
        ("frame", &frame),
        ("counters", &counters),
        ("splats", &splats),
        ("order", &order),
        ("offsets", &offsets),
        ("pair_tiles", &pair_tiles),
        ("pair_splats", &pair_splats),
        ("arguments", &arguments),
    ];
    let pairs = wanted.min(capacity);
    pass.dispatch("count", visible.div_ceil(BLOCK), &buffers);
    pass.dispatch("scan", 1, &buffers);
    pass.dispatch("offset", visible.div_ceil(BLOCK), &buffers);
    pass.dispatch("emit", pairs.div_ceil(BLOCK), &buffers);

    let counted = gpu.read::<Counters>(&counters)[0];
    assert_eq!((counted.pairs_wanted, counted.pairs), (wanted, pairs), "{what}: the numbers of pairs");
    assert_eq!(counted.visible, visible, "{what}: the number of visible splats is unchanged");
    let arguments: Vec<u32> = gpu.read(&arguments);
    let sizes = [RUBBISH, RUBBISH, RUBBISH, pairs.div_ceil(BLOCK), 1, 1];
    assert_eq!(arguments, sizes, "{what}: the dispatch size for the pairs");
    let [tiles, splats] = [gpu.read::<u32>(&pair_tiles), gpu.read::<u32>(&pair_splats)];
    let found: Vec<Pair> = tiles.iter().zip(&splats).map(|(&tile, &splat)| Pair { tile, splat }).collect();
    let (made, beyond) = found.split_at(pairs as usize);
    assert_same(made, &expected[..pairs as usize], &what);
    let untouched = Pair { tile: RUBBISH, splat: RUBBISH };
    assert!(beyond.iter().all(|pair| *pair == untouched), "{what}: the buffers are unchanged after the last pair");
}

#[test]
fn bin_matches_the_cpu_reference() {
    let Some(gpu) = Gpu::new() else { return };
    let grid = UVec2::new(40, 30);
    for count in [0, 1, 2, 2731, 7_000] {
        let (splats, order) = (random_splats(count, grid), random_order(count));
        let expected = reference::bin(&splats, &order, grid);
        let wanted = expected.len() as u32;
        check_bin(&gpu, &splats, &order, grid, wanted.max(1), &expected, wanted);
    }
}

#[test]
fn bin_beyond_its_capacity_writes_the_nearest_pairs_and_counts_all() {
    let Some(gpu) = Gpu::new() else { return };
    let grid = UVec2::new(40, 30);
    let (splats, order) = (random_splats(3_000, grid), random_order(3_000));
    let expected = reference::bin(&splats, &order, grid);
    let wanted = expected.len() as u32;
    for capacity in [1, BLOCK, BLOCK + 1, wanted / 3, wanted - 1] {
        check_bin(&gpu, &splats, &order, grid, capacity, &expected, wanted);
    }
}

#[test]
fn bin_scans_more_blocks_than_a_workgroup_has_threads() {
    let Some(gpu) = Gpu::new() else { return };
    let grid = UVec2::new(40, 30);
    let count = 256 * BLOCK + 76_543;
    let tile = |i: u32| (i * 7 % grid.x, i * 11 % grid.y);
    let splats: Vec<Splat> = (0..count).map(tile).map(|(x, y)| splat([x, y, x + 1, y + 1])).collect();
    let order: Vec<u32> = (0..count).rev().collect();
    let expected = reference::bin(&splats, &order, grid);
    check_bin(&gpu, &splats, &order, grid, count, &expected, count);
}

#[test]
fn the_number_of_pairs_saturates_in_bin() {
    let Some(gpu) = Gpu::new() else { return };
    // Two splats that cover this grid have more than 2^32 pairs; here are three blocks of such splats.
    let grid = UVec2::splat(u16::MAX.into());
    let capacity = 10_000;
    let near = random_splats(10, UVec2::splat(20));
    let huge = vec![splat([0, 0, grid.x, grid.y]); 3 * BLOCK as usize];
    let order: Vec<u32> = (0..(near.len() + huge.len()) as u32).collect();
    let mut expected = reference::bin(&near, &order[..near.len()], grid);
    // The pairs of the first huge splat, row by row, fill the remaining capacity.
    let first = Pair { tile: 0, splat: near.len() as u32 };
    expected.extend((0..capacity).map(|tile| Pair { tile, ..first }));
    check_bin(&gpu, &[near, huge].concat(), &order, grid, capacity, &expected, u32::MAX);
}

#[test]
fn ranges_match_the_cpu_reference() {
    let Some(gpu) = Gpu::new() else { return };
    let pass = gpu.pass("ranges");
    let grid = UVec2::new(23, 14);
    let count = grid.x * grid.y;
    let random = noise(5_000, 6);
    for (what, tiles) in [
        ("no pairs", vec![]),
        ("every other tile", random.iter().map(|r| r % count / 2 * 2).collect()),
        ("the first tile", vec![0; 70]),
        ("the last tile", vec![count - 1; 3_000]),
    ] {
        let mut pairs: Vec<Pair> = tiles.into_iter().zip(0..).map(|(tile, splat)| Pair { tile, splat }).collect();
        reference::sort(&mut pairs, |pair| pair.tile);
        let expected = reference::ranges(&pairs, grid);
        let expected: Vec<[u32; 2]> = expected.iter().map(|range| [range.start as u32, range.end as u32]).collect();
        let mut tiles: Vec<u32> = pairs.iter().map(|pair| pair.tile).collect();
        // Pairs of an earlier frame that had more pairs.
        tiles.extend([3; 50]);
        let buffers = [
            ("frame", &gpu.buffer(&[FrameUniforms { tiles: grid.to_array(), ..FrameUniforms::zeroed() }])),
            ("counters", &gpu.buffer(&[Counters { pairs: pairs.len() as u32, ..Counters::default() }])),
            ("pair_tiles", &gpu.buffer(&tiles)),
            ("tile_ranges", &gpu.buffer(&vec![[RUBBISH; 2]; count as usize])),
        ];
        pass.dispatch("ranges", count.div_ceil(256), &buffers);
        assert_same(&gpu.read::<[u32; 2]>(buffers[3].1), &expected, what);
    }
}

#[test]
fn project_matches_the_cpu_reference() {
    let Some(gpu) = Gpu::new() else { return };
    let settings = SynthSettings { count: 3_000, ..SynthSettings::default() };
    let scene = synthesize(&settings).into_runtime().expect("a scene that can be drawn");
    let camera = Camera::look_at(Vec3::new(2.0, 1.0, 1.2), Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(317, 203));
    let view = camera.view(0.4, RasterFov::default());
    // The splats do not begin at the first slot.
    let (first_slot, count) = (77, scene.len() as u32);
    let instance = InstanceUniforms {
        first_slot,
        count,
        degree: 3,
        degree_t: 2,
        stride: 3 * 48 / 4,
        time_span: scene.trained_with.time_span(),
        marginal_cutoff: scene.trained_with.marginal_cutoff,
        ..Zeroable::zeroed()
    };
    let instance = instance.in_view(&view, &Appearance::default(), BlendSpace::Encoded, DebugView::Color);
    let record = |gaussian: Gaussian| Gaussian { sigma_t: gaussian.sigma_t.recip(), ..gaussian };
    let slots = (first_slot + count) as usize;
    let buffers = [
        ("instance", &gpu.buffer(&[instance])),
        ("splats", &gpu.buffer(&vec![SplatRecord::zeroed(); slots])),
        ("depth_keys", &gpu.buffer(&vec![RUBBISH; slots])),
        ("gaussians", &gpu.buffer(&scene.iter().map(record).collect::<Vec<_>>())),
        ("lifespans", &gpu.buffer(&scene.iter().map(|g| [g.mean_t, g.sigma_t.recip()]).collect::<Vec<_>>())),
        ("harmonics", &gpu.buffer(&scene.form.harmonics().expect("whole").values)),
        // Not read without a filter.
        ("active_list", &gpu.buffer(&[RUBBISH])),
    ];
    gpu.pass("project").dispatch("project", count.div_ceil(256), &buffers);

    let splats: Vec<SplatRecord> = gpu.read(buffers[1].1);
    let keys: Vec<u32> = gpu.read(buffers[2].1);
    let (unused, keys) = keys.split_at(first_slot as usize);
    assert!(unused.iter().all(|key| *key == RUBBISH), "slots of other instances are unchanged");
    let expected =
        reference::project(&Layer { scene: &scene, view, appearance: Appearance::default() }, BlendSpace::Encoded);
    let (mut both, mut on_the_edge) = (0, 0);
    for (i, (wanted, splat)) in expected.iter().zip(&splats[first_slot as usize..]).enumerate() {
        if keys[i] == INVISIBLE || !wanted.is_visible() {
            on_the_edge += usize::from(wanted.is_visible() || keys[i] != INVISIBLE);
            continue;
        }
        both += 1;
        let [low, high] = [splat.tiles_low, splat.tiles_high];
        let tiles = [low & 0xffff, low >> 16, high & 0xffff, high >> 16];
        on_the_edge += usize::from(tiles != wanted.tiles.to_array());
        let entries = |conic: Vec3| Vec3::from_array(conic_entries(conic.to_array().map(f64::from)).map(|x| x as f32));
        let conic = entries(wanted.conic);
        let differences = [
            ("center", Vec2::from(splat.center).distance(wanted.center), 2e-3),
            ("depth", (splat.depth - wanted.depth).abs(), 1e-5),
            ("opacity", (splat.opacity - wanted.opacity).abs(), 2e-5),
            ("conic", entries(splat.conic.into()).distance(conic) / conic.abs().max_element(), 5e-3),
            ("color", Vec3::from(splat.color).distance(wanted.color), 1e-4),
        ];
        for (what, apart, limit) in differences {
            assert!(apart <= limit, "Gaussian {i}: {what} differs by {apart}: {splat:?}, expected {wanted:?}");
        }
        assert_eq!(keys[i], splat.depth.to_bits(), "Gaussian {i}: the key has the bits of the depth");
    }
    assert!(both >= 1_000, "{both} of {count} Gaussians are visible, expected at least 1000");
    assert!(on_the_edge <= 6, "{on_the_edge} Gaussians have other tiles, more than rounding explains");
}
