//! Owns the table of named things: an insertion-ordered map from names to values.

/// Named things in the order in which the document names them.
#[derive(Debug, Clone, PartialEq)]
pub struct Named<T> {
    entries: Vec<(String, T)>,
    /// Positions in `entries`, sorted by name.
    by_name: Vec<u32>,
}

impl<T> Named<T> {
    /// Number of entries.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there are no entries.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Names and values in the order of the document.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&str, &T)> {
        self.entries.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// Values in the order of the document.
    pub fn values(&self) -> impl ExactSizeIterator<Item = &T> {
        self.entries.iter().map(|(_, value)| value)
    }

    /// The value of that name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.index_of(name).map(|index| &self.entries[index].1)
    }

    /// Position of a name in the order of the document.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        let found =
            self.by_name.binary_search_by(|&at| self.entries[at as usize].0.as_str().cmp(name)).ok()?;
        Some(self.by_name[found] as usize)
    }
}

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), by_name: Vec::new() }
    }
}

impl<T> FromIterator<(String, T)> for Named<T> {
    /// Collects entries; of two with one name the search finds either.
    fn from_iter<I: IntoIterator<Item = (String, T)>>(entries: I) -> Self {
        let entries: Vec<(String, T)> = entries.into_iter().collect();
        let mut by_name: Vec<u32> = (0..entries.len() as u32).collect();
        by_name.sort_by(|&a, &b| entries[a as usize].0.cmp(&entries[b as usize].0));
        Self { entries, by_name }
    }
}

#[cfg(test)]
mod tests {
    use super::Named;

    #[test]
    fn names_keep_their_order_and_are_found() {
        let named: Named<u8> =
            [("zinc", 1), ("ash", 2), ("moss", 3)].map(|(n, v)| (n.to_owned(), v)).into_iter().collect();
        assert_eq!(named.iter().map(|(n, _)| n).collect::<Vec<_>>(), ["zinc", "ash", "moss"]);
        assert_eq!(
            (named.index_of("zinc"), named.index_of("moss"), named.index_of("rust")),
            (Some(0), Some(2), None)
        );
        assert_eq!(named.get("ash"), Some(&2));
    }
}
