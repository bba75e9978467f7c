//! Who runs networks on this machine.

use pdk_components::registry::Registry;
use pdk_model::component::ENGINE;
use pdk_sdk::describe::{Kind, ParameterType};
use serde_json::{Map, Value};

use super::{Finding, State};

/// A finding for each engine that a driver with a network of its own can choose: its full name, or why it cannot be used.
pub fn findings(registry: &Registry) -> Vec<Finding> {
    let mut drivers = registry.catalog().of_kind(Kind::Driver).filter(|entry| entry.description.network);
    let Some(driver) = drivers.next() else { return Vec::new() };
    let Some(parameter) = driver.description.parameters.iter().find(|parameter| parameter.name == ENGINE)
    else {
        return Vec::new();
    };
    let ParameterType::Choice { options } = &parameter.kind else { return Vec::new() };
    let open = |option: &str| {
        let parameters = Map::from_iter([(ENGINE.to_owned(), Value::from(option))]);
        registry.driver(&driver.description.name, &parameters).map(|(driver, _)| driver.info())
    };
    options
        .iter()
        .map(|option| {
            let default = if parameter.default == option.as_str() { ", the default" } else { "" };
            match open(option) {
                Ok(info) => {
                    let of_engine = info.iter().filter(|(name, _)| {
                        name.to_lowercase().replace(' ', "").contains(option.as_str()) || name == ENGINE
                    });
                    let known =
                        of_engine.map(
                            |(name, value)| {
                                if name == ENGINE { value.clone() } else { format!("{name} {value}") }
                            },
                        );
                    let known = known.collect::<Vec<_>>().join(", ");
                    Finding {
                        subject: "engine",
                        state: State::Good,
                        text: format!("`{option}`{default}, runs networks on {known}"),
                    }
                }
                Err(error) => Finding {
                    subject: "engine",
                    state: State::Note,
                    text: format!("`{option}` cannot be used: {error}"),
                },
            }
        })
        .collect()
}
