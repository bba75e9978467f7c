//! `pdk --version`: the version, and what else decides how pdk computes on this machine.

use std::collections::BTreeSet;

use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::pdk_abi;
use pdk_sdk::ops::instructions_in_use;

/// The version with a line for each further fact.
pub fn long() -> String {
    let mut lines = vec![
        env!("CARGO_PKG_VERSION").to_owned(),
        format!("plugin interface: {}, SDK {SDK_VERSION}", pdk_abi::VERSION),
        format!("instructions: {}", instructions_in_use()),
    ];
    lines.extend(settled());
    lines.join("\n")
}

/// What the defaults of parameters stand for on this machine, such as the engine that runs networks.
fn settled() -> BTreeSet<String> {
    let search = SearchPath::default();
    let registry = match Registry::discover(&search, Box::new(LuaScripts::new(&search))) {
        Ok(registry) => registry,
        Err(error) => return BTreeSet::from([format!("components: {error}")]),
    };
    let parameters = registry.catalog().entries().iter().flat_map(|entry| &entry.description.parameters);
    let settled = parameters.filter_map(|parameter| {
        let meaning = parameter.stands_for.get(parameter.default.as_str()?)?;
        Some(format!("{}: {meaning}", parameter.name))
    });
    settled.collect()
}
