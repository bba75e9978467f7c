//! One hash over a list of texts, from which it can be shown that a text is in the list without the others.
//!
//! R. C. Merkle, "A digital signature based on a conventional encryption function" (1987). Leaves and nodes are hashed in different
//! contexts, so that no node passes for a leaf. A node without a partner moves up as it is.

/// The root over texts, in hexadecimal; that of no texts is the hash of nothing.
pub fn root(texts: &[String]) -> String {
    let mut level: Vec<[u8; 32]> =
        texts.iter().map(|text| blake3::derive_key("pdk verdict leaf, version 1", text.as_bytes())).collect();
    while level.len() > 1 {
        level = level
            .chunks(2)
            .map(|pair| match pair {
                [left, right] => blake3::derive_key("pdk verdict node, version 1", &[*left, *right].concat()),
                alone => alone[0],
            })
            .collect();
    }
    let root = level.first().copied().unwrap_or_else(|| *blake3::hash(&[]).as_bytes());
    blake3::Hash::from_bytes(root).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_and_its_place_count() {
        let texts = |list: &[&str]| list.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        for count in 1..9 {
            let all: Vec<String> = (0..count).map(|number| format!("text {number}")).collect();
            for place in 0..count {
                let mut changed = all.clone();
                changed[place].push('!');
                assert_ne!(root(&all), root(&changed));
            }
            assert_ne!(root(&all), root(&[all.clone(), all.clone()].concat()));
        }
        assert_ne!(root(&texts(&["a", "b"])), root(&texts(&["b", "a"])));
        assert_ne!(root(&texts(&["a", "b", "c"])), root(&texts(&["a", "b", "c", "c"])));
        assert_ne!(root(&[]), root(&texts(&[""])));
    }
}
