//! What a description has to keep to, from a plugin as from a script: names that can be written on command lines, in
//! files and in Lua, no two of them alike, and none that a pipeline uses for something else.

use pdk_model::perturbation::MODIFIERS;
use pdk_sdk::abi::PluginDescription;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::history::MOST_FRAMES;

/// What the table of a component in a pipeline has besides parameters; that of a perturbation has the modifiers as well.
const NAME: &str = "name";
/// The longest name in bytes.
const LONGEST_NAME: usize = 64;

/// Checks all that a plugin says of itself.
///
/// # Errors
/// Names what does not fit.
pub fn check_plugin(plugin: &PluginDescription) -> Result<()> {
    for (index, component) in plugin.components.iter().enumerate() {
        let Description { kind, name, .. } = component;
        check(component).map_err(|error| error.at(format_args!("{kind} `{name}`")))?;
        if plugin.components[..index].iter().any(|other| (other.kind, &other.name) == (*kind, name)) {
            return Err(Error::new(format!("has two components `{name}` of the kind {kind}; rename one")));
        }
    }
    Ok(())
}

/// Checks what a component says of itself.
///
/// # Errors
/// Names what does not fit.
pub fn check(description: &Description) -> Result<()> {
    let Description { kind, name, parameters, .. } = description;
    // Methods have been published under names with a hyphen or a plus.
    let more = if *kind == Kind::Saliency { "-+" } else { "" };
    check_name(name, more).map_err(|error| error.at(format_args!("the name of the {kind}")))?;
    if description.history > MOST_FRAMES {
        return Err(Error::new(format!(
            "it asks for {} earlier frames, and {MOST_FRAMES} is the most; ask for fewer",
            description.history
        )));
    }
    let modifier = |name: &str| MODIFIERS.iter().any(|modifier| modifier.name == name);
    let is_key = |name: &str| name == NAME || *kind == Kind::Perturbation && modifier(name);
    for (index, parameter) in parameters.iter().enumerate() {
        let name = &parameter.name;
        check_name(name, "").map_err(|error| error.at("the name of a parameter"))?;
        if is_key(name) {
            return Err(Error::new(format!(
                "a parameter cannot be named `{name}`, because in a pipeline `{name}` of a {kind} is something else; \
                 rename it"
            )));
        }
        if parameters[..index].iter().any(|other| other.name == *name) {
            return Err(Error::new(format!("there are two parameters named `{name}`")));
        }
    }
    Ok(())
}

/// Checks a name, in which these characters may stand as well, but not as its first.
fn check_name(name: &str, more: &str) -> Result<()> {
    let valid = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || more.contains(c);
    let begins_well = name.starts_with(|c: char| c.is_ascii_lowercase());
    if begins_well && name.chars().all(valid) && name.len() <= LONGEST_NAME {
        return Ok(());
    }
    Err(Error::new(format!(
        "`{name}` has to begin with a lower-case letter and consist of lower-case letters, digits and underscores{}, \
         {LONGEST_NAME} at most",
        if more.is_empty() { "" } else { ", with hyphens and pluses among them" }
    )))
}

#[cfg(test)]
mod tests {
    use pdk_sdk::describe::Parameter;
    use serde_json::json;

    use super::*;
    use pdk_model::component::ComponentSpec;
    use pdk_model::perturbation::AppliedPerturbation;
    use pdk_model::text::parse_value;

    fn plugin(components: Vec<Description>) -> std::result::Result<(), String> {
        let plugin = PluginDescription { components, ..PluginDescription::default() };
        check_plugin(&plugin).map_err(|error| error.to_string())
    }

    #[test]
    fn names_are_checked() {
        for name in ["", "Fog", "fog bank", "2fog", "_fog", "+fog", "fög", &"f".repeat(65)] {
            let error = plugin(vec![Description::driver(name, "x")]).unwrap_err();
            assert!(error.contains("the name of the driver") && error.contains("lower-case"), "{error}");
        }
        for name in ["", "Fog", "fog bank", "2fog", "_fog", "fög", "fog-bank", &"f".repeat(65)] {
            let parameter = Parameter::number(name, 1.0, "x");
            let error = plugin(vec![Description::driver("fog", "x").parameter(parameter)]).unwrap_err();
            assert!(error.starts_with("driver `fog`: the name of a parameter: "), "{error}");
        }
        assert_eq!(plugin(vec![Description::saliency("grad-cam++", "x")]), Ok(()));
        assert_eq!(
            plugin(vec![Description::driver("fog_2", "x"), Description::simulator("fog_2", "x")]),
            Ok(())
        );
    }

    #[test]
    fn nothing_is_there_twice() {
        let error =
            plugin(vec![Description::driver("fog", "x"), Description::driver("fog", "y")]).unwrap_err();
        assert_eq!(error, "has two components `fog` of the kind driver; rename one");
        let parameter = Parameter::number("s", 1.0, "x");
        let twice = Description::perturbation("fog", "x").parameter(parameter.clone()).parameter(parameter);
        assert_eq!(
            plugin(vec![twice]).unwrap_err(),
            "perturbation `fog`: there are two parameters named `s`"
        );
    }

    /// The names that are refused are those that a pipeline takes from the table before the parameters.
    #[test]
    fn keys_of_a_pipeline_are_not_parameters() {
        let mut table = json!({ "name": "fog", "s": 1 });
        for modifier in MODIFIERS {
            table[modifier.name] = parse_value(modifier.examples[0]).unwrap();
        }
        for (key, value) in table.as_object().unwrap() {
            let table = json!({ "name": "fog", key: value });
            let parameter = || Parameter::number(key, 1.0, "x");
            let taken =
                !AppliedPerturbation::from_json(&table).is_ok_and(|spec| spec.parameters.contains_key(key));
            let own = plugin(vec![Description::perturbation("fog", "x").parameter(parameter())]);
            assert_eq!(own.is_err(), taken, "{key}: {own:?}");
            let taken = !ComponentSpec::from_json("driver", &table).unwrap().parameters.contains_key(key);
            let own = plugin(vec![Description::driver("fog", "x").parameter(parameter())]);
            assert_eq!(own.is_err(), taken, "{key}: {own:?}");
        }
    }
}
