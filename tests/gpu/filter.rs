//! The temporal filter on the GPU.
//!
//! In: synthetic scenes with filters of both storage kinds. Out: proof that exactly the inactive Gaussians are not
//! drawn. Skipped where there is no GPU.

use crate::support::gpu;
use bevy_gs4d::reference;
use bevy_gs4d::renderer::{Design, Headless, Instance, ViewParameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{ActiveSets, FilterKind, RuntimeScene, TemporalFilter};
use bevy_gs4d::view::{Appearance, Background, Camera, Frame, RasterFov, View};
use glam::{UVec2, Vec3};

const SEGMENTS: u32 = 9;
const BLACK: Background = Background::Color([0.0; 3]);

fn scene(count: usize, seed: u64) -> RuntimeScene {
    let settings = SynthSettings { count, seed, degree: 1, ..SynthSettings::default() };
    synthesize(&settings).into_runtime().expect("synthetic scenes are valid")
}

fn with_support(scene: &RuntimeScene) -> RuntimeScene {
    let filter = TemporalFilter::support(
        scene.iter(),
        scene.trained_with.time_interval,
        scene.trained_with.marginal_cutoff,
        SEGMENTS,
    );
    RuntimeScene { filter: Some(filter), ..scene.clone() }
}

fn as_bits(scene: &RuntimeScene) -> RuntimeScene {
    let filter = scene.filter.clone().expect("a filter");
    let sets = ActiveSets::Bits(filter.to_bits());
    RuntimeScene { filter: Some(TemporalFilter { sets, ..filter }), ..scene.clone() }
}

fn view(time: f32) -> View {
    let eye = Vec3::new(2.0, -1.5, 1.2);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(90, 61)).view(time, RasterFov::Reference)
}

/// Returns ascending and descending times: the segment changes, stays the same, and returns to an earlier segment.
fn times() -> impl Iterator<Item = f32> {
    [0.0, 0.05, 0.11, 0.112, 0.5, 0.93, 1.0, 0.5, 0.0, -0.3, 1.4].into_iter()
}

fn bits_of(frame: &Frame) -> Vec<u32> {
    let colors = frame.picture.pixels.iter().flat_map(|p| p.to_array());
    colors.chain(frame.transmittance.iter().copied()).chain(frame.depth.iter().copied()).map(f32::to_bits).collect()
}

fn draw(headless: &mut Headless, scene: &RuntimeScene, time: f32) -> Frame {
    let capture = headless.upload(scene).expect("the scene fits the GPU");
    headless.render(&capture, &view(time), BLACK).expect("the view is drawn")
}

#[test]
fn a_filter_by_support_does_not_change_the_picture() {
    let Some(mut headless) = gpu::headless() else { return };
    let whole = scene(5_000, 3);
    let filtered = with_support(&whole);
    let fraction = filtered.filter.as_ref().expect("a filter").active_share();
    assert!(fraction < 0.9, "some Gaussians are inactive: the active fraction is {fraction}");
    let [a, b, c] =
        [&whole, &filtered, &as_bits(&filtered)].map(|scene| headless.upload(scene).expect("the scene fits the GPU"));
    for time in times() {
        let expected = headless.render(&a, &view(time), BLACK).expect("the view is drawn");
        for capture in [&b, &c] {
            let frame = headless.render(capture, &view(time), BLACK).expect("the view is drawn");
            assert_eq!(frame.counts, expected.counts, "at {time}: the same numbers of splats and pairs");
            assert!(bits_of(&frame) == bits_of(&expected), "at {time}: the picture is the same bit for bit");
        }
    }
}

#[test]
fn inactive_gaussians_are_not_drawn() {
    let Some(mut headless) = gpu::headless() else { return };
    let whole = scene(3_000, 5);
    // Every third Gaussian is active in even segments, all others in odd segments, which intervals cannot represent.
    let words = TemporalFilter::words(3_000);
    let mut bits = vec![0u32; words * SEGMENTS as usize];
    for segment in 0..SEGMENTS as usize {
        for index in (0..3_000).filter(|i| (i % 3 == 0) == (segment % 2 == 0)) {
            bits[segment * words + index / 32] |= 1 << (index % 32);
        }
    }
    let filter = TemporalFilter::from_bits(FilterKind::KeyFrame, SEGMENTS, 3_000, bits);
    assert!(matches!(filter.sets, ActiveSets::Bits(_)), "active sets with gaps are stored as bits");
    let filtered = RuntimeScene { filter: Some(filter), ..whole.clone() };
    let capture = headless.upload(&filtered).expect("the scene fits the GPU");
    for time in times() {
        let frame = headless.render(&capture, &view(time), BLACK).expect("the view is drawn");
        let expected = reference::render(&filtered, &view(time), BLACK);
        assert_eq!(frame.counts.visible, expected.counts.visible, "at {time}: the same splats as on the CPU");
        let apart = frame.picture.pixels.iter().zip(&expected.picture.pixels);
        let apart = apart.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
        assert!(apart <= 1e-3, "at {time}: colors differ by {apart} from the CPU reference");
    }
    let all = draw(&mut headless, &whole, 0.5);
    let some = headless.render(&capture, &view(0.5), BLACK).expect("the view is drawn");
    assert!(some.counts.visible < all.counts.visible, "fewer splats than without the filter");
    headless.use_filters(false);
    let unfiltered = headless.render(&capture, &view(0.5), BLACK).expect("the view is drawn");
    assert!(bits_of(&unfiltered) == bits_of(&all), "with filters switched off, all Gaussians are drawn");
    headless.use_filters(true);
    let again = headless.render(&capture, &view(0.5), BLACK).expect("the view is drawn");
    assert!(bits_of(&again) == bits_of(&some), "with filters switched on again, the list is recorded again");
}

