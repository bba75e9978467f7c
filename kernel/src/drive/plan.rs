//! What to drive, as a pipeline writes it.

use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::chain::Spec;
use crate::component::ComponentSpec;

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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    simulator: Value,
    driver: Value,
    scenarios: Vec<ScenarioRequest>,
    #[serde(default)]
    duration: Option<f64>,
    #[serde(default)]
    images_every: Option<u64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioRequest {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    road: Value,
    #[serde(default)]
    perturbations: Vec<Value>,
    #[serde(default)]
    duration: Option<f64>,
    #[serde(default)]
    seed: Option<u64>,
}

impl Plan {
    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// Where a field is unknown, missing, of the wrong type or out of range.
    pub fn from_json(request: Value) -> Result<Self> {
        let request: Request =
            serde_json::from_value(request).map_err(|error| Error::new(format!("pdk.drive: {error}")))?;
        if request.scenarios.is_empty() {
            return Err(Error::new("pdk.drive: `scenarios` is empty; give it at least one scenario"));
        }
        let duration = request.duration.unwrap_or(DEFAULT_DURATION);
        let scenarios = request.scenarios.into_iter().map(|scenario| scenario.check(duration));
        Ok(Self {
            simulator: ComponentSpec::from_json("simulator", &request.simulator)?,
            driver: ComponentSpec::from_json("driver", &request.driver)?,
            scenarios: scenarios.collect::<Result<_>>()?,
            images_every: request.images_every.unwrap_or(DEFAULT_IMAGES_EVERY),
        })
    }
}

impl ScenarioRequest {
    fn check(self, default_duration: f64) -> Result<ScenarioSpec> {
        let perturbations =
            self.perturbations.iter().map(|p| Spec::from_json(p, 0.0)).collect::<Result<Vec<_>>>()?;
        let name = self.name.unwrap_or_else(|| match perturbations.is_empty() {
            true => "nominal".to_owned(),
            false => perturbations.iter().map(Spec::to_string).collect::<Vec<_>>().join(" + "),
        });
        let duration = self.duration.unwrap_or(default_duration);
        if !(duration > 0.0 && duration <= 86_400.0) {
            return Err(Error::new(format!(
                "scenario `{name}` lasts {duration} s, but has to last more than 0 and at most 86400 s"
            )));
        }
        Ok(ScenarioSpec { name, road: self.road, perturbations, duration, seed: self.seed })
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
            "scenarios": [{}, { "perturbations": ["fog@1", { "name": "rain", "level": 2 }] }],
        }))
        .unwrap();
        assert_eq!(plan.scenarios[0].name, "nominal");
        assert_eq!(plan.scenarios[1].name, "fog@1 + rain@2");
        assert_eq!(plan.scenarios[1].duration, 5.0);
        assert_eq!(plan.driver.parameters["target_speed"], 9);
    }

    #[test]
    fn mistakes_are_named() {
        let error = |request| Plan::from_json(request).unwrap_err().to_string();
        assert!(error(json!({"simulater": "lane"})).contains("unknown field `simulater`"));
        let no_scenarios = json!({"simulator": "lane", "driver": "x", "scenarios": []});
        assert!(error(no_scenarios).contains("`scenarios` is empty"));
        let endless = json!({"simulator": "lane", "driver": "x", "scenarios": [{"duration": -1}]});
        assert!(error(endless).contains("lasts -1 s"));
    }
}
