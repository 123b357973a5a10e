//! Writing a report into a folder: all of its files or none.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::{Figure, Report};
use crate::WriteError;

impl Report {
    /// Returns the whole report as Markdown text.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("# `hbot-study {}`\n\n", self.study);
        text.push_str(&self.beginning());
        let quick = if self.quick { ", with `--quick`: fewer samples" } else { "" };
        let machine = self.machine.sentence();
        text.push_str(&format!("\n## This run\n\n{machine} Took {:.0} s{quick}.\n\n", self.seconds));
        text.push_str(&self.body);
        text.push_str("\n## Checks\n\nThe command's exit code is 0 only where all of them hold.\n\n");
        text.push_str("| what must hold | found | holds |\n|---|---|---|\n");
        for check in &self.checks {
            let verdict = if check.holds { "yes" } else { "**no**" };
            text.push_str(&format!("| {} | {} | {verdict} |\n", check.what, check.found));
        }
        text.push_str("\n## What the ids of summary.json mean\n\n| id | unit | meaning |\n|---|---|---|\n");
        for family in &self.families {
            text.push_str(&format!("| `{}` | {} | {} |\n", family.pattern, family.unit, family.meaning));
        }
        text.push_str(
            "\nA time also has `q1` and `q3`, its quartiles, and `samples`, how many there were.\n",
        );
        text
    }

    /// Returns the content of `summary.json`: the machine, all figures and all checks.
    #[must_use]
    pub fn summary(&self) -> Value {
        json!({
            "study": self.study,
            "version": env!("CARGO_PKG_VERSION"),
            "machine": self.machine.to_json(),
            "seconds": self.seconds,
            "quick": self.quick,
            "others_share": self.others,
            "in_short": self.conclusions(),
            "results": self.figures.iter().map(Figure::to_json).collect::<Vec<_>>(),
            "checks": self.checks.iter().map(|check| json!({
                "what": check.what, "found": check.found, "holds": check.holds,
            })).collect::<Vec<_>>(),
        })
    }

    /// Writes all files of the report into the folder `out`. Each file is first written under a
    /// temporary name. When all are written, each is renamed, so that a failure leaves no
    /// incomplete file under a final name.
    pub(crate) fn write(&self, out: &Path) -> Result<(), WriteError> {
        let mut files =
            vec![("report.md".to_owned(), self.markdown()), ("report.html".to_owned(), self.html())];
        files.extend(self.plots.iter().map(|plot| (format!("{}.svg", plot.name), plot.svg.clone())));
        files.extend(self.files.iter().cloned());
        // summary.json is last, so that it exists only if all other files do.
        files.push(("summary.json".to_owned(), format!("{:#}\n", self.summary())));
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| WriteError { path, source }
        };
        std::fs::create_dir_all(out).map_err(failed(out))?;
        let partial = |name: &str| out.join(format!(".{name}.partial"));
        for (name, text) in &files {
            std::fs::write(partial(name), text).map_err(failed(&partial(name)))?;
        }
        for (name, _) in &files {
            std::fs::rename(partial(name), out.join(name)).map_err(failed(&out.join(name)))?;
        }
        Ok(())
    }
}

impl Figure {
    fn to_json(&self) -> Value {
        let mut all = Map::new();
        all.insert("id".to_owned(), self.id.clone().into());
        // A number that is not finite becomes `null`, as JSON cannot represent it.
        all.insert("value".to_owned(), self.value.into());
        all.insert("unit".to_owned(), self.unit.into());
        all.extend(self.more.clone());
        Value::Object(all)
    }
}
