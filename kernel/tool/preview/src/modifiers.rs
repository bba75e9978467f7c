//! What every perturbation takes besides its own parameters, for people. [`MODIFIERS`] is the list, from which the help, `pdk show`, the
//! reference, the guide and the types for editors are written.

use pdk_model::perturbation::{MODIFIERS, Modifier};

/// One line that names them all.
pub fn names() -> String {
    MODIFIERS.iter().map(|modifier| modifier.name).collect::<Vec<_>>().join(", ")
}

/// All of them as text for a terminal.
pub fn help() -> String {
    let mut text = String::from("Every perturbation also takes, like parameters:\n");
    for modifier in MODIFIERS {
        text += &format!("\n  {}\n      {}", modifier.name, modifier.doc);
        if !modifier.details.is_empty() {
            text += &format!(" {}", modifier.details);
        }
        for example in modifier.examples {
            text += &format!("\n        {}={example}", modifier.name);
        }
        text += "\n";
    }
    text + "\nValues in braces or brackets are JSON; quote them for the shell."
}

/// All of them as a table in Markdown.
pub fn markdown() -> String {
    let rows = MODIFIERS.iter().map(|Modifier { name, doc, details, examples, .. }| {
        let values: Vec<_> = examples.iter().map(|example| format!("`{example}`")).collect();
        let text = if details.is_empty() { String::new() } else { format!(" {details}") };
        format!("| `{name}` | {doc}{text} | {} |\n", values.join("<br>"))
    });
    format!("| modifier | what it does | such as |\n|---|---|---|\n{}", rows.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::perturbation::AppliedPerturbation;

    #[test]
    fn the_examples_are_read_as_what_they_are() {
        for modifier in MODIFIERS {
            for example in modifier.examples {
                let text = format!("fog,{}={example}", modifier.name);
                let spec =
                    AppliedPerturbation::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
                assert!(spec.parameters.is_empty(), "{text} sets a parameter");
                assert_ne!(spec, AppliedPerturbation::parse("fog").unwrap(), "{text} changes nothing");
            }
        }
    }

    #[test]
    fn everything_that_can_be_recorded_is_reported() {
        let set: String =
            MODIFIERS.iter().map(|modifier| format!(",{}={}", modifier.name, modifier.examples[0])).collect();
        let spec = AppliedPerturbation::parse(&format!("fog{set},own=3")).unwrap();
        let recorded = serde_json::to_value(spec).unwrap();
        let recorded: Vec<&str> = recorded.as_object().unwrap().keys().map(String::as_str).collect();
        let told: Vec<&str> = MODIFIERS.iter().map(|modifier| modifier.name).collect();
        assert_eq!(recorded, [&["name"], &told[..], &["parameters"]].concat());
        for (text, place) in [(help(), "help"), (markdown(), "Markdown"), (names(), "names")] {
            assert!(told.iter().all(|name| text.contains(name)), "{place}: {text}");
        }
    }
}
