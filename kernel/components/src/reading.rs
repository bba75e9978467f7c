//! What a plugin says of itself, read so that a plugin of another SDK stays usable: what is not known here is left out, and each
//! time there is a word about it.

use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::PluginDescription;
use pdk_sdk::describe::{Description, Kind, Parameter};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Map, Value, json};

/// What a plugin says of itself.
#[derive(Debug, Default)]
pub struct Told {
    /// What is known here.
    pub description: PluginDescription,
    /// The place of each component among all that the plugin describes.
    pub places: Vec<usize>,
    /// What is not known here, a sentence each.
    pub skipped: Vec<String>,
}

/// Reads what a plugin says of itself.
///
/// # Errors
/// If it is not a description of a plugin at all.
pub fn read(text: &str) -> Result<Told> {
    let unreadable = "does not describe itself as a plugin; build it again with pdk_sdk::export!";
    let mut plugin: Map<String, Value> = serde_json::from_str(text).place(unreadable)?;
    let Some(Value::Array(components)) = plugin.insert("components".to_owned(), json!([])) else {
        return Err(Error::new(format!("{unreadable}: it has no list of components")));
    };
    let plugin = Value::Object(plugin);
    let description: PluginDescription = serde_json::from_value(plugin.clone()).place(unreadable)?;
    let mut told = Told { description, ..Told::default() };
    told.skip("the plugin", unknown_fields(&plugin, &told.description)?);
    for (place, component) in components.into_iter().enumerate() {
        let word = |name: &str| component[name].as_str().unwrap_or_default().to_owned();
        let (kind, name) = (word("kind"), word("name"));
        if !is_kind(&kind) {
            told.skipped.push(format!(
                "`{name}` is left out, because it is of the kind `{kind}`, which this pdk does not know"
            ));
            continue;
        }
        let label = format!("{kind} `{name}`");
        match told.component(&label, component) {
            Ok(description) => {
                told.description.components.push(description);
                told.places.push(place);
            }
            Err(error) => {
                told.skipped
                    .push(format!("{label} is left out, because its description cannot be read ({error})"));
            }
        }
    }
    let sdk = match told.description.sdk.as_str() {
        "" => "an unknown pdk-sdk",
        sdk => &format!("pdk-sdk {sdk}"),
    };
    for sentence in &mut told.skipped {
        *sentence += &format!("; the plugin was built with {sdk}, and this pdk has {SDK_VERSION}");
    }
    Ok(told)
}

impl Told {
    /// Reads the description of a component; a parameter of an unknown type takes any value.
    fn component(&mut self, label: &str, mut component: Value) -> Result<Description> {
        for (name, kind) in take_any(&mut component)? {
            self.skipped.push(format!(
                "{label}: its parameter `{name}` is of the type `{kind}`, which this pdk does not know and leaves to the plugin \
                 to check"
            ));
        }
        let description: Description = serde_json::from_value(component.clone())?;
        self.skip(label, unknown_fields(&component, &description)?);
        Ok(description)
    }

    fn skip(&mut self, label: &str, fields: Vec<String>) {
        if !fields.is_empty() {
            let fields: Vec<_> = fields.iter().map(|field| format!("`{field}`")).collect();
            let fields = fields.join(", ");
            self.skipped.push(format!("{label} says {fields}, which this pdk does not know and leaves out"));
        }
    }
}

/// Whether there is a kind of this name.
fn is_kind(name: &str) -> bool {
    Kind::ALL.iter().any(|known| known.name() == name)
}

/// The description of a component as far as it is known here; none if its kind is not.
///
/// # Errors
/// If it is not a description.
pub fn as_far_as_known(mut component: Value) -> Result<Option<Description>> {
    if component.get("kind").and_then(Value::as_str).is_some_and(|kind| !is_kind(kind)) {
        return Ok(None);
    }
    take_any(&mut component)?;
    Ok(Some(serde_json::from_value(component)?))
}

