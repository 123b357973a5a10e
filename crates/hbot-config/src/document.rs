//! Parses a TOML text or JSON value into a tree of values, and collects mistakes in a [`Report`]
//! that knows the line and column of each value.

use std::collections::HashMap;
use std::ops::Range;

use serde_json::{Map, Value};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::legal::{NUMBER_ALONE, has_unit};

/// The values in a rig file or scene file, as a tree, and the report of the mistakes found in them.
pub(crate) struct Document {
    pub(crate) tree: Value,
    pub(crate) report: Report,
}

/// Collects the mistakes found in a file, and finds the line and column of each.
#[derive(Default)]
pub(crate) struct Report {
    file: Option<String>,
    /// Byte offset of the start of each line of the text.
    line_starts: Vec<usize>,
    text: String,
    places: HashMap<String, Place>,
    /// The values that do not come from the file: the path of each value and the source that
    /// messages name instead, such as a command line option.
    origins: Vec<(String, String)>,
    /// The mistakes found so far, at most [`MOST_MISTAKES`].
    found: Vec<Diagnostic>,
    /// The paths of values with a mistake that are no longer in the tree.
    settled: Vec<String>,
    /// Whether more than [`MOST_MISTAKES`] mistakes were found.
    more: bool,
}

struct Place {
    key: Option<Range<usize>>,
    value: Range<usize>,
}

/// Largest number of mistakes that are reported. It also limits the time spent on a value that is
/// full of mistakes, because any client can send such a value.
const MOST_MISTAKES: usize = 100;

/// Largest number of syntax errors that are reported. Those after the first often follow from it.
const MOST_SYNTAX_ERRORS: usize = 3;

impl Document {
    /// Parses a TOML text into a tree of values. `file` is the name of the file in messages.
    ///
    /// # Errors
    /// Fails if the text is not TOML. A value that the tree cannot hold (nan, inf, a date, an
    /// integer of more than 64 bits) does not fail: it becomes null, and a mistake is added to the
    /// report.
    pub(crate) fn from_toml(text: &str, file: &str) -> Result<Self, Diagnostics> {
        let mut report = Report {
            file: Some(file.to_owned()),
            line_starts: std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect(),
            text: text.to_owned(),
            ..Report::default()
        };
        let (table, errors) = DeTable::parse_recoverable(text);
        if !errors.is_empty() {
            for error in errors.iter().take(MOST_SYNTAX_ERRORS) {
                let (line, column) = error.span().map(|span| report.position(span.start)).unzip();
                let hint = line.and_then(|line| {
                    let line = text.lines().nth(line - 1)?;
                    let begins = column.is_some_and(|c| line.chars().take(c - 1).all(char::is_whitespace));
                    let is_key = begins && line.contains('=') && !line.trim_start().starts_with('{');
                    if is_key && error.message().contains("between array elements") {
                        return Some(" (is a `]` missing before this line?)".to_owned());
                    }
                    syntax_hint(line)
                });
                let hint = hint.unwrap_or_default();
                let message = format!("not TOML: {}{hint}", error.message().replace('\n', ", "));
                let file = report.file.clone();
                let mistake = Diagnostic { file, line, column, path: String::new(), message, legal: None };
                // What follows a bracket that is not closed is no mistake.
                let is_open =
                    ["between array elements", "unclosed"].iter().any(|it| mistake.message.contains(it));
                if !report.found.contains(&mistake) {
                    report.found.push(mistake);
                }
                if is_open {
                    break;
                }
            }
            return Err(Diagnostics::new(report.found));
        }
        let tree = convert_table(table.get_ref(), "", &mut report);
        Ok(Self { tree, report })
    }

    /// Creates a document from a JSON value, with an empty report.
    pub(crate) fn from_json(tree: Value) -> Self {
        Self { tree, report: Report::default() }
    }

    /// Sets the value at `path` (keys joined by dots), and creates missing tables. Error messages
    /// about this value name `from` as its source instead of the file. Does nothing if a parent of
    /// the value is not a table.
    pub(crate) fn replace(&mut self, path: &str, value: Value, from: &str) {
        let mut keys: Vec<&str> = path.split('.').collect();
        let Some(last) = keys.pop() else { return };
        let mut table = &mut self.tree;
        for key in keys {
            let Some(map) = table.as_object_mut() else { return };
            table = map.entry(key).or_insert_with(|| Value::Object(Map::new()));
        }
        if let Some(map) = table.as_object_mut() {
            map.insert(last.to_owned(), value);
            self.report.found.retain(|d| d.path != path);
            self.report.origins.push((path.to_owned(), from.to_owned()));
        }
    }
}

