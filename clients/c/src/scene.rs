//! Scenes from files and texts, and parameters of effects.

use std::ffi::c_char;
use std::path::Path;

use hbot_config::SceneFile;
use serde_json::{Map, Value};

use crate::boundary::text;
use crate::client::{HbotClient, with};
use crate::ops::done;
use crate::status::{Failure, HbotStatus};

fn bad_scene(error: impl std::fmt::Display) -> Failure {
    Failure::new(HbotStatus::BadScene, error.to_string())
}

/// Loads a scene from a file (TOML, docs/files.md) on this machine, with the recordings that it
/// names, and renders it. The file is checked here first; the text of the error names each mistake.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_load_scene_file(client: *mut HbotClient, path: *const c_char) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let scene = SceneFile::from_path(Path::new(text(path, "path")?)).map_err(bad_scene)?;
            done(inner.client.load_scene(scene.to_json()))
        })
    }
}

/// Loads a scene from the text of a scene file (TOML). Like hbot_load_scene_file(), but without
/// recordings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_load_scene_toml(client: *mut HbotClient, toml: *const c_char) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let scene = SceneFile::from_toml(text(toml, "toml")?, "scene").map_err(bad_scene)?;
            done(inner.client.load_scene(scene.to_json()))
        })
    }
}

/// Loads a scene from JSON text of the shape that docs/api.md shows for `load_scene`. The server
/// checks it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_load_scene_json(client: *mut HbotClient, json: *const c_char) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let scene: Value = serde_json::from_str(text(json, "json")?).map_err(bad_scene)?;
            done(inner.client.load_scene(scene))
        })
    }
}

/// Changes one parameter of an effect that is a number, for example "stiffness". The change is
/// blended in within 50 ms.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_set(
    client: *mut HbotClient,
    effect: *const c_char,
    parameter: *const c_char,
    value: f64,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            if !value.is_finite() {
                return Err(Failure::new(HbotStatus::NotFinite, format!("value is {value}")));
            }
            let parameters = Map::from_iter([(text(parameter, "parameter")?.to_owned(), value.into())]);
            done(inner.client.set(text(effect, "effect")?, parameters))
        })
    }
}

/// Changes parameters of an effect. `json` is a JSON object with their names and values, as
/// {"stiffness": 2, "damping": 0.02}.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hbot_set_json(
    client: *mut HbotClient,
    effect: *const c_char,
    json: *const c_char,
) -> HbotStatus {
    // SAFETY: the contract of all functions, stated at the crate.
    unsafe {
        with(client, |inner| {
            let parameters: Map<String, Value> = serde_json::from_str(text(json, "json")?)
                .map_err(|error| Failure::argument(format!("json: {error}")))?;
            done(inner.client.set(text(effect, "effect")?, parameters))
        })
    }
}