#[test]
fn copies_of_several_times_are_drawn_with_the_list_of_each() {
    let Some(mut headless) = gpu::headless() else { return };
    let whole = scene(400, 9);
    let [plain, filtered] =
        [&whole, &with_support(&whole)].map(|scene| headless.upload(scene).expect("the scene fits the GPU"));
    // More copies than one dispatch draws, at several places.
    let seen = |index: usize| {
        let eye = Vec3::new(3.0 - 0.6 * (index % 10) as f32, -6.0, 2.0 - 0.5 * (index / 10) as f32);
        let time = (index * 37 % 100) as f32 / 100.0;
        Camera::look_at(eye, eye + Vec3::Y, Vec3::Z, 0.9, UVec2::new(90, 61)).view(time, RasterFov::Reference)
    };
    let views: Vec<View> = (0..80).map(seen).collect();
    let mut lists: Vec<_> = views.iter().map(|view| headless.active(&filtered, view.time)).collect();
    // Lists that end leave their places to others.
    for index in [3, 40, 41, 70] {
        lists[index] = None;
    }
    for index in [41, 3, 70, 40] {
        lists[index] = headless.active(&filtered, views[index].time);
    }
    assert!(lists.iter().all(Option::is_some), "the capture has a filter");
    let parameters = ViewParameters { background: BLACK, depths: false, ..ViewParameters::default() };
    for (_, design) in Design::NAMES {
        headless.set_design(design);
        let mut draw = |filtered_too: bool| {
            let instance = |index: usize| {
                let (capture, active) = if filtered_too { (&filtered, lists[index].as_ref()) } else { (&plain, None) };
                Instance { capture, active, view: views[index], appearance: Appearance::default() }
            };
            let instances: Vec<Instance<'_>> = (0..views.len()).map(instance).collect();
            headless.render_all(&instances, &parameters).expect("the view is drawn")
        };
        let (expected, found) = (draw(false), draw(true));
        assert!(expected.counts.visible > 2_000, "{design:?}: the copies are visible: {:?}", expected.counts);
        assert_eq!(found.counts, expected.counts, "{design:?}: the same numbers of splats and pairs");
        let apart = found.picture.pixels.iter().zip(&expected.picture.pixels);
        let apart = apart.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
        assert!(apart <= 1e-6, "{design:?}: colors differ by {apart}");
    }
}

#[test]
fn captures_with_and_without_a_filter_are_drawn_in_one_view() {
    let Some(mut headless) = gpu::headless() else { return };
    let (a, b) = (scene(2_000, 7), scene(2_500, 8));
    let filtered = with_support(&a);
    let [plain, other, filtered] =
        [&a, &b, &filtered].map(|scene| headless.upload(scene).expect("the scene fits the GPU"));
    let mut previous = None;
    for (time, late) in times().zip(times().skip(3)) {
        let parameters = ViewParameters { background: BLACK, ..ViewParameters::default() };
        let instance =
            |capture, active, time| Instance { capture, active, view: view(time), appearance: Appearance::default() };
        let expected = [instance(&plain, None, time), instance(&other, None, late), instance(&plain, None, late)];
        let expected = headless.render_all(&expected, &parameters).expect("the view is drawn");
        // The same capture twice, at different times: each instance has its own list.
        let [now, then] = [time, late].map(|time| headless.active(&filtered, time));
        let mixed = [
            instance(&filtered, now.as_ref(), time),
            instance(&other, None, late),
            instance(&filtered, then.as_ref(), late),
        ];
        let mixed = headless.render_all(&mixed, &parameters).expect("the view is drawn");
        assert!(bits_of(&mixed) == bits_of(&expected), "at {time} and {late}: the picture is the same bit for bit");
        assert!(previous != Some(bits_of(&mixed)), "the picture changes with time");
        previous = Some(bits_of(&mixed));
    }
}

#[test]
fn the_capacity_of_a_view_is_the_maximum_of_active_gaussians() {
    let Some(mut headless) = gpu::headless() else { return };
    let whole = scene(20_000, 8);
    // A ninth of the Gaussians in each segment.
    let words = TemporalFilter::words(20_000);
    let mut bits = vec![0u32; words * SEGMENTS as usize];
    for index in 0..20_000 {
        bits[index % SEGMENTS as usize * words + index / 32] |= 1 << (index % 32);
    }
    let filter = TemporalFilter::from_bits(FilterKind::KeyFrame, SEGMENTS, 20_000, bits);
    let filtered = RuntimeScene { filter: Some(filter), ..whole };
    let capture = headless.upload(&filtered).expect("the scene fits the GPU");
    // The capacity in splats is that of the buffers of this design.
    headless.set_design(Design::GlobalSort);
    let mut made = None;
    for time in times() {
        let frame = headless.render(&capture, &view(time), BLACK).expect("the view is drawn");
        let expected = reference::render(&filtered, &view(time), BLACK);
        assert_eq!(frame.counts.visible, expected.counts.visible, "at {time}: the same splats as on the CPU");
        let slots = headless.finished().expect("a frame").slots;
        assert!((2_222..6_000).contains(&slots), "at {time}: a capacity of {slots} splats for 2222 active Gaussians");
        assert_eq!(*made.get_or_insert(slots), slots, "at {time}: the capacity does not depend on time");
    }
    headless.use_filters(false);
    headless.render(&capture, &view(0.5), BLACK).expect("the view is drawn");
    assert!(
        headless.finished().expect("a frame").slots >= 20_000,
        "without the filter, the capacity fits all Gaussians"
    );
}
