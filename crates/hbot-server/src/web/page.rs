//! The files of the page, which are part of the program. No other machine and no build step has a
//! part in it.

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// A file of the page.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// The value of its header Content-Type.
    pub(super) kind: &'static str,
    pub(super) body: &'static str,
}

/// Lists the files of the page besides the first: their names and types.
macro_rules! parts {
    ($($file:literal: $kind:expr,)*) => {
        &[$((concat!("/", $file), Part { kind: $kind, body: include_str!($file) }),)*]
    };
}

const PARTS: &[(&str, Part)] = parts![
    "controls.js": JAVASCRIPT,
    "hand.js": JAVASCRIPT,
    "icon.svg": "image/svg+xml",
    "link.js": JAVASCRIPT,
    "maths.js": JAVASCRIPT,
    "page.css": "text/css; charset=utf-8",
    "page.js": JAVASCRIPT,
    "plot.js": JAVASCRIPT,
    "rig.js": JAVASCRIPT,
    "schema.js": JAVASCRIPT,
    "sphere.js": JAVASCRIPT,
    "state.js": JAVASCRIPT,
];

const FIRST: Part = Part { kind: "text/html; charset=utf-8", body: include_str!("page.html") };

/// Returns the file at a path. `None` if there is none.
pub(super) fn part(path: &str) -> Option<&'static Part> {
    if path == "/" {
        return Some(&FIRST);
    }
    PARTS.iter().find(|(name, _)| *name == path).map(|(_, part)| part)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what stands between `before` and the next quotation mark, wherever it occurs.
    fn quoted<'a>(text: &'a str, before: &str, end: char) -> Vec<&'a str> {
        text.split(before).skip(1).map(|rest| rest.split(end).next().unwrap()).collect()
    }

    #[test]
    fn everything_that_the_page_asks_for_is_a_part_of_it() {
        let mut asked = quoted(FIRST.body, "href=\"", '"');
        asked.extend(quoted(FIRST.body, "src=\"", '"'));
        asked.extend(PARTS.iter().flat_map(|(_, part)| quoted(part.body, "from './", '\'')));
        assert!(asked.len() > 15, "{asked:?}");
        for file in asked {
            assert!(part(&format!("/{file}")).is_some(), "{file}");
        }
        assert_eq!(part("/page.html"), None);
        assert_eq!(part("/../mod.rs"), None);
    }

    #[test]
    fn every_file_of_the_folder_is_served_and_all_are_small() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/web");
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        let names = names.map(|name| name.into_string().unwrap());
        let files: Vec<String> = names.filter(|name| !name.ends_with(".rs") && name != "page.html").collect();
        assert_eq!(files.len(), PARTS.len(), "{files:?}");
        assert!(files.iter().all(|file| part(&format!("/{file}")).is_some()), "{files:?}");
        let bytes: usize = PARTS.iter().map(|(_, part)| part.body.len()).sum();
        assert!(bytes + FIRST.body.len() <= 200_000, "{bytes} bytes");
    }
}
