//! What tables call drivers.

use std::collections::{BTreeMap, BTreeSet};

use pdk_model::component::{ComponentSpec, ENGINE};

/// What tables call the drivers of a record: a driver without the engine that runs its network, unless several engines tell drivers apart.
pub struct Named {
    engines: bool,
}

impl Named {
    /// Names for these drivers.
    pub fn of<'a>(drivers: impl IntoIterator<Item = &'a ComponentSpec>) -> Self {
        let mut of_all = BTreeSet::new();
        let mut of_each: BTreeMap<String, BTreeSet<Option<String>>> = BTreeMap::new();
        for driver in drivers {
            let engine = driver.parameters.get(ENGINE).map(ToString::to_string);
            of_all.extend(engine.clone());
            of_each.entry(without_engine(driver)).or_default().insert(engine);
        }
        Self { engines: of_all.len() > 1 || of_each.values().any(|engines| engines.len() > 1) }
    }

    /// The name of one of them.
    pub fn name(&self, driver: &ComponentSpec) -> String {
        if self.engines { driver.to_string() } else { without_engine(driver) }
    }
}

fn without_engine(driver: &ComponentSpec) -> String {
    let mut driver = driver.clone();
    driver.parameters.shift_remove(ENGINE);
    driver.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_engine_is_named_only_if_several_ran() {
        let driver = |text: &str| ComponentSpec::parse("driver", text).unwrap();
        let names = |texts: &[&str]| {
            let drivers: Vec<ComponentSpec> = texts.iter().map(|text| driver(text)).collect();
            let named = Named::of(&drivers);
            drivers.iter().map(|driver| named.name(driver)).collect::<Vec<_>>()
        };
        assert_eq!(names(&["a,engine=pdk", "b,gain=2", "c,engine=pdk"]), ["a", "b (gain=2)", "c"]);
        assert_eq!(names(&["a,engine=pdk", "b,engine=other"]), ["a (engine=pdk)", "b (engine=other)"]);
        // The same network, run by what pdk picks and by what the user names.
        assert_eq!(names(&["a", "a,engine=other"]), ["a", "a (engine=other)"]);
    }
}
