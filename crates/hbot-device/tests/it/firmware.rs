//! The code on docs/firmware.md is that of the images and of the Arduino examples.

const PAGE: &str = include_str!("../../../../docs/firmware.md");

const SOURCES: [&str; 4] = [
    include_str!("../../../../firmware/mps2/src/main.rs"),
    include_str!("../../../../firmware/mps2/src/plant.rs"),
    include_str!("../../../../clients/arduino/HbotLink/examples/Loopback/Loopback.ino"),
    include_str!("../../../../clients/arduino/HbotLink/examples/SimpleFOC/SimpleFOC.ino"),
];

/// Returns the words of a text separated by single spaces, so that texts with different line breaks
/// compare equal.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_excerpt_on_the_page_for_firmware_stands_in_the_code() {
    let sources = SOURCES.map(words);
    for (language, count) in [("```rust\n", 3), ("```cpp\n", 2)] {
        let excerpts = PAGE.split(language).skip(1).map(|rest| rest.split("```").next().unwrap_or_default());
        let mut seen = 0;
        for excerpt in excerpts {
            let found = sources.iter().any(|source| source.contains(&words(excerpt)));
            assert!(found, "docs/firmware.md quotes what stands nowhere:\n{excerpt}");
            seen += 1;
        }
        assert_eq!(seen, count, "excerpts in {language}");
    }
}
