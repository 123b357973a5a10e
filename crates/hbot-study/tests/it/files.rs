//! The files that a study leaves in its folder: all of them or none.

use hbot_study::{Study, StudyOptions, run};
use serde_json::Value;

use crate::options;

#[test]
fn a_study_leaves_a_report_plots_and_a_summary() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("deep/down");
    let options = StudyOptions { out: Some(out.clone()), ..options() };
    let (report, place) = run(Study::Effects, &options).expect("it runs");
    assert_eq!(place, out);
    let text = std::fs::read_to_string(out.join("report.md")).expect("a report");
    let plots: Vec<&str> = text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert!(!plots.is_empty());
    for plot in plots {
        let svg = std::fs::read_to_string(out.join(plot)).expect("a plot that the report shows");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{plot}");
    }
    let summary = std::fs::read_to_string(out.join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["study"], "effects");
    assert_eq!(summary["version"], env!("CARGO_PKG_VERSION"));
    assert!(summary["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0));
    for key in ["cpu", "cores", "os", "rustc", "profile"] {
        assert!(!summary["machine"][key].is_null(), "machine.{key}");
    }
    let results = summary["results"].as_array().expect("a flat list");
    assert_eq!(results.len(), report.figures().len());
    for result in results {
        assert!(
            result["id"].is_string() && result["value"].is_number() && result["unit"].is_string(),
            "{result}"
        );
    }
    // Times are marked if the program was not compiled for speed.
    let time = results.iter().find(|r| r["id"] == "effects_none_ns").expect("a time");
    assert_eq!(time["marked"].is_null(), !cfg!(debug_assertions), "{time}");
    for file in std::fs::read_dir(&out).expect("a folder") {
        let name = file.expect("an entry").file_name();
        assert!(!name.to_string_lossy().ends_with(".partial"), "{name:?} is left over");
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let options = StudyOptions { out: Some(file.path().join("below")), ..options() };
    let error = run(Study::Effects, &options).expect_err("a file is no folder");
    assert!(error.to_string().contains("below"), "{error}");
}
