//! Rules for the ids of figures.

/// Converts a type's name to a part of a figure's id: `SemiImplicitEuler` becomes
/// `semi_implicit_euler`.
pub(crate) fn snake(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// Returns whether `id` is written in lower_snake_case, as every id of a figure must be.
pub(crate) fn is_id(id: &str) -> bool {
    id.starts_with(|c: char| c.is_ascii_lowercase())
        && id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}

/// Returns whether `id` fits `pattern`. Each `{...}` in the pattern stands for any text that is not
/// empty.
pub(crate) fn matches(pattern: &str, id: &str) -> bool {
    match pattern.split_once('{') {
        None => pattern == id,
        Some((start, rest)) => {
            let Some(id) = id.strip_prefix(start) else { return false };
            let Some((_, rest)) = rest.split_once('}') else { return false };
            (1..=id.len()).any(|k| id.is_char_boundary(k) && matches(rest, &id[k..]))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_ids() {
        assert_eq!(snake("SemiImplicitEuler"), "semi_implicit_euler");
        assert_eq!(snake("Rk4"), "rk4");
        assert!(is_id("plant_rk4_1000us_error_rad"));
        assert!(!is_id("Plant") && !is_id("") && !is_id("4_wheels") && !is_id("a-b"));
    }

    #[test]
    fn a_pattern_takes_its_family_alone() {
        assert!(matches("plant_{method}_{step}us_error_rad", "plant_semi_implicit_euler_1000us_error_rad"));
        assert!(!matches("plant_{method}_{step}us_error_rad", "plant_rk4_us_error_rad"));
        assert!(!matches("tick_{preset}_ns", "tick_fast_max_hz"));
        assert!(matches("seconds", "seconds") && !matches("seconds", "second"));
    }
}