/// Lets the parameters of types that are not known here take any value, and returns their names and types.
fn take_any(component: &mut Value) -> Result<Vec<(String, String)>> {
    let mut unknown = Vec::new();
    let parameters = component.get_mut("parameters").and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten() {
        if serde_json::from_value::<Parameter>(parameter.clone()).is_ok() {
            continue;
        }
        let word = |name: &str| parameter[name].as_str().unwrap_or_default().to_owned();
        let named = (word("name"), word("type"));
        let mut any = parameter.clone();
        if let Some(fields) = any.as_object_mut() {
            fields.insert("type".to_owned(), json!("json"));
        }
        if let Ok(known) = serde_json::from_value::<Parameter>(any) {
            *parameter = serde_json::to_value(known)?;
            unknown.push(named);
        }
    }
    Ok(unknown)
}

/// The places of what was said and is not in what was understood.
fn unknown_fields(said: &Value, understood: &impl serde::Serialize) -> Result<Vec<String>> {
    let mut fields = Vec::new();
    compare("", said, &serde_json::to_value(understood)?, &mut fields);
    Ok(fields)
}

fn compare(place: &str, said: &Value, understood: &Value, fields: &mut Vec<String>) {
    match (said, understood) {
        (Value::Object(said), Value::Object(understood)) => {
            for (name, value) in said {
                let place = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
                match understood.get(name) {
                    Some(known) => compare(&place, value, known, fields),
                    // What is empty says nothing, whether it is known or not.
                    None if is_empty(value) => {}
                    None => fields.push(place),
                }
            }
        }
        (Value::Array(said), Value::Array(understood)) => {
            for (index, (value, known)) in said.iter().zip(understood).enumerate() {
                compare(&format!("{place}[{index}]"), value, known, fields);
            }
        }
        _ => {}
    }
}

fn is_empty(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::String(text) => text.is_empty(),
        Value::Array(list) => list.is_empty(),
        Value::Object(table) => table.is_empty(),
        Value::Bool(_) | Value::Number(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plugin(component: Value) -> Told {
        let known = Description::perturbation("fog", "Fog");
        let components = json!([component, known]);
        let plugin = json!({ "name": "p", "version": "1.0.0", "sdk": "9.0.0", "components": components });
        read(&plugin.to_string()).unwrap()
    }

    /// The sentence about the first of two components; the second one is always there.
    fn word(component: Value, there: bool) -> String {
        let told = plugin(component);
        let names: Vec<_> = told.description.components.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.last(), Some(&"fog"));
        assert_eq!(told.places, if there { vec![0, 1] } else { vec![1] });
        assert_eq!(told.skipped.len(), 1, "{:?}", told.skipped);
        let sentence = told.skipped[0].clone();
        let end = format!("; the plugin was built with pdk-sdk 9.0.0, and this pdk has {SDK_VERSION}");
        sentence.strip_suffix(&end).unwrap().to_owned()
    }

    #[test]
    fn what_is_not_known_is_left_out_with_a_word() {
        let driver = |change: fn(&mut Value)| {
            let driver =
                Description::driver("pilot", "Drives").parameter(Parameter::number("gain", 1.0, "how much"));
            let mut value = serde_json::to_value(driver).unwrap();
            change(&mut value);
            value
        };
        assert_eq!(plugin(driver(|_| ())).skipped, Vec::<String>::new());
        assert_eq!(plugin(driver(|driver| driver["future"] = json!([]))).skipped, Vec::<String>::new());
        assert_eq!(
            word(driver(|driver| driver["kind"] = json!("referee")), false),
            "`pilot` is left out, because it is of the kind `referee`, which this pdk does not know"
        );
        let unknown = driver(|driver| {
            driver["since"] = json!(2030);
            driver["parameters"][0]["step"] = json!(0.5);
        });
        assert_eq!(
            word(unknown, true),
            "driver `pilot` says `parameters[0].step`, `since`, which this pdk does not know and leaves out"
        );
        let typed = driver(|driver| driver["parameters"][0]["type"] = json!("colour"));
        assert!(
            word(typed, true)
                .starts_with("driver `pilot`: its parameter `gain` is of the type `colour`, which")
        );
        let broken = word(driver(|driver| driver["version"] = json!("two")), false);
        assert!(
            broken.starts_with("driver `pilot` is left out, because its description cannot be read ("),
            "{broken}"
        );
    }

    #[test]
    fn a_wrong_description_is_rejected() {
        for text in ["", "[]", "{}", r#"{"name": "p", "version": "1"}"#, r#"{"components": []}"#] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.starts_with("does not describe itself as a plugin"), "{error}");
        }
    }
}
