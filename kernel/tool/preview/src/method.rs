//! The saliency method that shows people what a driver's network looks at.

use pdk_components::catalog::Catalog;
use pdk_model::component::ComponentSpec;
use pdk_sdk::describe::{Kind, Role};
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value};

/// The saliency method that a user names on the command line, or the preferred one if the text is empty.
///
/// # Errors
/// If the text is not a component, or it is empty and no method is preferred.
pub fn named(catalog: &Catalog, text: &str) -> Result<ComponentSpec> {
    match text {
        "" => Ok(ComponentSpec::new(&catalog.preferred(Kind::Saliency)?.description.name)),
        text => ComponentSpec::parse("saliency method", text),
    }
}

/// A method for the network of a driver: the method with the driver's own parameters if it has the same, and with its network.
///
/// # Errors
/// If there is no such method or driver, or the driver has no network.
pub fn of_driver(catalog: &Catalog, driver: &ComponentSpec, method: &ComponentSpec) -> Result<ComponentSpec> {
    let description = &catalog.get(Kind::Saliency, &method.name)?.description;
    // A driver of a record from elsewhere is not to say what a method starts.
    let takes = |name: &str| {
        description.parameters.iter().any(|parameter| parameter.name == name && !parameter.starts_program)
    };
    let entry = catalog.get(Kind::Driver, &driver.name)?;
    let mut parameters: Map<String, Value> = driver.parameters.clone();
    if let Some(network) = description.with_role(Role::Network).map(|parameter| parameter.name.as_str())
        && takes(network)
        && !parameters.contains_key(network)
    {
        if entry.base.is_none() && !entry.description.network {
            return Err(Error::new(format!(
                "the driver `{}` is not a network, so no saliency method can say what it looks at",
                driver.name
            )));
        }
        // A network that was dropped into a folder, or one that is part of pdk.
        let model =
            entry.base.as_ref().map_or_else(|| driver.name.clone(), |_| entry.file.display().to_string());
        parameters.insert(network.to_owned(), model.into());
    }
    parameters.retain(|name, _| takes(name));
    parameters.extend(method.parameters.clone());
    Ok(ComponentSpec { name: method.name.clone(), parameters })
}
