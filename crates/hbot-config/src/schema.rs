//! Generates JSON schemas from Rust types. The schemas are flat and have the keywords that the
//! validator and the panel read.
//!
//! Besides standard keywords a schema can have two more. `unit` is the SI unit as text. `legal`
//! says in words what is legal, if the standard keywords cannot say all of it.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};

/// Returns the JSON schema of a type. Each reference in it is replaced by the schema to which it
/// refers.
pub(crate) fn of<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().with(|s| {
        s.inline_subschemas = true;
        s.meta_schema = None;
    });
    let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
    if let Some(root) = schema.as_object_mut() {
        root.remove("title");
    }
    unwrap_descriptions(&mut schema);
    schema
}

/// Replaces the line breaks in all descriptions by spaces. Descriptions come from doc comments,
/// which are broken into lines for the editor. Tool tips, tables and clients break lines
/// themselves.
fn unwrap_descriptions(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            for (key, value) in map {
                match value {
                    Value::String(text) if key == "description" => *text = text.replace('\n', " "),
                    _ => unwrap_descriptions(value),
                }
            }
        }
        Value::Array(list) => list.iter_mut().for_each(unwrap_descriptions),
        _ => {}
    }
}

/// Returns the properties in the JSON schema of an object. Returns an empty map if there are none.
pub(crate) fn properties(schema: &Value) -> Map<String, Value> {
    schema["properties"].as_object().cloned().unwrap_or_default()
}
