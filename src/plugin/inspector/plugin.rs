//! The plugin and the panel.
//!
//! In: captures, cameras, [`CaptureStatistics`]. Out: the panel, and its warnings, also while the panel is closed. Only
//! edited values are written to components.

use super::entity_selector::{self, Choice};
use super::presentation::smoothed;
use super::settings::Inspector;
use super::timing::Measuring;
use super::warnings::{IdleTimes, PlacedCamera, PlacedCapture};
use super::{appearance, camera, counts, memory, playback, stream, timing, warnings};
use crate::plugin::asset::{CaptureAssetPlugin, CaptureState};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::Playback;
use crate::plugin::render::{CameraFault, CaptureSettings, CaptureStatistics, CaptureViewSettings, DepthWrite};
use crate::plugin::stream::CaptureStreamState;
use bevy::app::{App, Last, Plugin, PreUpdate, Update};
use bevy::asset::{AssetServer, Assets};
use bevy::camera::visibility::{InheritedVisibility, VisibleEntities};
use bevy::camera::{Camera, Camera3d, CompositingSpace, RenderTarget};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::name::Name;
use bevy::ecs::query::{With, Without};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::{not, resource_exists};
use bevy::ecs::system::{Commands, Local, Query, Res, ResMut, SystemParam};
use bevy::input::ButtonInput;
use bevy::input::keyboard::KeyCode;
use bevy::log::warn;
use bevy::render::view::Msaa;
use bevy::time::{Real, Time};
use bevy_egui::input::{WindowToEguiContextMap, egui_wants_any_keyboard_input};
use bevy_egui::{
    EguiContext, EguiContexts, EguiGlobalSettings, EguiPlugin, EguiPreUpdateSet, EguiPrimaryContextPass,
    PrimaryEguiContext, egui, setup_primary_egui_context_system,
};
use std::any::TypeId;
use std::collections::HashSet;

/// Draws the panel that [the module](crate::inspector) describes at the right edge of the first camera's picture. The
/// panel is initially open; F1 closes and opens it.
///
/// Add it after `DefaultPlugins` and [`GaussianCapturePlugins`](crate::GaussianCapturePlugins). It adds `EguiPlugin`
/// unless the app already has it. It also works without a window. When the panel's camera is despawned, another camera
/// draws the panel, unless [`EguiGlobalSettings::auto_create_primary_context`] is off.
#[derive(Debug, Default, Clone, Copy)]
pub struct InspectorPlugin;

impl Plugin for InspectorPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<Inspector>()
            // An app that does not draw captures has no statistics of its own.
            .init_resource::<CaptureStatistics>()
            .add_systems(
                PreUpdate,
                move_context
                    .in_set(EguiPreUpdateSet::InitContexts)
                    // After bevy_egui has created its context: otherwise the app would have two.
                    .after(setup_primary_egui_context_system)
                    .before(WindowToEguiContextMap::on_egui_context_added_system),
            )
            .add_systems(Update, toggle.run_if(not(egui_wants_any_keyboard_input)))
            .add_systems(EguiPrimaryContextPass, show_panel.run_if(resource_exists::<Assets<GaussianCapture>>))
            // In `Last`, the visible entities of cameras are known.
            .add_systems(Last, update_warnings.run_if(resource_exists::<Assets<GaussianCapture>>));
    }

    fn finish(&self, app: &mut App) {
        if !app.is_plugin_added::<CaptureAssetPlugin>() {
            warn!(
                "InspectorPlugin shows captures, which this app does not load: add GaussianCapturePlugins, or remove \
                 InspectorPlugin"
            );
        }
    }
}

fn toggle(keys: Res<ButtonInput<KeyCode>>, mut inspector: ResMut<Inspector>) {
    if keys.just_pressed(inspector.key) {
        inspector.open = !inspector.open;
    }
}

