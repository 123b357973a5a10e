//! Reads the recorded paths that a scene file names, and puts their points into the scene.

use std::path::Path;

use serde_json::{Value, json};

use super::kinds::MAX_POINTS;
use crate::document::{Document, join};
use crate::text::read_text;

/// Reads the CSV file that each `track` effect names in its key `file`, and stores the contents in
/// the key `points` of the effect. File names are relative to `folder`. A file that cannot be read
/// is reported as a mistake.
pub(super) fn read_points(document: &mut Document, folder: &Path) {
    let Document { tree, report } = document;
    let effects = tree.get_mut("effect").and_then(Value::as_array_mut);
    let effects = effects.into_iter().flatten().enumerate();
    for (i, effect) in effects.filter(|(_, effect)| effect["kind"] == "track") {
        let at = join(&format!("effect[{i}]"), "file");
        let Some(name) = effect["file"].as_str().filter(|name| !name.is_empty()) else { continue };
        if effect.get("points").is_some() {
            report.push(&at, "there are points here already", "either points or a file".to_owned());
            continue;
        }
        let path = folder.join(name);
        match points(&path) {
            Ok(points) => {
                effect["points"] = points;
                effect["file"] = json!("");
            }
            Err(message) => {
                let legal = format!("a CSV file with the columns t, w, x, y, z and 2 to {MAX_POINTS} rows");
                report.push(&at, format!("{}: {message}", path.display()), legal);
            }
        }
    }
}

/// Reads the points of a recorded path from a CSV file with the columns t, w, x, y, z. Fails with a
/// message if the file cannot be read, or has other columns, too many rows, or numbers that are not
/// finite.
fn points(path: &Path) -> Result<Value, String> {
    let text = read_text(path).map_err(|error| error.to_string())?;
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| error.to_string())?;
    if header != vec!["t", "w", "x", "y", "z"] {
        return Err(format!("the first line is {:?}", header.iter().collect::<Vec<_>>().join(",")));
    }
    let mut rows = Vec::new();
    for row in reader.deserialize::<[f64; 5]>() {
        let row = row.map_err(|error| error.to_string())?;
        if rows.len() == MAX_POINTS {
            return Err(format!("more than {MAX_POINTS} rows"));
        }
        if row.iter().any(|x| !x.is_finite()) {
            return Err(format!("row {} has a number that is not finite", rows.len() + 1));
        }
        rows.push(json!(row));
    }
    Ok(Value::Array(rows))
}
