//! Weather: names and numbers as CARLA has them.

use pdk_sdk::prelude::{Error, ErrorKind, Result};
use pdk_sdk::serde_json::Value;

/// The numbers of CARLA's weather, in its order.
pub const FIELDS: [&str; 14] = [
    "cloudiness",
    "precipitation",
    "precipitation_deposits",
    "wind_intensity",
    "sun_azimuth_angle",
    "sun_altitude_angle",
    "fog_density",
    "fog_distance",
    "fog_falloff",
    "wetness",
    "scattering_intensity",
    "mie_scattering_scale",
    "rayleigh_scattering_scale",
    "dust_storm",
];

/// CARLA's own weather presets, without their last parameters, which are the same in all presets but the dust storm.
const PRESETS: [(&str, [f64; 10]); 22] = [
    ("ClearNoon", [5.0, 0.0, 0.0, 10.0, -1.0, 45.0, 2.0, 0.75, 0.1, 0.0]),
    ("CloudyNoon", [60.0, 0.0, 0.0, 10.0, -1.0, 45.0, 3.0, 0.75, 0.1, 0.0]),
    ("WetNoon", [5.0, 0.0, 50.0, 10.0, -1.0, 45.0, 3.0, 0.75, 0.1, 0.0]),
    ("WetCloudyNoon", [60.0, 0.0, 50.0, 10.0, -1.0, 45.0, 3.0, 0.75, 0.1, 0.0]),
    ("SoftRainNoon", [20.0, 30.0, 50.0, 30.0, -1.0, 45.0, 3.0, 0.75, 0.1, 0.0]),
    ("MidRainyNoon", [60.0, 60.0, 60.0, 60.0, -1.0, 45.0, 3.0, 0.75, 0.1, 0.0]),
    ("HardRainNoon", [100.0, 100.0, 90.0, 100.0, -1.0, 45.0, 7.0, 0.75, 0.1, 0.0]),
    ("ClearSunset", [5.0, 0.0, 0.0, 10.0, -1.0, 15.0, 2.0, 0.75, 0.1, 0.0]),
    ("CloudySunset", [60.0, 0.0, 0.0, 10.0, -1.0, 15.0, 3.0, 0.75, 0.1, 0.0]),
    ("WetSunset", [5.0, 0.0, 50.0, 10.0, -1.0, 15.0, 2.0, 0.75, 0.1, 0.0]),
    ("WetCloudySunset", [60.0, 0.0, 50.0, 10.0, -1.0, 15.0, 2.0, 0.75, 0.1, 0.0]),
    ("SoftRainSunset", [20.0, 30.0, 50.0, 30.0, -1.0, 15.0, 2.0, 0.75, 0.1, 0.0]),
    ("MidRainSunset", [60.0, 60.0, 60.0, 60.0, -1.0, 15.0, 3.0, 0.75, 0.1, 0.0]),
    ("HardRainSunset", [100.0, 100.0, 90.0, 100.0, -1.0, 15.0, 7.0, 0.75, 0.1, 0.0]),
    ("ClearNight", [5.0, 0.0, 0.0, 10.0, -1.0, -90.0, 60.0, 75.0, 1.0, 0.0]),
    ("CloudyNight", [60.0, 0.0, 0.0, 10.0, -1.0, -90.0, 60.0, 0.75, 0.1, 0.0]),
    ("WetNight", [5.0, 0.0, 50.0, 10.0, -1.0, -90.0, 60.0, 75.0, 1.0, 60.0]),
    ("WetCloudyNight", [60.0, 0.0, 50.0, 10.0, -1.0, -90.0, 60.0, 0.75, 0.1, 60.0]),
    ("SoftRainNight", [60.0, 30.0, 50.0, 30.0, -1.0, -90.0, 60.0, 0.75, 0.1, 60.0]),
    ("MidRainyNight", [80.0, 60.0, 60.0, 60.0, -1.0, -90.0, 60.0, 0.75, 0.1, 80.0]),
    ("HardRainNight", [100.0, 100.0, 90.0, 100.0, -1.0, -90.0, 100.0, 0.75, 0.1, 100.0]),
    ("DustStorm", [100.0, 0.0, 0.0, 100.0, -1.0, 45.0, 2.0, 0.75, 0.1, 0.0]),
];

/// The weather that a user wants: values for some of the numbers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Weather {
    wanted: Vec<(usize, f64)>,
}

impl Weather {
    /// Reads it: null for the server's, the name of one of CARLA's kinds, or an object with some of the numbers.
    ///
    /// # Errors
    /// If it is none of these.
    pub fn read(value: &Value) -> Result<Self> {
        match value {
            Value::Null => Ok(Self::default()),
            Value::String(name) if name.is_empty() => Ok(Self::default()),
            Value::String(name) => match PRESETS.iter().find(|(known, _)| known == name) {
                Some((_, numbers)) => {
                    let dust = if name == "DustStorm" { 100.0 } else { 0.0 };
                    let all = numbers.iter().copied().chain([1.0, 0.03, 0.0331, dust]);
                    Ok(Self { wanted: all.enumerate().collect() })
                }
                None => {
                    let names: Vec<_> = PRESETS.iter().map(|(name, _)| *name).collect();
                    Err(mistake(format!(
                        "`weather` is \"{name}\", but has to be one of {}",
                        names.join(", ")
                    )))
                }
            },
            Value::Object(fields) => {
                let field = |(name, value): (&String, &Value)| {
                    let place = FIELDS.iter().position(|field| field == name);
                    place.zip(value.as_f64()).ok_or_else(|| {
                        mistake(format!(
                            "`weather` says {name} = {value}, but its numbers are {}",
                            FIELDS.join(", ")
                        ))
                    })
                };
                Ok(Self { wanted: fields.iter().map(field).collect::<Result<_>>()? })
            }
            other => Err(mistake(format!(
                "`weather` is {other}, but has to be a name such as \"HardRainNoon\", or an object with numbers such as \
                 {{\"fog_density\": 40}}"
            ))),
        }
    }

    /// Whether nothing is wanted.
    pub fn is_unchanged(&self) -> bool {
        self.wanted.is_empty()
    }

    /// Puts what is wanted into the numbers of a server, which may have fewer than we know.
    pub fn put_into(&self, numbers: &mut [f64]) {
        for &(place, value) in &self.wanted {
            if let Some(number) = numbers.get_mut(place) {
                *number = value;
            }
        }
    }
}

fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::json;

    #[test]
    fn weather_is_a_name_or_some_numbers() {
        let mut numbers = [9.0; 14];
        Weather::read(&json!("HardRainNoon")).unwrap().put_into(&mut numbers);
        assert_eq!(
            numbers,
            [100.0, 100.0, 90.0, 100.0, -1.0, 45.0, 7.0, 0.75, 0.1, 0.0, 1.0, 0.03, 0.0331, 0.0]
        );
        // CARLA 0.9.13 knows no dust.
        let mut older = [9.0; 13];
        Weather::read(&json!({"fog_density": 40, "dust_storm": 3})).unwrap().put_into(&mut older);
        assert_eq!((older[6], older[7]), (40.0, 9.0));
        assert!(Weather::read(&Value::Null).unwrap().is_unchanged());
        for wrong in [json!("Rain"), json!({"fog": 1}), json!({"fog_density": "much"}), json!(4)] {
            let error = Weather::read(&wrong).unwrap_err();
            assert!(
                error.message().starts_with("`weather` ") && error.kind() == ErrorKind::Configuration,
                "{error}"
            );
        }
    }
}