/// Returns what is probably meant by a line that is not TOML.
fn syntax_hint(line: &str) -> Option<String> {
    if line.trim() == "[effect]" {
        return Some(" (write [[effect]] with two brackets, once for each effect)".to_owned());
    }
    let value = line.split_once('=').map_or("", |(_, value)| value.trim());
    if has_unit(value) {
        let degrees = value.split('#').next().unwrap_or_default().trim();
        return Some(if degrees.ends_with("deg") {
            format!(" (write it in quotes: {degrees:?})")
        } else {
            NUMBER_ALONE.to_owned()
        });
    }
    decimal_point(line).map(|right| format!(" (write a decimal point: {right})"))
}

impl Report {
    /// Adds a mistake about the value at `path` to the report. `legal` describes the legal values.
    pub(crate) fn push(&mut self, path: &str, message: impl Into<String>, legal: impl Into<Option<String>>) {
        self.push_at(path, false, message.into(), legal.into());
    }

    /// Adds a mistake about the last key of `path` to the report, such as an unknown key. Its line
    /// and column are those of the key instead of the value.
    pub(crate) fn push_key(
        &mut self,
        path: &str,
        message: impl Into<String>,
        legal: impl Into<Option<String>>,
    ) {
        self.push_at(path, true, message.into(), legal.into());
    }

    /// Returns whether no mistake was found in the value at `path` or in the values that it
    /// contains, apart from [settled](Self::settle) ones.
    pub(crate) fn clean_under(&self, path: &str) -> bool {
        // A full report drops further mistakes, so none of its values can be called clean.
        !self.is_full()
            && !self.found.iter().any(|d| is_under(&d.path, path) && !self.settled.contains(&d.path))
    }

    /// Records that the value with a mistake at `path` has left the tree, so that it does not
    /// hinder later checks.
    pub(crate) fn settle(&mut self, path: &str) {
        self.settled.push(path.to_owned());
    }

    /// Records that the value at `path` is at `new` from now on.
    pub(crate) fn rename(&mut self, path: &str, new: &str) {
        let moved: Vec<String> = self.places.keys().filter(|at| is_under(at, path)).cloned().collect();
        for at in moved {
            if let Some(place) = self.places.remove(&at) {
                self.places.insert(format!("{new}{}", &at[path.len()..]), place);
            }
        }
    }

    /// Returns whether the report is full: it holds [`MOST_MISTAKES`] mistakes, and drops further
    /// ones.
    pub(crate) fn is_full(&self) -> bool {
        self.found.len() == MOST_MISTAKES
    }

    /// Records that mistakes were dropped because the report was full.
    pub(crate) fn more(&mut self) {
        self.more = true;
    }

    /// Returns the name of the file in messages. Returns `None` if the values are not from a file.
    pub(crate) fn file(&self) -> Option<&str> {
        self.file.as_deref()
    }

    /// Returns whether the report contains a mistake at exactly `path`.
    pub(crate) fn knows(&self, path: &str) -> bool {
        self.found.iter().any(|d| d.path == path)
    }

    /// Adds a description of the legal values to the mistake at `path`, unless it already has one.
    pub(crate) fn suggest(&mut self, path: &str, legal: String) {
        if let Some(d) = self.found.iter_mut().find(|d| d.path == path) {
            d.legal.get_or_insert(legal);
        }
    }

    /// Returns `value` if the report contains no mistake.
    ///
    /// # Errors
    /// Fails with all mistakes in the report.
    pub(crate) fn finish<T>(self, value: Option<T>) -> Result<T, Diagnostics> {
        match value {
            Some(value) if self.found.is_empty() => Ok(value),
            _ if self.more => Err(Diagnostics::cut_short(self.found)),
            _ => Err(Diagnostics::new(self.found)),
        }
    }

    fn push_at(&mut self, path: &str, key: bool, message: String, legal: Option<String>) {
        if self.is_full() {
            return self.more();
        }
        let (mut file, mut line, mut column) = (self.file.clone(), None, None);
        if let Some((_, from)) = self.origins.iter().find(|(p, _)| is_under(path, p)) {
            file = Some(from.clone());
        } else if let Some(span) = self.span(path, key) {
            let (l, c) = self.position(span.start);
            (line, column) = (Some(l), Some(c));
        }
        self.found.push(Diagnostic { file, line, column, path: path.to_owned(), message, legal });
    }

