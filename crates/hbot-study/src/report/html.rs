//! The report as one HTML file that contains its plots and needs no other file.

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd, html};

use super::{Plot, Report};

/// Style sheet of the HTML report. It uses light or dark colours as the reader's system does, and
/// lets wide tables scroll.
const STYLE: &str = "\
:root { color-scheme: light dark }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; display: block; overflow-x: auto; margin: 1rem 0; font-size: 0.9rem }
th, td { border: 1px solid #8886; padding: 0.2rem 0.6rem; text-align: left; vertical-align: top }
th { background: #8882 }
code { font-size: 0.9em; overflow-wrap: anywhere }
svg { max-width: 100%; height: auto; background: white }
";

impl Report {
    /// Returns the report as one HTML page that contains all plots.
    #[must_use]
    pub fn html(&self) -> String {
        let markdown = self.markdown();
        let mut within_image = false;
        // The alternative text of an image is left out: the caption below the plot says it too.
        let events = Parser::new_ext(&markdown, Options::ENABLE_TABLES).filter_map(|event| match event {
            Event::Start(Tag::Image { dest_url, .. }) => {
                within_image = true;
                Some(Event::InlineHtml(self.inline(&dest_url).into()))
            }
            Event::End(TagEnd::Image) => {
                within_image = false;
                None
            }
            _ if within_image => None,
            other => Some(other),
        });
        let mut body = String::new();
        html::push_html(&mut body, events);
        let study = self.study;
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n\
             <title>hbot-study {study}</title>\n<style>\n{STYLE}</style>\n{body}</html>\n"
        )
    }

    /// Returns the plot that is stored in the file `name`, as SVG text to embed in HTML. The XML
    /// declaration is left out, because it is only allowed at the start of a file.
    fn inline(&self, name: &str) -> String {
        let plot = self.plots.iter().find(|plot| name.strip_suffix(".svg") == Some(plot.name.as_str()));
        let Some(Plot { svg, .. }) = plot else {
            unreachable!("the report names no plot that it does not have: {name}")
        };
        svg.find("<svg").map_or("", |start| &svg[start..]).to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_tables_and_text_are_in_one_page_that_needs_no_file() {
        let mut report = Report::new("accuracy", true);
        report.heading("Drift < 1 & so on");
        report.table(&[vec!["a".into(), "b".into()], vec!["1".into(), "2".into()]]);
        let svg = "<?xml version=\"1.0\"?>\n<svg width=\"2\" height=\"1\" viewBox=\"0 0 2 1\"><text>here</text></svg>\n";
        report.plot("curve", "A *curve*", svg.to_owned());
        let page = report.html();
        assert!(page.contains("<h2>Drift &lt; 1 &amp; so on</h2>"), "{page}");
        assert!(page.contains("<th>a</th><th>b</th>") && page.contains("<td>2</td>"), "{page}");
        assert_eq!(page.matches("<svg").count(), 1, "{page}");
        assert!(!page.contains("<img") && !page.contains("<?xml") && !page.contains("curve.svg"), "{page}");
        assert!(page.contains("<text>here</text></svg>"), "{page}");
    }
}
