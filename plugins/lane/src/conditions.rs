//! Named conditions: how hard a road is to see and to drive. Each gives every parameter of [`SETTINGS`] that is left out a value,
//! or a range from which a scenario's seed draws one.

use pdk_sdk::prelude::*;

use crate::light;
use crate::wear;

/// The names, as the parameter `conditions` has them.
///
/// The first one is the default: scenes as clean as a drawing, which drivers are quick to learn and which disturb no
/// perturbation.
pub const NAMES: [&str; 3] = ["easy", "standard", "hard"];

/// The value of a setting that follows from the conditions.
const BY_CONDITIONS: f64 = -1.0;
/// The light that follows from them.
const ANY_LIGHT: &str = "any";

/// A parameter whose value follows from the conditions if it is left out.
struct Setting {
    name: &'static str,
    doc: &'static str,
    unit: &'static str,
    /// Lowest and highest value allowed.
    range: (f64, f64),
    /// Lowest and highest value for each of [`NAMES`].
    values: [(f64, f64); 3],
    /// Whether it needs a scene that looks as cameras see it: the first conditions know nothing of it.
    natural: bool,
}

/// A setting with these values, the same in all scenarios.
const fn fixed(
    name: &'static str,
    values: [f64; 3],
    range: (f64, f64),
    unit: &'static str,
    doc: &'static str,
) -> Setting {
    let [a, b, c] = values;
    Setting { name, doc, unit, range, values: [(a, a), (b, b), (c, c)], natural: false }
}

/// A setting of natural scenes that each scenario draws anew.
const fn drawn(
    name: &'static str,
    standard: (f64, f64),
    hard: (f64, f64),
    range: (f64, f64),
    doc: &'static str,
) -> Setting {
    Setting { name, doc, unit: "", range, values: [(0.0, 0.0), standard, hard], natural: true }
}

/// All of them, in the order in which they are listed.
const SETTINGS: [Setting; 16] = [
    fixed(
        "initial_speed",
        [8.0, 12.0, 16.0],
        (0.0, 50.0),
        "m/s",
        "speed of the vehicle at the start of the road",
    ),
    fixed("oncoming", [6.0, 8.0, 12.0], (0.0, 60.0), "1/km", "oncoming vehicles a kilometre"),
    fixed("parked", [0.0, 4.0, 8.0], (0.0, 60.0), "1/km", "vehicles a kilometre that stand beside the road"),
    fixed("signs", [0.0, 5.0, 8.0], (0.0, 60.0), "1/km", "signs a kilometre"),
    fixed("control_delay", [0.0, 0.1, 0.2], (0.0, 2.0), "s", "time from a control to its effect"),
    fixed(
        "straight_ends",
        // Two seconds at the initial speed.
        [16.0, 24.0, 32.0],
        (0.0, 500.0),
        "m",
        "straight road before a scenario's own, and behind the last angle of a road of angles; at least 1 m, or 0 for none: then a \
        road of angles begins in a bend, and the segment of its last angle is not driven",
    ),
    fixed(
        "segment",
        [25.0, 37.5, 50.0],
        (10.0, 500.0),
        "m",
        "length of the segments of a road that the scenario leaves to the simulator",
    ),
    fixed(
        "sensor_noise",
        [0.0, 3.0, 5.0],
        (0.0, 60.0),
        "grey levels",
        "standard deviation of the camera's noise in medium grey by day",
    ),
    fixed(
        "auto_exposure",
        [0.0, 0.6, 0.6],
        (0.0, 1.0),
        "",
        "how far the camera makes up for a scene that is too bright or too dark",
    ),
    fixed(
        "vignetting",
        [0.0, 0.25, 0.4],
        (0.0, 1.0),
        "",
        "the share of the light that the corners of a frame lose",
    ),
    Setting {
        name: "crests",
        doc: "how far a road whose heights are all equal goes up and down; less far if it would be too steep to drive",
        unit: "m",
        range: (0.0, 6.0),
        values: [(0.0, 0.0), (0.0, 1.2), (0.8, 2.4)],
        natural: false,
    },
    drawn(
        "trees",
        (0.3, 0.7),
        (0.6, 1.0),
        (0.0, 1.0),
        "how densely trees line the road, whose shadows fall on it where the sun shines",
    ),
    drawn(
        "road_damage",
        (0.3, 0.7),
        (0.6, 1.0),
        (0.0, 1.5),
        "how strongly patches, cracks and seams of the road show",
    ),
    drawn("paint_wear", (0.1, 0.45), (0.4, 0.75), (0.0, 1.0), "how far the paint of the markings is worn"),
    drawn(
        "paint_missing",
        (0.0, 0.06),
        (0.04, 0.14),
        (0.0, 0.9),
        "the share of the road along which a line is missing",
    ),
    drawn(
        "wetness",
        (0.0, 0.3),
        (0.0, 0.9),
        (0.0, 1.0),
        "how wet the road is: it darkens, and mirrors the sky",
    ),
];

