//! What to drive, as a pipeline writes it.

use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::chain::Spec;
use crate::component::ComponentSpec;
use crate::pipeline::fields::Fields;

/// The time limit of a scenario in seconds of simulation time, where the pipeline sets none.
pub const DEFAULT_DURATION: f64 = 30.0;

/// Every how many frames an image goes into the trace, where the pipeline does not say.
const DEFAULT_IMAGES_EVERY: u64 = 6;

/// Scenarios to drive with one simulator and one driver.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The simulator.
    pub simulator: ComponentSpec,
    /// The driver under test.
    pub driver: ComponentSpec,
    /// The scenarios, in order.
    pub scenarios: Vec<ScenarioSpec>,
    /// Every how many frames an image goes into the trace; 0 for none.
    pub images_every: u64,
    /// What happens while a driver thinks.
    pub mode: Mode,
}

/// What happens while perturbations and driver are at work on a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The simulator waits, so that the outcome does not depend on how fast the machine is.
    #[default]
    Lockstep,
    /// The simulator goes on by the clock under the control before; when the driver is done, it gets the newest frame, and
    /// those in between are skipped.
    Realtime,
}

impl Mode {
    const NAMES: [(&str, Self); 2] = [("lockstep", Self::Lockstep), ("realtime", Self::Realtime)];

    /// Whether it is lockstep, which records leave unsaid.
    pub fn is_lockstep(&self) -> bool {
        *self == Self::Lockstep
    }

    fn named(name: &str) -> Result<Self> {
        let found = Self::NAMES.into_iter().find(|(known, _)| *known == name);
        found.map(|(_, mode)| mode).ok_or_else(|| {
            Error::new(format!("pdk.drive: `mode` is `{name}`, but has to be lockstep or realtime"))
        })
    }
}

/// One scenario: a road, perturbations with intensities, a seed and a duration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScenarioSpec {
    /// What it is called in tables.
    pub name: String,
    /// The road, in the simulator's own terms; null for its default road.
    pub road: Value,
    /// The perturbations, in the order in which a frame goes through them.
    pub perturbations: Vec<Spec>,
    /// The time limit in seconds of simulation time.
    pub duration: f64,
    /// The seed for what the simulator makes up; null for the seed of the run.
    pub seed: Option<u64>,
}

impl Plan {
    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// Where a field is unknown, missing, of the wrong type or out of range.
    pub fn from_json(request: Value) -> Result<Self> {
        let known = ["simulator", "driver", "scenarios", "duration", "images_every", "mode"];
        let mut request = Fields::new("pdk.drive", request, &known)?;
        let simulator = ComponentSpec::from_json("simulator", &request.needed("simulator")?)?;
        let driver = ComponentSpec::from_json("driver", &request.needed("driver")?)?;
        let duration = request.number("duration")?.unwrap_or(DEFAULT_DURATION);
        let scenarios = request.filled_list("scenarios")?.into_iter().enumerate();
        Ok(Self {
            simulator,
            driver,
            scenarios: scenarios
                .map(|(index, scenario)| {
                    // As Lua counts.
                    ScenarioSpec::from_json(&format!("scenarios[{}]", index + 1), scenario, duration)
                })
                .collect::<Result<_>>()?,
            images_every: request.whole("images_every")?.unwrap_or(DEFAULT_IMAGES_EVERY),
            mode: request.text("mode")?.map_or(Ok(Mode::default()), |name| Mode::named(&name))?,
        })
    }
}

/// A perturbation in a name: a course of intensities has too many numbers for one.
fn short(spec: &Spec) -> String {
    match spec.level.constant() {
        Some(_) => spec.to_string(),
        None => format!("{} over time", spec.label()),
    }
}

impl ScenarioSpec {
    /// Reads what a pipeline wrote; `place` says in errors which scenario it is.
    fn from_json(place: &str, scenario: Value, default_duration: f64) -> Result<Self> {
        let known = ["name", "road", "perturbations", "duration", "seed"];
        let mut scenario = Fields::new(format!("pdk.drive: {place}"), scenario, &known)?;
        let perturbations = scenario.list("perturbations")?.unwrap_or_default();
        let perturbations = perturbations
            .iter()
            .map(|perturbation| Spec::from_json(perturbation, 0.0).map_err(|error| error.at(place)))
            .collect::<Result<Vec<_>>>()?;
        let name = scenario.text("name")?.unwrap_or_else(|| match perturbations.is_empty() {
            true => "nominal".to_owned(),
            false => perturbations.iter().map(short).collect::<Vec<_>>().join(" + "),
        });
        let duration = scenario.number("duration")?.unwrap_or(default_duration);
        if !(duration > 0.0 && duration <= 86_400.0) {
            return Err(Error::new(format!(
                "scenario `{name}` lasts {duration} s, but has to last more than 0 and at most 86400 s"
            )));
        }
        Ok(Self { name, road: scenario.any("road"), perturbations, duration, seed: scenario.whole("seed")? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn scenarios_are_named_after_their_perturbations() {
        let plan = Plan::from_json(json!({
            "simulator": "lane",
            "driver": { "name": "lane_keeper", "target_speed": 9 },
            "duration": 5,
            "scenarios": [{}, { "perturbations": ["fog@1", { "name": "rain", "level": 2 }] },
                { "perturbations": ["fog@1", { "name": "rain", "level": { "points": [[0, 1], [1, 2]] } }] }],
        }))
        .unwrap();
        assert_eq!(plan.scenarios[0].name, "nominal");
        assert_eq!(plan.scenarios[1].name, "fog@1 + rain@2");
        assert_eq!(plan.scenarios[2].name, "fog@1 + rain over time");
        assert_eq!(plan.scenarios[1].duration, 5.0);
        assert_eq!(plan.driver.parameters["target_speed"], 9);
    }

    #[test]
    fn mistakes_are_named() {
        let error = |request| Plan::from_json(request).unwrap_err().to_string();
        assert!(
            error(json!({"simulater": "lane"})).contains("no field `simulater`; did you mean `simulator`?")
        );
        let no_scenarios = json!({"simulator": "lane", "driver": "x", "scenarios": []});
        assert!(error(no_scenarios).contains("`scenarios` is empty"));
        let endless = json!({"simulator": "lane", "driver": "x", "scenarios": [{"duration": -1}]});
        assert!(error(endless).contains("lasts -1 s"));
        let with = |field: &str, value: Value| {
            let mut scenario = json!({});
            scenario[field] = value;
            error(json!({"simulator": "lane", "driver": "x", "scenarios": [{}, scenario]}))
        };
        assert_eq!(
            with("perturbations", json!("contrast@1")),
            "pdk.drive: scenarios[2]: `perturbations` is \"contrast@1\", but has to be a list: { ... }"
        );
        assert!(
            with("seed", json!(1.5))
                .starts_with("pdk.drive: scenarios[2]: `seed` is 1.5, but has to be a whole")
        );
        assert!(with("perturbations", json!(["fog@9"])).starts_with("scenarios[2]: the level in `fog@9`"));
        assert!(with("lenght", json!(1)).contains("scenarios[2]: there is no field `lenght`"));
        let images = json!({"simulator": "lane", "driver": "x", "scenarios": [{}], "images_every": -1});
        assert_eq!(
            error(images),
            "pdk.drive: `images_every` is -1, but has to be a whole number of at least 0"
        );
    }
}
