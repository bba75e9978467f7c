//! The reference: a page for each family of perturbations, written from what they say of themselves.

use pdk_sdk::describe::{Description, LEVELS, Parameter, ParameterType, Temporal};
use serde_json::{Map, Value};

use crate::modifiers;

/// A page of the reference in Markdown.
pub struct Page {
    /// The name of the file, without folder.
    pub file: String,
    /// Its text.
    pub text: String,
}

/// Says where the pages come from.
const GENERATED: &str =
    "*Written by `pdk reference` from what the perturbations say of themselves; changes here are lost.*";

/// The pages: one that lists everything, and one a family. The picture of each perturbation lies beside them in
/// `pictures/NAME.jpg`.
pub fn pages(perturbations: &[Description]) -> Vec<Page> {
    let mut sorted: Vec<&Description> = perturbations.iter().collect();
    sorted.sort_by(|a, b| (&a.family, &a.name).cmp(&(&b.family, &b.name)));
    let mut pages = vec![Page { file: "README.md".to_owned(), text: index(&sorted) }];
    for family in sorted.chunk_by(|a, b| a.family == b.family) {
        let name = &family[0].family;
        let sections: String = family.iter().map(|description| section(description)).collect();
        pages.push(Page {
            file: format!("{name}.md"),
            text: format!("# Perturbations: {name}\n\n{GENERATED}\n{sections}"),
        });
    }
    pages
}

fn index(perturbations: &[&Description]) -> String {
    let rows = perturbations.iter().map(|description| {
        let Description { family, name, doc, .. } = description;
        let temporal = temporal(description);
        let set = if description.default { "yes" } else { "by name" };
        format!("| {family} | [{name}]({family}.md#{name}) | {temporal} | {set} | {} |\n", cell(doc))
    });
    format!(
        "# Perturbations\n\n{GENERATED}\n\n\
         Every perturbation takes an intensity, any number from 0 to 4. Static ones look at one frame, dynamic ones move \
         over time. The default set are those that keep a scene valid.\n\n\
         | family | perturbation | motion | default | what it does |\n|---|---|---|---|---|\n{}\n\
         ## Modifiers\n\nEvery perturbation takes these besides its own parameters, in the same way: `NAME,MODIFIER=VALUE` on \
         the command line, `{{ name = ..., MODIFIER = ... }}` in Lua.\n\n{}",
        rows.collect::<String>(),
        modifiers::markdown()
    )
}

fn temporal(description: &Description) -> &'static str {
    match description.temporal {
        Temporal::Static => "static",
        Temporal::Dynamic => "dynamic",
    }
}

/// The picture of a perturbation, if it changes frames.
fn picture(description: &Description) -> String {
    let name = &description.name;
    match description.acts_on.is_frame() {
        true => format!("![{name} at levels 0 to 4](pictures/{name}.jpg)\n\n"),
        false => String::new(),
    }
}

fn section(description: &Description) -> String {
    let Description { name, doc, version, .. } = description;
    let set = if description.default { "in the default set" } else { "by name only" };
    let mut text = format!(
        "\n## {name}\n\n{doc}.\n\n{}*{}, {set}, version {version}*\n",
        picture(description),
        temporal(description)
    );
    let mut line = |label: &str, line: &str| {
        if !line.is_empty() {
            text += &format!("\n**{label}** {line}\n");
        }
    };
    if !description.acts_on.is_frame() {
        line("Acts on", &format!("{}; in drives alone.", description.acts_on.text()));
    }
    line("Computes", &description.mathematics);
    line("Drawn once per sequence:", &description.drawn_per_sequence);
    line("Drawn for every frame:", &description.drawn_per_frame);
    line("Follows saliency maps:", &description.follows_attention);
    if description.history > 0 {
        let frames = format!("up to {} frames before the one at hand.", description.history);
        line("Needs:", &frames);
    }
    if let Some(choice) = &description.depth {
        line("Needs:", &format!("a simulator that knows how far away pixels are, with `{choice}`."));
    }
    line("Source:", &description.source);
    line("Differs from the published tool:", &description.divergences.join(" "));
    if !description.grows_with.is_empty() {
        let settings = format!("`{}`", settings(&description.grows_with));
        line("Published levels out of order; strength grows evenly with:", &settings);
    }
    if !description.parameters.is_empty() {
        let levels: String = (0..LEVELS).map(|level| format!(" level {level} |")).collect();
        text += &format!(
            "\n| parameter | what it is | allowed |{levels}\n|---|---|---|{}\n",
            "---:|".repeat(LEVELS)
        );
        text.extend(description.parameters.iter().map(row));
    }
    text
}

