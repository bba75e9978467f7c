//! Which entries of a verdict are driven again, and what that says about the others.

use pdk_sdk::seed::Key;

/// The places of `count` of `entries`, in order: all if there are no more. They follow from the root of the verdict and from a text of
/// the person who verifies it, so they are not known before the verdict is complete.
pub fn drawn(root: &str, text: &str, entries: usize, count: usize) -> Vec<usize> {
    let mut hasher = blake3::Hasher::new_derive_key("pdk verdict probes, version 1");
    for part in [root, text] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    let mut places: Vec<usize> = (0..entries).collect();
    Key(*hasher.finalize().as_bytes()).sequence().shuffle(&mut places);
    places.truncate(count);
    places.sort_unstable();
    places
}

/// The probability with which `count` probes find a false entry if there are `wrong` false ones among `entries`: that of drawing at least
/// one of them without putting any back.
pub fn found(entries: usize, wrong: usize, count: usize) -> f64 {
    let missed = (0..count.min(entries)).map(|drawn| {
        let left = (entries - drawn) as f64;
        ((left - wrong as f64) / left).max(0.0)
    });
    1.0 - missed.product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_follow_from_the_root_and_the_text() {
        let all = drawn("root", "", 100, 20);
        assert_eq!(all, drawn("root", "", 100, 20));
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]) && all.len() == 20);
        assert!(all != drawn("root2", "", 100, 20) && all != drawn("root", "mine", 100, 20));
        assert_eq!(drawn("root", "", 5, 59), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn the_probability_is_that_of_the_urn() {
        assert!((found(200, 1, 59) - 59.0 / 200.0).abs() < 1e-12);
        // 1 - (8/10 * 7/9 * 6/8)
        assert!((found(10, 2, 3) - (1.0 - 336.0 / 720.0)).abs() < 1e-12);
        // Five in a hundred of very many are found by 59 probes in 95 of 100 cases.
        assert!((found(1_000_000, 50_000, 59) - 0.9515).abs() < 1e-3);
        assert_eq!((found(10, 1, 10), found(10, 0, 5), found(10, 1, 50)), (1.0, 0.0, 1.0));
    }

    /// One forged entry among 200, in 1,000 verdicts with roots of their own.
    #[test]
    fn a_forged_entry_is_found_as_often_as_stated() {
        let (entries, probes, trials) = (200, 59, 1000);
        let hit = |trial: u64| {
            let root = blake3::hash(&trial.to_le_bytes()).to_hex().to_string();
            let forged = (trial * 7919 % entries as u64) as usize;
            drawn(&root, "", entries, probes).contains(&forged)
        };
        let hits = (0..trials).filter(|trial| hit(*trial)).count() as f64 / trials as f64;
        let stated = found(entries, 1, probes);
        println!("found in {:.1} % of {trials} trials, stated {:.1} %", 100.0 * hits, 100.0 * stated);
        // Three standard deviations.
        assert!(
            (hits - stated).abs() < 3.0 * libm::sqrt(stated * (1.0 - stated) / trials as f64),
            "{hits} {stated}"
        );
    }

    /// A twentieth of the entries forged.
    #[test]
    fn many_forged_entries_are_seldom_missed() {
        let (entries, wrong) = (400, 20);
        let hit = |trial: u64| {
            let root = blake3::hash(&trial.to_le_bytes()).to_hex().to_string();
            let forged = drawn(&root, "what the forger changed", entries, wrong);
            drawn(&root, "", entries, 59).iter().any(|place| forged.contains(place))
        };
        let hits = (0..1000).filter(|trial| hit(*trial)).count() as f64 / 1000.0;
        assert!((hits - found(entries, wrong, 59)).abs() < 0.02, "{hits}");
    }
}
