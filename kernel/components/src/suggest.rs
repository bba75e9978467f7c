//! "Did you mean": the known name that is nearest to a wrong one.

use pdk_sdk::suggest::nearest;

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
    fn the_nearest_name_is_suggested_and_otherwise_what_there_is() {
        assert_eq!(hint("gausian_noise", ["gaussian_noise", "contrast"]), "did you mean `gaussian_noise`?");
        assert_eq!(hint("zzz", ["a", "b"]), "there are a, b");
        assert_eq!(hint("zzz", ["a"]), "there is only a");
    }
}