/// The lights of each of [`NAMES`], of which a scenario's seed draws one.
const LIGHTS: [&[&str]; 3] = [&["day"], &["day", "day", "overcast"], &["day", "overcast", "dusk", "night"]];

/// What a simulator was set to.
#[derive(Debug, Clone)]
pub struct Conditions {
    level: usize,
    /// What was set, in the order of [`SETTINGS`].
    given: [Option<f64>; SETTINGS.len()],
    light: Option<String>,
}

/// The conditions of one scenario.
#[derive(Debug, Clone)]
pub struct Drawn {
    values: [f64; SETTINGS.len()],
    /// The name of the light.
    pub light: String,
    /// Whether it looks as cameras see it.
    pub natural: bool,
}

/// The parameters, to be added to a description.
pub fn parameters() -> Vec<Parameter> {
    let mut parameters = vec![Parameter::choice(
        "conditions",
        &NAMES,
        "how hard the road is to see and to drive: the value of each parameter below that is not set; easy looks like a drawing, the \
         others as cameras see the world",
    )];
    let lights = LIGHTS.iter().zip(NAMES).map(|(lights, name)| {
        let mut lights = lights.to_vec();
        lights.dedup();
        format!("{name}: {}", lights.join(", "))
    });
    let names: Vec<&str> = std::iter::once(ANY_LIGHT).chain(light::NAMES).collect();
    let light = Parameter::choice(
        "light",
        &names,
        &format!(
            "the light: a clear day, dusk with headlights, an overcast sky, or night; any: drawn from the lights of the conditions ({})",
            lights.collect::<Vec<_>>().join("; ")
        ),
    );
    parameters.push(light);
    parameters.extend(SETTINGS.iter().map(|setting| {
        let by_conditions = setting.values.iter().zip(NAMES).map(|((low, high), name)| match low == high {
            true => format!("{name} {low}"),
            false => format!("{name} {low} to {high}"),
        });
        let by_conditions = by_conditions.collect::<Vec<_>>().join(", ");
        let doc = format!("{}; {BY_CONDITIONS}: what the conditions say ({by_conditions})", setting.doc);
        Parameter::number(setting.name, BY_CONDITIONS, &doc)
            .range(BY_CONDITIONS, setting.range.1)
            .unit(setting.unit)
    }));
    parameters
}

impl Conditions {
    /// The conditions that parameters ask for.
    ///
    /// # Errors
    /// If a parameter is set that has no effect in scenes that look like a drawing.
    pub fn new(config: &Config) -> Result<Self> {
        let level = NAMES.iter().position(|name| *name == config.text("conditions")).unwrap_or(0);
        let given = SETTINGS
            .each_ref()
            .map(|setting| Some(config.number(setting.name)).filter(|value| *value != BY_CONDITIONS));
        for (setting, value) in SETTINGS.iter().zip(given) {
            let (low, high) = setting.range;
            if let Some(value) = value.filter(|value| *value < low) {
                return Err(Error::new(format!(
                    "{} is {value}, but has to be from {low} to {high}, or {BY_CONDITIONS} for what the conditions say",
                    setting.name
                )));
            }
        }
        let wrong = SETTINGS
            .iter()
            .zip(given)
            .find(|(setting, value)| setting.natural && value.is_some_and(|v| v > 0.0));
        if let (0, Some((setting, _))) = (level, wrong) {
            return Err(Error::new(format!(
                "{} has no effect with conditions={}, whose scenes are drawn: set conditions to {} or {}, or leave it out",
                setting.name, NAMES[0], NAMES[1], NAMES[2]
            )));
        }
        if let Some(length) = given[index("straight_ends")].filter(|length| 0.0 < *length && *length < 1.0) {
            return Err(Error::new(format!(
                "straight_ends is {length} m, but has to be 0 or at least 1 m: set it to 0 for a road without straight ends"
            )));
        }
        let light = Some(config.text("light")).filter(|light| *light != ANY_LIGHT).map(str::to_owned);
        Ok(Self { level, given, light })
    }

    /// Whether scenes look as cameras see them.
    pub fn natural(&self) -> bool {
        self.level > 0
    }

    /// A value that is the same in all scenarios.
    pub fn fixed(&self, name: &str) -> f64 {
        let setting = index(name);
        self.given[setting].unwrap_or(SETTINGS[setting].values[self.level].0)
    }