/// Parameter values as they are written on the command line.
pub fn settings(values: &Map<String, Value>) -> String {
    let values: Vec<_> = values
        .iter()
        .map(|(name, value)| match value {
            Value::String(text) => format!("{name}={text}"),
            value => format!("{name}={value}"),
        })
        .collect();
    values.join(",")
}

fn row(parameter: &Parameter) -> String {
    let unit = if parameter.unit.is_empty() { String::new() } else { format!(", {}", parameter.unit) };
    let values: String = match &parameter.levels {
        Some(levels) => levels.iter().map(|value| format!(" {value} |")).collect(),
        None => format!(" {} |{}", cell(&default(parameter)), " |".repeat(LEVELS - 1)),
    };
    format!(
        "| `{}` | {}{} | {} |{values}\n",
        parameter.name,
        cell(&parameter.doc),
        cell(&unit),
        cell(&allowed(&parameter.kind))
    )
}

fn default(parameter: &Parameter) -> String {
    match parameter.default.as_str() {
        Some("") => String::new(),
        Some(text) => format!("`{text}`"),
        None if parameter.is_required() => "required".to_owned(),
        None => parameter.default.to_string(),
    }
}

/// The type of a parameter and what it allows, in words.
pub fn allowed(kind: &ParameterType) -> String {
    match kind {
        ParameterType::Number { min, max } => {
            format!("number{}", range(*min > f64::MIN, min, *max < f64::MAX, max))
        }
        ParameterType::Integer { min, max } => {
            format!("integer{}", range(*min > i64::MIN, min, *max < i64::MAX, max))
        }
        ParameterType::Boolean => "true or false".to_owned(),
        ParameterType::Choice { options } => options.join(" | "),
        ParameterType::Text => "text".to_owned(),
        ParameterType::Path => "path".to_owned(),
        ParameterType::Json => "any".to_owned(),
    }
}

fn range<T: std::fmt::Display>(has_min: bool, min: T, has_max: bool, max: T) -> String {
    match (has_min, has_max) {
        (true, true) => format!(" {min} to {max}"),
        (true, false) => format!(" from {min}"),
        (false, true) => format!(" up to {max}"),
        (false, false) => String::new(),
    }
}

/// A text within a table of Markdown.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_holds_what_the_description_says() {
        let fog = Description::perturbation("fog", "Hides what is far | away")
            .family("weather")
            .source("Doe (2020)")
            .mathematics("v (1 - s) + 255 s")
            .drawn_per_frame("the grain")
            .parameter(Parameter::by_level("s", [0.1, 0.2, 0.3, 0.4, 0.5], "density").range(0.0, 1.0))
            .parameter(Parameter::choice("variant", &["published", "corrected"], "which"));
        let pages = pages(&[fog]);
        assert_eq!(pages[1].file, "weather.md");
        let text = &pages[1].text;
        assert!(text.contains("**Computes** v (1 - s) + 255 s"), "{text}");
        assert!(text.contains("| `s` | density | number 0 to 1 | 0.1 | 0.2 | 0.3 | 0.4 | 0.5 |"), "{text}");
        assert!(text.contains(r"published \| corrected"), "{text}");
        assert!(pages[0].text.ends_with(&modifiers::markdown()), "{}", pages[0].text);
        assert!(pages[0].text.contains(r"Hides what is far \| away"), "{}", pages[0].text);
    }
}
