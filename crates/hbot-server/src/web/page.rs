//! The files of the page, which are part of the program.

/// A file of the page.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// The value of its header Content-Type.
    pub(super) kind: &'static str,
    pub(super) body: &'static str,
}

/// Returns the file at a path. `None` if there is none.
pub(super) fn part(path: &str) -> Option<Part> {
    let (kind, body) = match path {
        "/" => ("text/html; charset=utf-8", include_str!("page.html")),
        "/page.js" => ("text/javascript; charset=utf-8", include_str!("page.js")),
        "/page.css" => ("text/css; charset=utf-8", include_str!("page.css")),
        _ => return None,
    };
    Some(Part { kind, body })
}
