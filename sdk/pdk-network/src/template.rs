//! The description of a network to complete, in TOML: what is known is filled in, what is assumed is marked, and the other fields are
//! there as comments.

use crate::field::{FIELDS, Field, Kind, WAYPOINTS, WAYPOINTS_EXAMPLE};
use crate::plan::{Fill, Plan};
use crate::reason::Reason;

/// What is known for a template: nothing if the network cannot be read without a description, which `missing` says then.
pub struct Known<'a> {
    /// The name of the model's file.
    pub model: &'a str,
    /// What its inputs get, if that is known.
    pub plan: Option<&'a Plan>,
    /// What is known about inputs and outputs.
    pub reasons: &'a [Reason],
    /// The outputs with the numbers that each has, as far as they are known.
    pub outputs: &'a [(String, Option<usize>)],
    /// The steering and the throttle as fields.
    pub drives: [Option<String>; 2],
    /// Why nothing can be guessed.
    pub missing: Option<String>,
}

/// The text of a description.
pub fn text(known: &Known<'_>) -> String {
    let mut text = format!(
        "# How frames become the tensors of {}, and its outputs a control. `pdk show {}` says what is in force.\n\
         # Fields that are left out or commented out are guessed, and a run says what it assumes. Correct what is marked ASSUMED, and remove\n\
         # the mark of a comment before it.\n",
        known.model, known.model
    );
    if let Some(missing) = &known.missing {
        text.push_str(&format!("# Cannot be guessed: {missing}\n"));
    }
    for (name, values) in known.outputs {
        let values = values.map_or("of unknown size".to_owned(), |values| format!("of {values}"));
        text.push_str(&format!("# Output `{name}`, {values}\n"));
    }
    for Field { name, kind, default, doc } in FIELDS {
        let form = match kind {
            Kind::Choice(options) => options.join(", "),
            Kind::Free(form) => form.to_owned(),
        };
        text.push_str(&format!(
            "\n{}",
            comment(&format!("{name}: {doc}. It may be {form}; left out: {default}."))
        ));
        let is_about = |reason: &&Reason| {
            reason.subject == name || name == "inputs" && reason.subject.starts_with("input ")
        };
        let mut assumed_here = false;
        for Reason { subject, value, why, assumed } in known.reasons.iter().filter(is_about) {
            let mark = if *assumed { "ASSUMED" } else { "found" };
            let subject =
                subject.strip_prefix("input ").map_or(String::new(), |input| format!("`{input}` gets "));
            text.push_str(&comment(&format!("{mark}: {subject}{value}, because {why}.")));
            assumed_here |= assumed;
        }
        text.push_str(&match value(known, name) {
            // Who takes the mark away has looked at it.
            Some(value) if assumed_here => format!("# {name} = {value}\n"),
            Some(value) => format!("{name} = {value}\n"),
            None => format!("# {name} = {}\n", example(name)),
        });
    }
    text
}

/// A paragraph of comments, wrapped.
fn comment(text: &str) -> String {
    const WIDTH: usize = 110;
    let mut lines = vec![String::from("#")];
    for word in text.split_whitespace() {
        if lines.last().is_some_and(|line| line.len() + 1 + word.len() > WIDTH) {
            lines.push(String::from("#"));
        }
        if let Some(line) = lines.last_mut() {
            line.push(' ');
            line.push_str(word);
        }
    }
    lines.iter().map(|line| format!("{line}\n")).collect()
}

/// The value of a field, if it is known.
fn value(known: &Known<'_>, name: &str) -> Option<String> {
    let plan = known.plan;
    let text = |value: &str| toml_edit::Value::from(value).to_string();
    match name {
        "color" => plan.map(|plan| text(plan.color.name())),
        "scale" => plan.map(|plan| text(&plan.scale.to_string())),
        "layout" => plan.map(|plan| text(plan.image.layout)),
        "frames" => plan.filter(|plan| plan.image.frames > 1).map(|plan| plan.image.frames.to_string()),
        "inputs" => {
            let inputs = plan?.inputs.iter().filter_map(|input| {
                let value = match &input.fill {
                    Fill::Image => "\"image\"",
                    Fill::Speed(_) => "{ value = \"speed\", unit = \"m/s\" }",
                    Fill::Controls => "\"controls\"",
                    Fill::Constant(_) | Fill::State(_) => return None,
                };
                Some(format!("{} = {value}", key(&input.name)))
            });
            Some(format!("{{ {} }}", inputs.collect::<Vec<_>>().join(", ")))
        }
        "state" => {
            let plan = plan?;
            let pairs: Vec<String> = plan
                .inputs
                .iter()
                .filter_map(|input| match input.fill {
                    Fill::State(output) => {
                        Some(format!("{} = {}", key(&input.name), text(&plan.outputs[output])))
                    }
                    _ => None,
                })
                .collect();
            (!pairs.is_empty()).then(|| format!("{{ {} }}", pairs.join(", ")))
        }
        "steering" => known.drives[0].clone(),
        "throttle" => known.drives[1].clone(),
        _ => None,
    }
}

/// A name as a key, in quotes if it has characters that a bare one cannot have.
fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.to_owned() } else { toml_edit::Value::from(name).to_string() }
}

/// A field's value in a comment.
fn example(name: &str) -> &'static str {
    match name {
        "preset" => "\"donkeycar_linear\"",
        "frame" => "[320, 160]",
        "crop" => "{ top = 60, bottom = 25 }",
        "region" => "[0.0, 0.4, 1.0, 0.9]",
        "image_size" => "[200, 66]",
        "resize" => "\"bilinear\"",
        "color" => "\"rgb\"",
        "scale" => "\"0..1\"",
        "mean" => "[0.485, 0.456, 0.406]",
        "std" => "[0.229, 0.224, 0.225]",
        "layout" => "\"nchw\"",
        "dtype" => "\"float32\"",
        "frames" => "3",
        "spacing" => "1",
        "order" => "\"oldest_first\"",
        "start" => "\"repeat\"",
        "differences" => "\"only\"",
        "inputs" => "{ image = \"image\", speed = { value = \"speed\", unit = \"m/s\" } }",
        "state" => "{ hidden_in = \"hidden_out\" }",
        WAYPOINTS => WAYPOINTS_EXAMPLE,
        "steering" => "{ output = \"angle\", bins = { from = -1.0, to = 1.0, count = 15 } }",
        _ => "0.3",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Described, Given};

    #[test]
    fn every_example_is_a_value_that_its_field_can_have() {
        let empty = Known {
            model: "pilot.onnx",
            plan: None,
            reasons: &[],
            outputs: &[],
            drives: [None, None],
            missing: None,
        };
        let text = text(&empty);
        for field in FIELDS {
            assert!(
                text.contains(&format!("\n# {} = {}\n", field.name, example(field.name))),
                "{}",
                field.name
            );
        }
        // All but those that exclude each other, each as it stands there.
        let lines = FIELDS.iter().filter(|field| !["preset", "region"].contains(&field.name));
        let described: String =
            lines.map(|field| format!("{} = {}\n", field.name, example(field.name))).collect();
        let path = std::env::temp_dir().join(format!("pdk-network-template-{}.toml", std::process::id()));
        std::fs::write(&path, described).unwrap();
        let given = Given::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        Described::new(given).unwrap();
    }
}
