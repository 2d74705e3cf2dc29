//! Owns the search for the known name that a misspelt one meant.

/// Most names that are compared: a hint must not cost more than the document.
const COMPARED: usize = 4096;

/// The nearest of the known names, when one is near enough to be meant.
pub(super) fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = found.chars().take(129).count();
    if length > 128 {
        return None;
    }
    let allowed = length / 3 + 1;
    let near =
        known.into_iter().take(COMPARED).filter(|name| name.len().abs_diff(found.len()) <= allowed * 4);
    near.map(|name| (strsim::damerau_levenshtein(found, name), name))
        .filter(|&(distance, _)| distance <= allowed && distance < length.max(2))
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn finds_what_was_meant() {
        let known = ["width", "height", "filter", "exposure"];
        for (found, meant) in [
            ("widht", Some("width")),
            ("Filter", Some("filter")),
            ("expo", None),
            ("hieght", Some("height")),
            ("x", None),
            ("", None),
        ] {
            assert_eq!(nearest(found, known), meant, "{found}");
        }
        assert_eq!(nearest(&"w".repeat(1 << 20), known), None);
    }
}
