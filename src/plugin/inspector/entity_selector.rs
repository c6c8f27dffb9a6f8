//! The entity selector: the lists from which a user selects the capture and the camera that the panel shows.
//!
//! In: entities with a name or an asset path. Out: the entity to show, and the entity that the user selects.

use crate::plugin::asset::CaptureState;
use bevy::ecs::entity::Entity;
use bevy_egui::egui;

/// One entity of a list.
pub(super) struct Choice {
    pub(super) entity: Entity,
    pub(super) label: String,
}

impl Choice {
    /// Returns a choice labeled by the entity's name, else by its asset path, else by its number.
    pub(super) fn new(entity: Entity, name: Option<&str>, path: Option<String>, kind: &str) -> Self {
        let label = name.map(str::to_owned).or(path).unwrap_or_else(|| format!("{kind} {entity}"));
        Self { entity, label }
    }
}

/// Returns the entity to show: the selected entity while it exists, else the first; `None` if the list is empty.
pub(super) fn shown(selected: Option<Entity>, choices: &[Choice]) -> Option<Entity> {
    let is_there = |entity: &Entity| choices.iter().any(|choice| choice.entity == *entity);
    selected.filter(is_there).or_else(|| choices.first().map(|choice| choice.entity))
}

/// Draws the list. Returns the entity that the user selects in this frame.
pub(super) fn show(ui: &mut egui::Ui, kind: &str, choices: &[Choice], shown: Entity) -> Option<Entity> {
    let current = choices.iter().find(|choice| choice.entity == shown).map_or("", |choice| choice.label.as_str());
    let mut picked = None;
    egui::ComboBox::from_id_salt(kind).width(ui.available_width()).truncate().selected_text(current).show_ui(
        ui,
        |ui| {
            for choice in choices {
                if ui.selectable_label(choice.entity == shown, choice.label.as_str()).clicked() {
                    picked = Some(choice.entity);
                }
            }
        },
    );
    picked
}

/// Draws the loading state, a failure in red.
pub(super) fn show_state(ui: &mut egui::Ui, state: &CaptureState) {
    match state {
        CaptureState::Loading => ui.weak("loading ..."),
        CaptureState::Ready => ui.weak("ready"),
        CaptureState::Failed(failure) => ui.colored_label(ui.visuals().error_fg_color, failure.to_string()),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(index: u32) -> Choice {
        let entity = Entity::from_raw_u32(index).expect("a small number");
        Choice::new(entity, None, None, "capture")
    }

    #[test]
    fn the_first_entity_replaces_a_despawned_selection() {
        let choices = [choice(3), choice(5)];
        let [first, second] = [choices[0].entity, choices[1].entity];
        assert_eq!(shown(Some(second), &choices), Some(second), "the selected entity is shown");
        assert_eq!(shown(Some(choice(9).entity), &choices), Some(first), "the first entity replaces a despawned one");
        assert_eq!(shown(None, &choices), Some(first), "the first entity is shown without a selection");
        assert_eq!(shown(Some(first), &[]), None, "an empty list shows no entity");
    }

    #[test]
    fn labels_prefer_names_to_paths_and_paths_to_numbers() {
        let entity = choice(3).entity;
        let label = |name, path: Option<&str>| Choice::new(entity, name, path.map(str::to_owned), "capture").label;
        assert_eq!(label(Some("stage"), Some("a.gs4d")), "stage", "the name comes first");
        assert_eq!(label(None, Some("a.gs4d")), "a.gs4d", "without a name, the label is the file");
        assert!(label(None, None).starts_with("capture "), "without a name and a file, the label has the number");
    }
}
