//! The examples in the help of each verb, which the product brings along.

use clap::Command;
use pdk_components::product::Product;

/// The command line with a product's examples below the help of each verb.
pub fn shown(command: Command, product: &Product) -> Command {
    product.examples.iter().fold(command, |command, (verb, examples)| {
        command.mut_subcommand(*verb, |verb| {
            let lines: String =
                examples.iter().map(|(example, what)| format!("\n  {example}\n      {what}")).collect();
            let rest = verb.get_after_help().map(|text| format!("\n\n{text}")).unwrap_or_default();
            verb.after_help(format!("Examples:{lines}{rest}"))
        })
    })
}

#[cfg(test)]
mod tests {
    use pdk_product::PRODUCT;

    use crate::verbs::command;

    #[test]
    fn every_verb_for_people_has_an_example() {
        let programs = ["session", "worker", "help"];
        for verb in command().get_subcommands().filter(|verb| !verb.is_hide_set()) {
            let has_one = PRODUCT
                .examples
                .iter()
                .any(|(name, examples)| *name == verb.get_name() && !examples.is_empty());
            assert_eq!(has_one, !programs.contains(&verb.get_name()), "{}", verb.get_name());
        }
    }

    #[test]
    fn every_example_is_a_command_line_that_pdk_takes() {
        for (verb, examples) in PRODUCT.examples {
            for (example, _) in *examples {
                let words = example.split(" > ").next().unwrap().split(' ');
                let matches = command().try_get_matches_from(words);
                assert_eq!(matches.unwrap().subcommand_name(), Some(*verb), "{example}");
            }
        }
    }
}
