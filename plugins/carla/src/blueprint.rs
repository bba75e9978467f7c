//! What can be spawned, and the description of what is.

use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rmpv::Value;

use crate::value::{array, element, elements, text};

/// The name of a role by which actors of pdk are known again.
pub const ROLE: &str = "pdk";

/// Everything that a server can spawn.
#[derive(Debug, Clone)]
pub struct Blueprints(Value);

impl Blueprints {
    /// Takes what the server lists.
    pub fn new(definitions: Value) -> Self {
        Self(definitions)
    }

    /// The description of an actor of this kind, in which these attributes have other values than usual. Those that the kind has
    /// not are left out, since versions differ.
    ///
    /// # Errors
    /// If the server has no such kind, with those that it has.
    pub fn describe(&self, kind: &str, attributes: &[(&str, String)]) -> Result<Value> {
        let found = elements(&self.0).iter().find(|definition| text(element(definition, 1)) == kind);
        let definition = found.ok_or_else(|| self.unknown(kind))?;
        let attributes = elements(element(definition, 3)).iter().map(|attribute| {
            let name = text(element(attribute, 0));
            let other = attributes.iter().find(|(other, _)| *other == name);
            let value =
                other.map_or_else(|| element(attribute, 2).clone(), |(_, value)| value.as_str().into());
            // The numbers of types differ between versions, so the server gets back its own.
            array([name.into(), element(attribute, 1).clone(), value])
        });
        let attributes: Vec<Value> = attributes.collect();
        Ok(array([element(definition, 0).clone(), kind.into(), array(attributes)]))
    }

    /// Whether an actor of this kind has an attribute.
    pub fn has(&self, kind: &str, attribute: &str) -> bool {
        let found = elements(&self.0).iter().find(|definition| text(element(definition, 1)) == kind);
        found.is_some_and(|definition| {
            elements(element(definition, 3)).iter().any(|known| text(element(known, 0)) == attribute)
        })
    }

    fn unknown(&self, kind: &str) -> Error {
        let family = kind.split('.').next().unwrap_or_default();
        let names = elements(&self.0).iter().map(|definition| text(element(definition, 1)));
        let known: Vec<_> = names.filter(|name| name.starts_with(family)).collect();
        let shown = known.iter().take(20).copied().collect::<Vec<_>>().join(", ");
        let more = if known.len() > 20 { format!(" and {} more", known.len() - 20) } else { String::new() };
        Error::of(ErrorKind::Configuration, format!("CARLA has no actor `{kind}` here; it has {shown}{more}"))
    }
}

/// An actor as the server describes it.
#[derive(Debug, Clone, Copy)]
pub struct Actor<'a>(pub &'a Value);

impl Actor<'_> {
    /// Its number.
    pub fn id(&self) -> Option<u32> {
        crate::value::id(element(self.0, 0))
    }

    /// The number of the actor that it is fixed to; none if it is not.
    pub fn parent(&self) -> Option<u32> {
        crate::value::id(element(self.0, 1)).filter(|id| *id != 0)
    }

    /// What it is, such as `vehicle.tesla.model3`.
    pub fn kind(&self) -> &str {
        text(element(element(self.0, 2), 1))
    }

    /// Its role.
    pub fn role(&self) -> &str {
        let attributes = elements(element(element(self.0, 2), 2));
        let role = attributes.iter().find(|attribute| text(element(attribute, 0)) == "role_name");
        role.map_or("", |attribute| text(element(attribute, 2)))
    }

    /// Half of its length, width and height in metres; none if it is not said.
    pub fn extent(&self) -> Option<[f64; 3]> {
        let extent = element(element(self.0, 3), 1);
        let number = |i| crate::value::number(element(extent, i));
        Some([number(0)?, number(1)?, number(2)?])
    }

    /// The stream of what it senses.
    pub fn stream(&self) -> Option<crate::stream::Token> {
        crate::stream::Token::read(crate::value::bytes(element(self.0, 5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, kind: u32, value: &str) -> Value {
        array([name.into(), kind.into(), value.into(), array([]), true.into(), false.into()])
    }

    #[test]
    fn a_description_has_all_attributes_and_the_types_of_the_server() {
        let camera = array([attribute("fov", 3, "90.0"), attribute("role_name", 4, "front")]);
        let definition = array([2.into(), "sensor.camera.rgb".into(), "sensor,camera".into(), camera]);
        let blueprints = Blueprints::new(array([definition]));
        let wanted = [("fov", "110".to_owned()), ("unheard_of", "1".to_owned())];
        let description = blueprints.describe("sensor.camera.rgb", &wanted).unwrap();
        let attributes = array([
            array(["fov".into(), 3.into(), "110".into()]),
            array(["role_name".into(), 4.into(), "front".into()]),
        ]);
        assert_eq!(description, array([2.into(), "sensor.camera.rgb".into(), attributes]));
        let error = blueprints.describe("sensor.camera.depth", &[]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Configuration);
        assert!(error.message().ends_with("it has sensor.camera.rgb"), "{error}");
        assert!(blueprints.has("sensor.camera.rgb", "fov") && !blueprints.has("sensor.camera.rgb", "gamma"));
    }
}