    /// Returns the byte range in the text of the value at `path`, or of its key if `key` is true.
    /// For an absent value, returns the range of the nearest table around it, or `None` if there is
    /// no such table.
    fn span(&self, path: &str, key: bool) -> Option<&Range<usize>> {
        let mut path = path;
        while !path.is_empty() {
            if let Some(place) = self.places.get(path) {
                return Some(if key { place.key.as_ref().unwrap_or(&place.value) } else { &place.value });
            }
            path = path.rfind(['.', '[']).map_or("", |end| &path[..end]);
        }
        None
    }

    /// Converts a byte offset in the text to a line and a column, both counted from 1.
    fn position(&self, offset: usize) -> (usize, usize) {
        let line = self.line_starts.partition_point(|&start| start <= offset).max(1);
        let start = self.line_starts[line - 1];
        let column = self.text.get(start..offset).map_or(0, |before| before.chars().count());
        (line, column + 1)
    }
}

/// Returns `path` extended by `key`, with a dot between them. A key that is not legal in TOML
/// without quotes is quoted.
pub(crate) fn join(path: &str, key: &str) -> String {
    let bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    let key = if bare { key.to_owned() } else { format!("{key:?}") };
    if path.is_empty() { key } else { format!("{path}.{key}") }
}

/// Returns the number of a line such as `width = 2,5`, or of its value alone, with a decimal point.
/// Returns `None` if the line is something else.
#[must_use]
pub fn decimal_point(line: &str) -> Option<String> {
    let value = line.split_once('=').map_or(line, |(_, value)| value);
    let value = value.split('#').next().unwrap_or_default().trim();
    let (whole, part) = value.split_once(',')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (digits(whole.trim_start_matches('-')) && digits(part)).then(|| format!("{whole}.{part}"))
}

fn is_under(path: &str, ancestor: &str) -> bool {
    path.strip_prefix(ancestor)
        .is_some_and(|rest| ancestor.is_empty() || rest.is_empty() || rest.starts_with(['.', '[']))
}

fn convert_table(table: &DeTable<'_>, path: &str, report: &mut Report) -> Value {
    let entries = table.iter().map(|(key, value)| {
        let name = key.get_ref().as_ref();
        let converted = convert(value, Some(key.span()), &join(path, name), report);
        (name.to_owned(), converted)
    });
    Value::Object(entries.collect())
}

fn convert(
    value: &Spanned<DeValue<'_>>,
    key: Option<Range<usize>>,
    path: &str,
    report: &mut Report,
) -> Value {
    report.places.insert(path.to_owned(), Place { key, value: value.span() });
    match value.get_ref() {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Boolean(b) => Value::Bool(*b),
        DeValue::Integer(digits) => match i64::from_str_radix(digits.as_str(), digits.radix()) {
            Ok(integer) => integer.into(),
            Err(_) => {
                report.push(path, "an integer of more than 64 bits", None);
                Value::Null
            }
        },
        DeValue::Float(digits) => match digits.as_str().parse().ok().and_then(serde_json::Number::from_f64) {
            Some(number) => Value::Number(number),
            None => {
                report.push(path, format!("{} is not a finite number", digits.as_str()), None);
                Value::Null
            }
        },
        DeValue::Datetime(date) => {
            report.push(path, format!("{date} is a date"), None);
            Value::Null
        }
        DeValue::Array(array) => array
            .iter()
            .enumerate()
            .map(|(i, element)| convert(element, None, &format!("{path}[{i}]"), report))
            .collect(),
        DeValue::Table(table) => convert_table(table, path, report),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_under_its_tables_and_not_under_namesakes() {
        for ancestor in ["", "wheel", "wheel[1]", "wheel[1].steer", "wheel[1].steer.gear"] {
            assert!(is_under("wheel[1].steer.gear", ancestor), "{ancestor}");
        }
        for other in ["whee", "wheel[1].ste", "wheel[10]", "wheel[1].steer.gear.x"] {
            assert!(!is_under("wheel[1].steer.gear", other), "{other}");
        }
    }

    #[test]
    fn columns_count_characters() {
        let document = Document::from_toml("a = 1\r\nb = [\"\u{e9}\u{1d11e}\", nan]", "x").unwrap();
        let found = &document.report.found[0];
        assert_eq!((found.line, found.column, found.path.as_str()), (Some(2), Some(12), "b[1]"));
    }

    #[test]
    fn keys_that_are_not_bare_are_quoted() {
        assert_eq!(join("", "a-b_3"), "a-b_3");
        assert_eq!(join("a", "b.c"), "a.\"b.c\"");
        assert_eq!(join("a", ""), "a.\"\"");
    }
}