/// Moves the panel to another camera when its own camera has been despawned, which `bevy_egui` does not do. Prefers a
/// camera that draws into a window.
fn move_context(
    settings: Res<EguiGlobalSettings>,
    contexts: Query<(), With<PrimaryEguiContext>>,
    cameras: Query<(Entity, &Camera, Option<&RenderTarget>), Without<EguiContext>>,
    mut commands: Commands,
) {
    if !settings.auto_create_primary_context || !contexts.is_empty() {
        return;
    }
    let in_window = |target: Option<&RenderTarget>| matches!(target, Some(RenderTarget::Window(_)));
    let next = cameras.iter().min_by_key(|(entity, camera, target)| (!camera.is_active, !in_window(*target), *entity));
    if let Some((camera, ..)) = next {
        commands.entity(camera).insert(PrimaryEguiContext);
    }
}

/// Width of the panel, points.
const WIDTH: f32 = 300.0;
/// Distance from the edges, points.
const MARGIN: f32 = 8.0;

fn show_panel(
    mut contexts: EguiContexts,
    mut inspector: ResMut<Inspector>,
    mut subject: Subject,
    mut measuring: Local<Measuring>,
    mut frame_seconds: Local<f32>,
) {
    *frame_seconds = smoothed(*frame_seconds, subject.time.delta_secs());
    let mut edited = inspector.clone();
    let mut measures = false;
    if let Ok(context) = contexts.ctx_mut()
        && inspector.open
    {
        let height = (context.content_rect().height() - 2.0 * MARGIN).max(MARGIN);
        let mut open = true;
        egui::Window::new("inspector")
            .open(&mut open)
            // Fading would stop while no time passes.
            .fade_in(false)
            .fixed_size([WIDTH, height])
            .anchor(egui::Align2::RIGHT_TOP, [-MARGIN, MARGIN])
            .show(context, |ui| {
                egui::ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
                    warnings::show(ui, &edited.warnings);
                    subject.show_capture(ui, &mut edited);
                    measures = subject.show_camera(ui, &mut edited, &mut measuring, *frame_seconds);
                    if !edited.note.is_empty() {
                        ui.separator();
                        ui.label(edited.note.as_str());
                    }
                });
            });
        edited.open = open;
    }
    measuring.follow(measures, &subject.statistics);
    inspector.set_if_neq(edited);
}

/// Updates the warnings, also while no camera draws the panel.
fn update_warnings(subject: Subject, mut inspector: ResMut<Inspector>, mut idle: Local<IdleTimes>) {
    let warnings = subject.warnings(&mut idle);
    if inspector.warnings != warnings {
        inspector.warnings = warnings;
    }
}

type CaptureParts = (
    Entity,
    Option<&'static Name>,
    &'static GaussianCapture3d,
    &'static CaptureState,
    &'static mut Playback,
    &'static mut CaptureSettings,
);

type CameraParts = (
    Entity,
    Option<&'static Name>,
    Option<&'static mut CaptureViewSettings>,
    Option<&'static mut Msaa>,
    Option<&'static mut Tonemapping>,
);

