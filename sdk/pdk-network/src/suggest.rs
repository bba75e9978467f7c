//! "Did you mean": the known name that is nearest to a wrong one.

use pdk_sdk::suggest::nearest;

/// The end of a sentence about an unknown name: what was probably meant, or what there is.
pub fn hint<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    match nearest(wrong, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => {
            let known: Vec<String> = known.into_iter().map(|name| format!("`{name}`")).collect();
            match known.as_slice() {
                [] => "there are none".to_owned(),
                [one] => format!("there is only {one}"),
                all => format!("there are {}", all.join(", ")),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_and_otherwise_all_are_listed() {
        let known = ["mean", "std", "layout"];
        assert_eq!(hint("maen", known), "did you mean `mean`?");
        assert_eq!(hint("zzz", known), "there are `mean`, `std`, `layout`");
        assert_eq!(hint("zzz", ["a"]), "there is only `a`");
    }
}
