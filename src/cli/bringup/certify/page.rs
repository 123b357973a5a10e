//! A page of headings, sentences, tables and plots, as Markdown and as HTML that needs no other
//! file.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, ensure};

use super::NOT;

/// The files of a page. Not every page has both plots.
pub(super) const FILES: [&str; 4] = ["certificate.md", "certificate.html", "drift.svg", "stiffness.svg"];
/// Style sheet of the HTML page.
const STYLE: &str = "\
:root { color-scheme: light dark }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; display: block; overflow-x: auto; margin: 1rem 0; font-size: 0.9rem }
th, td { border: 1px solid #8886; padding: 0.2rem 0.6rem; text-align: left; vertical-align: top }
th { background: #8882 }
svg { max-width: 100%; height: auto; background: white }
";

pub(super) struct Page {
    title: String,
    blocks: Vec<Block>,
}

enum Block {
    Heading(String),
    Sentence(String),
    Table { head: Vec<String>, rows: Vec<Vec<String>> },
    Plot { name: String, caption: String, svg: String },
}

impl Page {
    pub(super) fn new(title: &str) -> Self {
        Self { title: title.to_owned(), blocks: Vec::new() }
    }

    pub(super) fn heading(&mut self, text: &str) {
        self.blocks.push(Block::Heading(text.to_owned()));
    }

    pub(super) fn say(&mut self, text: &str) {
        self.blocks.push(Block::Sentence(text.to_owned()));
    }

    pub(super) fn table(&mut self, head: &[&str], rows: Vec<Vec<String>>) {
        self.blocks.push(Block::Table { head: head.iter().map(|&cell| cell.to_owned()).collect(), rows });
    }

    pub(super) fn plot(&mut self, name: &str, caption: &str, svg: String) {
        self.blocks.push(Block::Plot { name: name.to_owned(), caption: caption.to_owned(), svg });
    }

    /// Returns how many figures of the tables have a value, and for each reason why others have
    /// none the names of these.
    pub(super) fn measured(&self) -> (usize, Vec<(&str, Vec<&str>)>) {
        let (mut with, mut without) = (0, Vec::<(&str, Vec<&str>)>::new());
        for block in &self.blocks {
            let Block::Table { rows, .. } = block else { continue };
            for row in rows {
                let [name, value, .., why] = row.as_slice() else { continue };
                if value != NOT {
                    with += 1;
                } else if let Some((_, names)) = without.iter_mut().find(|(other, _)| other == why) {
                    names.push(name);
                } else {
                    without.push((why, vec![name]));
                }
            }
        }
        (with, without)
    }

    /// Fails if a file of a page is in the folder `out`.
    pub(super) fn refuse_another(out: &Path) -> anyhow::Result<()> {
        for file in FILES {
            ensure!(
                !out.join(file).exists(),
                "{}: {file} is there already. Name another folder by --out, or remove it first",
                out.display()
            );
        }
        Ok(())
    }

    /// Writes certificate.md with its plots, and certificate.html, into the folder `out`.
    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        let put = |name: &str, text: &str| {
            let path = out.join(name);
            std::fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))
        };
        std::fs::create_dir_all(out).with_context(|| format!("{}: cannot be made", out.display()))?;
        let [markdown, html, ..] = FILES;
        put(markdown, &self.markdown())?;
        put(html, &self.html())?;
        for block in &self.blocks {
            if let Block::Plot { name, svg, .. } = block {
                put(&format!("{name}.svg"), svg)?;
            }
        }
        Ok(())
    }

    fn markdown(&self) -> String {
        let mut text = format!("# {}\n", self.title);
        let row = |cells: &[String]| {
            format!(
                "| {} |\n",
                cells.iter().map(|cell| cell.replace('|', "\\|")).collect::<Vec<_>>().join(" | ")
            )
        };
        for block in &self.blocks {
            // Writing to a string cannot fail.
            let _ = match block {
                Block::Heading(heading) => write!(text, "\n## {heading}\n"),
                Block::Sentence(sentence) => write!(text, "\n{sentence}\n"),
                Block::Table { head, rows } => {
                    let rows: String = rows.iter().map(|cells| row(cells)).collect();
                    write!(text, "\n{}|{}\n{rows}", row(head), "---|".repeat(head.len()))
                }
                Block::Plot { name, caption, .. } => {
                    write!(text, "\n![{caption}]({name}.svg)\n\n{caption}\n")
                }
            };
        }
        text
    }

    fn html(&self) -> String {
        let title = escaped(&self.title);
        let mut text = format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n<h1>{title}</h1>\n"
        );
        let row = |cells: &[String], tag: &str| {
            let cells: String =
                cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
            format!("<tr>{cells}</tr>\n")
        };
        for block in &self.blocks {
            let _ = match block {
                Block::Heading(heading) => writeln!(text, "<h2>{}</h2>", escaped(heading)),
                Block::Sentence(sentence) => writeln!(text, "<p>{}</p>", escaped(sentence)),
                Block::Table { head, rows } => {
                    let rows: String = rows.iter().map(|cells| row(cells, "td")).collect();
                    writeln!(text, "<table>\n{}{rows}</table>", row(head, "th"))
                }
                Block::Plot { caption, svg, .. } => {
                    let svg = svg.find("<svg").map_or("", |start| &svg[start..]);
                    writeln!(text, "{svg}\n<p>{}</p>", escaped(caption))
                }
            };
        }
        text + "</html>\n"
    }
}

/// Replaces the characters that HTML gives a meaning. A rig file may have any name.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_without_a_value_are_counted_by_their_reason() {
        let mut page = Page::new("Rig");
        let row = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        page.table(&["figure", "value", "how"], vec![row(["a", "1", "so"]), row(["b", NOT, "no hand"])]);
        page.table(&["figure", "value", "how"], vec![row(["c", NOT, "off"]), row(["d", NOT, "no hand"])]);
        assert_eq!(page.measured(), (1, vec![("no hand", vec!["b", "d"]), ("off", vec!["c"])]));
    }

    #[test]
    fn a_page_is_the_same_in_both_forms_and_a_name_can_do_nothing_to_it() {
        let mut page = Page::new("<b>Rig");
        page.heading("Geometry");
        page.table(&["figure", "value"], vec![vec!["a | b".to_owned(), "1 < 2".to_owned()]]);
        page.plot("drift", "It drifts", "<?xml?>\n<svg><text>x</text></svg>".to_owned());
        let (markdown, html) = (page.markdown(), page.html());
        assert!(markdown.contains("| a \\| b | 1 < 2 |") && markdown.contains("![It drifts](drift.svg)"));
        assert!(html.contains("<h1>&lt;b&gt;Rig</h1>") && html.contains("<td>1 &lt; 2</td>"), "{html}");
        assert!(html.contains("<svg><text>x</text></svg>") && !html.contains("<?xml"), "{html}");
    }
}
