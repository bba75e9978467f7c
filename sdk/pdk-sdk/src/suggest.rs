//! "Did you mean": the known name that is nearest to a wrong one.

/// The nearest of `known` to `wrong`, if it is near enough to be what was meant.
pub fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wrong = wrong.to_lowercase();
    known
        .into_iter()
        .map(|name| {
            let lower = name.to_lowercase();
            let similarity = strsim::jaro_winkler(&wrong, &lower);
            // A part of a name counts as near: `noise` means one of the noises, `rain` the rain filter.
            let part = wrong.len() > 2 && lower.contains(&wrong);
            (if part { similarity.max(0.9) } else { similarity }, name)
        })
        .filter(|(similarity, _)| *similarity > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(a.1)))
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_that_was_meant_is_found() {
        let known = ["gaussian_noise", "gaussian_blur", "contrast", "fog_filter"];
        assert_eq!(nearest("gausian_noise", known), Some("gaussian_noise"));
        assert_eq!(nearest("Contrast", known), Some("contrast"));
        assert_eq!(nearest("fog", known), Some("fog_filter"));
        assert_eq!(nearest("zzz", known), None);
    }
}
