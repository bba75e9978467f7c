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

/// The end of a sentence about an unknown name: what was probably meant, or what there is.
pub fn hint<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some(name) = nearest(wrong, known.clone()) {
        return format!("did you mean `{name}`?");
    }
    let known: Vec<_> = known.into_iter().collect();
    match known.len() {
        0 => "there are none".to_owned(),
        1 => format!("there is only {}", known[0]),
        2..=30 => format!("there are {}", known.join(", ")),
        _ => "`pdk list` shows what there is".to_owned(),
    }
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

    #[test]
    fn the_nearest_name_is_suggested_and_otherwise_what_there_is() {
        assert_eq!(hint("gausian_noise", ["gaussian_noise", "contrast"]), "did you mean `gaussian_noise`?");
        assert_eq!(hint("zzz", ["a", "b"]), "there are a, b");
        assert_eq!(hint("zzz", ["a"]), "there is only a");
    }
}
