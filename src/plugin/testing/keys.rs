//! The keyboard of an app without a window.
//!
//! In: keys. Out: the messages that a window would send; Bevy makes `ButtonInput<KeyCode>` of them in the next update.

use super::error::TestingError;
use super::stepping::advance;
use super::waiting::start;
use bevy::app::App;
use bevy::ecs::entity::Entity;
use bevy::ecs::message::Messages;
use bevy::ecs::query::With;
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyCode, KeyboardInput, NativeKey};
use bevy::window::PrimaryWindow;
use std::time::Duration;

/// Presses a key: from the next update until [`release`] the key is down. In the next update it is `just_pressed`.
///
/// # Errors
/// An app without Bevy's `InputPlugin`.
pub fn press(app: &mut App, key: KeyCode) -> Result<(), TestingError> {
    send(app, key, ButtonState::Pressed)
}

/// Releases a key: in the next update it is `just_released`.
///
/// # Errors
/// An app without Bevy's `InputPlugin`.
pub fn release(app: &mut App, key: KeyCode) -> Result<(), TestingError> {
    send(app, key, ButtonState::Released)
}

/// Presses a key for one update and releases it in the next. No time passes in either update.
///
/// # Errors
/// An app without Bevy's `InputPlugin`; an app that requests its exit.
pub fn tap(app: &mut App, key: KeyCode) -> Result<(), TestingError> {
    start(app)?;
    press(app, key)?;
    advance(app, Duration::ZERO)?;
    release(app, key)?;
    advance(app, Duration::ZERO)
}

fn send(app: &mut App, key_code: KeyCode, state: ButtonState) -> Result<(), TestingError> {
    let world = app.world_mut();
    let window = world.query_filtered::<Entity, With<PrimaryWindow>>().iter(world).next();
    let Some(mut messages) = world.get_resource_mut::<Messages<KeyboardInput>>() else {
        return Err(TestingError::NoPlugin { plugin: "InputPlugin (DefaultPlugins has it)" });
    };
    messages.write(KeyboardInput {
        key_code,
        logical_key: Key::Unidentified(NativeKey::Unidentified),
        state,
        text: None,
        repeat: false,
        window: window.unwrap_or(Entity::PLACEHOLDER),
    });
    Ok(())
}