/// A camera's visible entities and compositing space.
type Sight = (&'static Camera, &'static VisibleEntities, Option<&'static CompositingSpace>);

/// The captures and cameras that the panel shows.
#[derive(SystemParam)]
struct Subject<'w, 's> {
    commands: Commands<'w, 's>,
    captures: Query<'w, 's, CaptureParts>,
    streams: Query<'w, 's, &'static CaptureStreamState>,
    cameras: Query<'w, 's, CameraParts, With<Camera3d>>,
    sights: Query<'w, 's, Sight, With<Camera3d>>,
    shown: Query<'w, 's, &'static InheritedVisibility, With<GaussianCapture3d>>,
    loaded: Res<'w, Assets<GaussianCapture>>,
    server: Res<'w, AssetServer>,
    statistics: Res<'w, CaptureStatistics>,
    time: Res<'w, Time<Real>>,
}

impl Subject<'_, '_> {
    /// Draws the sections of one capture.
    fn show_capture(&mut self, ui: &mut egui::Ui, inspector: &mut Inspector) {
        if let Some(reason) = self.statistics.renderer_missing() {
            ui.colored_label(ui.visuals().error_fg_color, format!("captures are not drawn: {reason}"));
        }
        let choices = self.capture_choices();
        let Some(shown) = entity_selector::shown(inspector.selected, &choices) else {
            ui.weak("no capture");
            return;
        };
        inspector.selected = entity_selector::show(ui, "capture", &choices, shown).or(inspector.selected);
        let Ok((_, _, handle, state, mut player, mut settings)) = self.captures.get_mut(shown) else { return };
        entity_selector::show_state(ui, state);
        let Some(capture) = self.loaded.get(&handle.0) else { return };
        section(ui, "playback", true, |ui| {
            let edited = playback::show(ui, *player, capture, &mut inspector.fps);
            player.set_if_neq(edited);
        });
        if let Ok(state) = self.streams.get(shown) {
            section(ui, "stream", true, |ui| stream::show(ui, state));
        }
        section(ui, "appearance", false, |ui| {
            let edited = appearance::show(ui, *settings, capture.bounds());
            settings.set_if_neq(edited);
        });
    }

    /// Draws the sections of one camera. Returns whether the section "GPU time" is open, which needs measurements.
    fn show_camera(
        &mut self,
        ui: &mut egui::Ui,
        inspector: &mut Inspector,
        measuring: &mut Measuring,
        frame_seconds: f32,
    ) -> bool {
        let choices = self.camera_choices();
        let Some(shown) = entity_selector::shown(inspector.camera, &choices) else { return false };
        let view = self.statistics.view(shown);
        section(ui, "view", true, |ui| {
            if choices.len() > 1 {
                inspector.camera = entity_selector::show(ui, "camera", &choices, shown).or(inspector.camera);
            }
            self.show_view(ui, shown);
        });
        section(ui, "counts", true, |ui| counts::show(ui, view.as_ref(), frame_seconds));
        section(ui, "memory", false, |ui| memory::show(ui, &self.statistics, view.as_ref()));
        section(ui, "GPU time", false, |ui| match &view {
            Some(view) if view.total > 0 => timing::show(ui, &view.passes, self.statistics.cut(), measuring),
            _ => {
                ui.weak("this view draws no capture");
            }
        })
    }

    fn show_view(&mut self, ui: &mut egui::Ui, shown: Entity) {
        let Ok((_, _, settings, msaa, tonemapping)) = self.cameras.get_mut(shown) else { return };
        let current = settings.as_deref().copied().unwrap_or_default();
        let edited = camera::show(ui, current);
        match settings {
            Some(mut settings) => {
                settings.set_if_neq(edited);
            }
            None if edited != current => {
                self.commands.entity(shown).insert(edited);
            }
            None => {}
        }
        if let Some(mut msaa) = msaa {
            let edited = camera::show_msaa(ui, *msaa);
            msaa.set_if_neq(edited);
        }
        if let Some(mut tonemapping) = tonemapping {
            let edited = camera::show_tonemapping(ui, *tonemapping);
            tonemapping.set_if_neq(edited);
        }
    }

    /// Returns the warnings about captures and active cameras.
    fn warnings(&self, idle: &mut IdleTimes) -> Vec<String> {
        for (_, _, handle, ..) in self.captures.iter() {
            if let Some(capture) = self.loaded.get(&handle.0) {
                idle.find(handle.0.id(), capture);
            }
        }
        let idle = &*idle;
        let class = TypeId::of::<GaussianCapture3d>();
        let active = self.sights.iter().filter(|(camera, ..)| camera.is_active);
        let seen: HashSet<Entity> = active.flat_map(|(_, visible, _)| visible.get(class).iter().copied()).collect();
        let captures = self.capture_choices().into_iter().filter_map(|Choice { entity, label }| {
            let (_, _, handle, state, _, settings) = self.captures.get(entity).ok()?;
            let shows = self.shown.get(entity).is_ok_and(|visibility| visibility.get());
            let idle = if settings.filter { idle.of(handle.0.id()) } else { &[] };
            Some(PlacedCapture { label, state, shows, is_seen: seen.contains(&entity), idle })
        });
        let cameras = self.camera_choices().into_iter().filter_map(|Choice { entity, label }| {
            let (camera, _, space) = self.sights.get(entity).ok()?;
            let (_, _, settings, msaa, _) = self.cameras.get(entity).ok()?;
            let draws = camera.is_active && camera.physical_target_size().is_some();
            draws.then(|| PlacedCamera {
                label,
                fault: CameraFault::of(&camera.clip_from_view(), space.copied()),
                is_multisampled: msaa.is_some_and(|msaa| *msaa != Msaa::Off),
                writes_depth: settings
                    .is_some_and(|settings| matches!(settings.depth, DepthWrite::Expected | DepthWrite::Median)),
            })
        });
        warnings::list(&captures.collect::<Vec<_>>(), &cameras.collect::<Vec<_>>())
    }

    fn capture_choices(&self) -> Vec<Choice> {
        let choices = self.captures.iter().map(|(entity, name, handle, ..)| {
            let path = self.server.get_path(handle.0.id()).map(|path| path.to_string());
            Choice::new(entity, name.map(Name::as_str), path, "capture")
        });
        in_order(choices.collect())
    }

    fn camera_choices(&self) -> Vec<Choice> {
        let cameras = self.cameras.iter();
        in_order(
            cameras.map(|(entity, name, ..)| Choice::new(entity, name.map(Name::as_str), None, "camera")).collect(),
        )
    }
}

/// Sorts choices by entity: the order of a query changes whenever a component is inserted.
fn in_order(mut choices: Vec<Choice>) -> Vec<Choice> {
    choices.sort_by_key(|choice| choice.entity);
    choices
}

/// Draws a collapsible section, and returns whether it is open.
fn section(ui: &mut egui::Ui, title: &str, open: bool, contents: impl FnOnce(&mut egui::Ui)) -> bool {
    egui::CollapsingHeader::new(title).default_open(open).show(ui, contents).body_returned.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::playback::CapturePlaybackPlugin;
    use crate::scene::synth::{SynthSettings, synthesize};
    use bevy::MinimalPlugins;
    use bevy::asset::AssetPlugin;

    #[test]
    fn the_key_opens_and_closes_the_panel() {
        let mut app = App::new();
        app.init_resource::<ButtonInput<KeyCode>>().init_resource::<Inspector>().add_systems(Update, toggle);
        let press = |app: &mut App, key| {
            let mut keys = app.world_mut().resource_mut::<ButtonInput<KeyCode>>();
            keys.reset_all();
            keys.press(key);
            app.update();
            app.world().resource::<Inspector>().open
        };
        assert!(!press(&mut app, KeyCode::F1), "F1 closes the panel");
        assert!(press(&mut app, KeyCode::F1), "F1 opens the closed panel");
        app.world_mut().resource_mut::<Inspector>().key = KeyCode::KeyI;
        assert!(press(&mut app, KeyCode::F1), "F1 has no effect after another key was set");
        assert!(!press(&mut app, KeyCode::KeyI), "the new key closes the panel");
    }

    #[test]
    fn warnings_need_neither_an_open_panel_nor_a_camera() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), CaptureAssetPlugin, CapturePlaybackPlugin));
        app.init_resource::<CaptureStatistics>().insert_resource(Inspector { open: false, ..Inspector::default() });
        app.add_systems(Last, update_warnings);
        let settings = SynthSettings { count: 20, degree: 0, ..SynthSettings::default() };
        let scene = synthesize(&settings).into_runtime().expect("a synthetic scene can be drawn");
        let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
        app.world_mut().spawn((GaussianCapture3d(handle), CaptureSettings::default()));
        app.update();
        app.update();
        let warnings = &app.world().resource::<Inspector>().warnings;
        let is_reported = matches!(&warnings[..], [one] if one.contains("there is no active Camera3d"));
        assert!(is_reported, "the missing camera is reported: {warnings:?}");
    }
}
