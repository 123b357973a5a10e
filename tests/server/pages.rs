//! The pages of the project refer to each other correctly: links, headings and the index.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

/// Pages outside docs/.
const AT_THE_ROOT: [&str; 5] =
    ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SAFETY.md", "CHANGELOG.md"];

/// A page as its reader sees it.
struct Page {
    path: PathBuf,
    links: Vec<String>,
    /// Anchors of the page's headings.
    anchors: BTreeSet<String>,
    /// Prose outside tables, links and code blocks.
    prose: Vec<String>,
    /// Words in inline code, also in tables.
    code: Vec<String>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn found_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let of = |path: PathBuf| match path.extension() {
        _ if path.is_dir() => found_in(&path),
        Some(extension) if extension == "md" => vec![path],
        _ => Vec::new(),
    };
    entries.flat_map(of).collect()
}

fn pages() -> Vec<Page> {
    let mut paths = found_in(&root().join("docs"));
    paths.extend(AT_THE_ROOT.map(|name| root().join(name)));
    paths.sort();
    paths.into_iter().map(read).collect()
}

/// Returns the anchor of a heading, as sites that show Markdown generate it.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn read(path: PathBuf) -> Page {
    let text = std::fs::read_to_string(&path).expect("a page");
    let mut page =
        Page { path, links: Vec::new(), anchors: BTreeSet::new(), prose: Vec::new(), code: Vec::new() };
    let (mut heading, mut apart) = (String::new(), 0);
    for event in Parser::new_ext(&text, Options::ENABLE_TABLES) {
        if let Event::Code(words) = &event {
            page.code.push(words.to_string());
        }
        match event {
            Event::Start(Tag::Heading { .. }) => heading.clear(),
            Event::End(TagEnd::Heading(_)) => _ = page.anchors.insert(anchor(&heading)),
            Event::Start(
                tag @ (Tag::Link { .. } | Tag::Image { .. } | Tag::Table(_) | Tag::CodeBlock(_)),
            ) => {
                apart += 1;
                if let Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. } = tag {
                    page.links.push(dest_url.into_string());
                }
            }
            Event::End(TagEnd::Link | TagEnd::Image | TagEnd::Table | TagEnd::CodeBlock) => apart -= 1,
            Event::Text(words) | Event::Code(words) => {
                heading.push_str(&words);
                if apart == 0 {
                    page.prose.push(words.into_string());
                }
            }
            _ => {}
        }
    }
    page
}

/// Returns the file and the anchor to which a link of `page` leads, or `None` for another site.
fn target<'a>(page: &Page, link: &'a str) -> Option<(PathBuf, Option<&'a str>)> {
    if link.contains("://") {
        return None;
    }
    let (file, anchor) = link.split_once('#').map_or((link, None), |(file, anchor)| (file, Some(anchor)));
    let folder = page.path.parent().expect("a page is in a folder");
    let file = if file.is_empty() { page.path.clone() } else { folder.join(file) };
    Some((file, anchor))
}

#[test]
fn every_link_leads_to_a_file_and_its_heading() {
    let mut wrong = Vec::new();
    let pages = pages();
    let mut looked_at = 0;
    for page in &pages {
        for link in &page.links {
            let Some((file, anchor)) = target(page, link) else { continue };
            looked_at += 1;
            let Ok(file) = file.canonicalize() else {
                wrong.push(format!("{}: {link} leads nowhere", page.path.display()));
                continue;
            };
            let Some(anchor) = anchor else { continue };
            let to = pages.iter().find(|page| page.path.canonicalize().is_ok_and(|path| path == file));
            if !to.is_some_and(|to| to.anchors.contains(anchor)) {
                wrong.push(format!("{}: {link} leads to no heading", page.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(looked_at > 50, "{looked_at} links");
}

#[test]
fn the_index_names_every_page() {
    let docs = root().join("docs");
    let index = read(docs.join("README.md"));
    let named: BTreeSet<PathBuf> =
        index.links.iter().filter_map(|link| target(&index, link)?.0.canonicalize().ok()).collect();
    for page in pages().into_iter().filter(|page| page.path != index.path) {
        let path = page.path.canonicalize().expect("it has been read");
        assert!(named.contains(&path), "docs/README.md does not name {}", page.path.display());
    }
    let readme = read(root().join("README.md"));
    assert!(readme.links.iter().any(|link| link == "docs/README.md"), "README.md does not lead to the index");
}

/// A page that prose mentions is a link, so that a reader can follow it. Exceptions are the change
/// log, which describes pages as they were, and reports, which programs write.
#[test]
fn other_pages_that_prose_names_are_links() {
    let pages = pages();
    let names: Vec<&str> = pages.iter().filter_map(|page| page.path.file_name()?.to_str()).collect();
    let mut bare = Vec::new();
    for page in &pages {
        let own = page.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if ["CHANGELOG.md", "report.md"].contains(&own) {
            continue;
        }
        for words in &page.prose {
            let words = words.split(|c: char| !(c.is_alphanumeric() || "./_-".contains(c)));
            let named = words.filter_map(|word| word.trim_end_matches('.').rsplit('/').next());
            let others = named.filter(|name| *name != own && *name != "report.md" && names.contains(name));
            bare.extend(others.map(|name| format!("{} names {name} without a link", page.path.display())));
        }
    }
    assert!(bare.is_empty(), "{}", bare.join("\n"));
}

/// A path in inline code exists in this repository, unless a word in capitals stands for a part of
/// it.
#[test]
fn paths_of_crates_that_pages_name_exist() {
    let mut wrong = Vec::new();
    let mut looked_at = 0;
    for page in pages().iter().filter(|page| !page.path.ends_with("CHANGELOG.md")) {
        let paths = page.code.iter().filter(|code| code.starts_with("crates/") && !code.contains("NAME"));
        for path in paths {
            looked_at += 1;
            if !root().join(path).exists() {
                wrong.push(format!("{} names {path}, which does not exist", page.path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(looked_at > 20, "{looked_at} paths");
}
