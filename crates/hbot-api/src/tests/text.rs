//! Tests of the characters that are allowed in a name.

use crate::{Encoding, Plain, Request, is_plain};

#[test]
fn what_hides_or_turns_text_is_not_plain() {
    let hidden = "\n\r\t\u{1b}\u{7f}\u{85}\u{9b}\u{ad}\u{200b}\u{200d}\u{200e}\u{2028}\u{2029}\u{202a}\u{202e}\u{2066}\u{2069}\
                  \u{feff}\u{e0041}";
    for c in hidden.chars() {
        assert!(!is_plain(c), "{c:?}");
        let hello = serde_json::json!({"op": "hello", "version": 1, "name": format!("a{c}b")}).to_string();
        let refused = Request::read(Encoding::Json, hello.as_bytes()).unwrap_err().error.message;
        assert!(refused.contains("without control or invisible characters"), "{refused}");
        assert!(refused.chars().all(is_plain), "{refused:?}");
        assert!(Plain(&c.to_string()).to_string().chars().all(is_plain));
    }
    for text in ["Zoë's \"rig\" \\ 1", "हिन्दी", "山田\u{3000}太郎", "e\u{301}", "😀", "مرحبا"]
    {
        assert!(text.chars().all(is_plain), "{text}");
        assert_eq!(Plain(text).to_string(), text);
    }
}