    /// What a scenario with this seed draws. A value that is set changes none of the others.
    pub fn draw(&self, seed: u64) -> Drawn {
        let mut random = pdk_sdk::seed::key(seed, "lane conditions", 0).sequence();
        let lights = LIGHTS[self.level];
        let light = lights[random.below(lights.len() as u32) as usize];
        let mut values = [0.0; SETTINGS.len()];
        for ((value, setting), given) in values.iter_mut().zip(&SETTINGS).zip(self.given) {
            let (low, high) = setting.values[self.level];
            *value = low + (high - low) * random.unit();
            *value = given.unwrap_or(*value);
        }
        let light = self.light.clone().unwrap_or_else(|| light.to_owned());
        Drawn { values, light, natural: self.natural() }
    }
}

impl Drawn {
    /// The value of a setting.
    pub fn get(&self, name: &str) -> f64 {
        self.values[index(name)]
    }

    /// How the road has aged.
    pub fn wear(&self) -> wear::Wanted {
        wear::Wanted {
            paint_wear: self.get("paint_wear"),
            paint_missing: self.get("paint_missing"),
            damage: self.get("road_damage"),
            wetness: self.get("wetness"),
        }
    }
}

/// The place of a setting. The names are written in this plugin alone, and a test asks for each.
fn index(name: &str) -> usize {
    SETTINGS.iter().position(|setting| setting.name == name).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::{Map, Value, json};

    fn description() -> Description {
        parameters().into_iter().fold(Description::simulator("lane", "A road"), Description::parameter)
    }

    fn conditions(parameters: Value) -> Result<Conditions> {
        Conditions::new(&Config::check(&description(), parameters.as_object().unwrap())?)
    }

    #[test]
    fn every_setting_lies_within_its_range_and_grows_with_the_conditions() {
        for setting in &SETTINGS {
            let (low, high) = setting.range;
            assert!(
                setting.values.iter().all(|value| low <= value.0 && value.0 <= value.1 && value.1 <= high)
            );
            assert!(setting.values.is_sorted(), "{}", setting.name);
            assert_eq!(SETTINGS[index(setting.name)].name, setting.name);
            assert!(!setting.natural || setting.values[0] == (0.0, 0.0));
        }
    }

    #[test]
    fn what_is_set_wins_and_changes_nothing_else() {
        let plain = conditions(json!({"conditions": "hard"})).unwrap();
        let wet = conditions(json!({"conditions": "hard", "wetness": 0.25, "light": "dusk"})).unwrap();
        for seed in 0..20 {
            let (plain, wet) = (plain.draw(seed), wet.draw(seed));
            assert_eq!((wet.get("wetness"), wet.light.as_str()), (0.25, "dusk"));
            assert_eq!(
                (plain.get("trees"), plain.get("paint_wear")),
                (wet.get("trees"), wet.get("paint_wear"))
            );
            let range = SETTINGS[index("trees")].values[2];
            assert!((range.0..=range.1).contains(&plain.get("trees")));
        }
        assert_eq!(wet.fixed("initial_speed"), 16.0);
    }

    #[test]
    fn hard_scenarios_come_in_every_light_and_easy_ones_by_day() {
        let lights = |name: &str| {
            let conditions = conditions(json!({"conditions": name})).unwrap();
            let mut lights: Vec<_> = (0..200).map(|seed| conditions.draw(seed).light).collect();
            lights.sort();
            lights.dedup();
            lights
        };
        assert_eq!(lights("easy"), ["day"]);
        assert_eq!(lights("standard"), ["day", "overcast"]);
        assert_eq!(lights("hard"), ["day", "dusk", "night", "overcast"]);
    }

    #[test]
    fn what_a_drawing_does_not_show_is_refused() {
        let error = conditions(json!({"wetness": 0.5})).unwrap_err().to_string();
        assert!(error.starts_with("wetness has no effect with conditions=easy"), "{error}");
        assert!(conditions(json!({"wetness": 0, "parked": 5})).is_ok());
        let error = conditions(json!({"segment": 4})).unwrap_err().to_string();
        assert!(error.starts_with("segment is 4, but has to be from 10 to 500"), "{error}");
        let error = conditions(json!({"straight_ends": 0.5})).unwrap_err().to_string();
        assert!(error.starts_with("straight_ends is 0.5 m, but has to be 0 or at least 1 m"), "{error}");
        assert!(conditions(json!({"straight_ends": 0})).is_ok());
        // What is filled in by default may be given back.
        let filled = Config::check(&description(), &Map::new()).unwrap();
        assert!(Config::check(&description(), filled.values()).is_ok());
    }
}
