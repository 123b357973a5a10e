//! The tests that docs/internals/guards.md names exist.

use std::path::Path;

fn sources(folder: &Path, into: &mut String) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs" || e == "py") {
            into.push_str(&std::fs::read_to_string(&path).expect("readable"));
        }
    }
}

#[test]
fn every_test_that_the_page_names_is_there() {
    let mut code = String::new();
    for folder in ["clients", "crates", "examples", "src", "tests"] {
        sources(Path::new(folder), &mut code);
    }
    let page = std::fs::read_to_string("docs/internals/guards.md").expect("readable");
    let mut named = 0;
    for row in page.lines().filter(|line| line.starts_with('|')) {
        let before = named;
        let shown = row.trim_end_matches('|').rsplit('|').next().unwrap_or_default();
        for name in shown.split('`').skip(1).step_by(2) {
            let is_test = name.matches('_').count() >= 3 && !name.contains(['/', '.', ' ']);
            if is_test {
                named += 1;
                let there = [format!("fn {name}()"), format!("def {name}(")];
                assert!(there.iter().any(|it| code.contains(it)), "guards.md names {name}, which is no test");
            }
        }
        let heading = shown.contains("shown by") || shown.contains("---");
        assert!(heading || named > before, "no test by name: {row}");
    }
    assert!(named > 30, "{named} tests are named");
}
