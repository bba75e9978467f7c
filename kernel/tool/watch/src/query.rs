//! What a browser says in the query of an address: which loop it looks at, and what it knows already.

/// What a browser has of a list that only grows: the generation of the list, and how many of its entries.
pub type Has = (u64, usize);

/// A query.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Query {
    /// The slot of the loop.
    pub slot: Option<u32>,
    /// What is known of the drive under way.
    pub drive: Option<Has>,
    /// What is known of the scenarios.
    pub rows: Option<Has>,
}

impl Query {
    /// Reads a query. What it does not understand it leaves out, so that the browser gets all there is.
    pub fn parse(text: &str) -> Self {
        let has = |value: &str| {
            let (generation, count) = value.split_once('-')?;
            Some((generation.parse().ok()?, count.parse().ok()?))
        };
        let mut query = Self::default();
        for (name, value) in text.split('&').filter_map(|pair| pair.split_once('=')) {
            match name {
                "slot" => query.slot = value.parse().ok(),
                "drive" => query.drive = has(value),
                "rows" => query.rows = has(value),
                _ => {}
            }
        }
        query
    }
}

/// How many entries need not be sent: those that a browser has of a list of this generation and length.
pub fn known(has: Option<Has>, generation: u64, length: usize) -> usize {
    has.filter(|(of, count)| *of == generation && *count <= length).map_or(0, |(_, count)| count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_understood_is_read() {
        let all = Query { slot: Some(2), drive: Some((7, 12)), rows: Some((0, 3)) };
        assert_eq!(Query::parse("slot=2&drive=7-12&rows=0-3"), all);
        assert_eq!(Query::parse(""), Query::default());
        assert_eq!(Query::parse("slot=x&drive=7&rows=1-&other=1"), Query::default());
        assert_eq!(Query::parse("drive=-1-2"), Query::default());
    }

    #[test]
    fn a_browser_gets_what_it_lacks_or_everything() {
        assert_eq!(known(Some((4, 10)), 4, 12), 10);
        // Of another generation, or more than there is.
        assert_eq!((known(Some((3, 10)), 4, 12), known(Some((4, 13)), 4, 12), known(None, 4, 12)), (0, 0, 0));
    }
}
