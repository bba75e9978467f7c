//! What a pipeline writes, as scenarios to drive and evaluations to make.

use std::collections::{BTreeMap, BTreeSet};

use pdk_components::catalog::Catalog;
use pdk_model::canonical::canonical;
use pdk_model::component::ComponentSpec;
use pdk_model::failure::FailureCriteria;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{DEFAULT_DURATION, Mode, Scenario};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed;
use pdk_session::session::Submission;
use serde_json::Value;

use crate::fields::Fields;
use crate::given_road;
use crate::run_settings::RunSettings;

/// The field of `pdk.drive` with the list of scenarios.
pub const SCENARIOS: &str = "scenarios";
/// Every how many frames an image goes into the trace, where the pipeline does not say.
const DEFAULT_IMAGES_EVERY: u64 = 6;
/// The drift of the steering that an evaluation tolerates, if the pipeline does not say.
const DEFAULT_TOLERANCE: f64 = 0.1;
/// The longest scenario in seconds: a day.
const LONGEST: f64 = 86_400.0;

/// Writes [`Shared`] from a list of `field: type, how it is read`.
macro_rules! shared {
    ($($name:ident: $type:ty, $read:ident;)*) => {
        /// What a request may say for all of its scenarios, and a scenario for itself; none if it is not set.
        #[derive(Debug, Clone, Default)]
        struct Shared {
            $($name: Option<$type>,)*
        }

        impl Shared {
            const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// What the fields of a table say, and for the rest what is there already.
            fn take(self, fields: &mut Fields) -> Result<Self> {
                Ok(Self { $($name: $read(fields, stringify!($name), self.$name)?,)* })
            }
        }
    };
}

shared! {
    simulator: ComponentSpec, component;
    driver: ComponentSpec, component;
    duration: f64, duration;
    failure: FailureCriteria, failure;
    images_every: u64, whole;
    mode: Mode, mode;
}

/// The names of the fields that a request may have for all of its scenarios.
pub const SHARED: &[&str] = Shared::NAMES;

fn component(
    fields: &mut Fields,
    name: &str,
    before: Option<ComponentSpec>,
) -> Result<Option<ComponentSpec>> {
    match fields.any(name) {
        Value::Null => Ok(before),
        value => ComponentSpec::from_json(name, &value).map(Some),
    }
}

fn whole(fields: &mut Fields, name: &str, before: Option<u64>) -> Result<Option<u64>> {
    Ok(fields.whole(name)?.or(before))
}

fn mode(fields: &mut Fields, name: &str, before: Option<Mode>) -> Result<Option<Mode>> {
    Ok(fields.text(name)?.map(|text| fields.read(&text)).transpose()?.or(before))
}

fn duration(fields: &mut Fields, name: &str, before: Option<f64>) -> Result<Option<f64>> {
    let Some(duration) = fields.number(name)? else { return Ok(before) };
    match duration > 0.0 && duration <= LONGEST {
        true => Ok(Some(duration)),
        false => Err(Error::new(format!(
            "{}: `{name}` is {duration} s, but has to be more than 0 and at most {LONGEST} s",
            fields.table()
        ))),
    }
}
/// What `failure` may say.
const FAILURE: [&str; 5] =
    ["lane_departure", "comparison", "standstill_speed", "standstill_seconds", "over_line"];

/// The defaults of scenarios.
#[derive(Debug, Clone)]
pub struct Defaults {
    shared: Shared,
    /// The seed of the run.
    seed: u64,
    /// The simulators with their own clock.
    own_clock: BTreeSet<String>,
}

impl Defaults {
    /// Those of a run in which a pipeline has set none. Simulators with their own clock are driven in real time only.
    pub fn of_run(settings: &RunSettings, catalog: &Catalog) -> Self {
        let simulators = catalog.of_kind(Kind::Simulator).map(|entry| &entry.description);
        let own_clock = simulators.filter(|simulator| !simulator.clock.is_stepped());
        Self {
            shared: Shared::default(),
            seed: settings.seed,
            own_clock: own_clock.map(|simulator| simulator.name.clone()).collect(),
        }
    }

    /// The defaults in a table such as `pdk.session` takes.
    ///
    /// # Errors
    /// If a field is unknown, of the wrong type or out of range.
    pub fn read(self, function: &str, request: Value) -> Result<Self> {
        self.take(&mut Fields::new(function, request, SHARED)?)
    }

    /// The defaults among the fields of a table, which has others too.
    ///
    /// # Errors
    /// As for [`Defaults::read`].
    pub fn take(self, fields: &mut Fields) -> Result<Self> {
        Ok(Self { shared: self.shared.take(fields)?, ..self })
    }

    /// The defaults in what `pdk.drive` takes. Its scenarios are read one by one: of a list of them, any entry may stand for all.
    ///
    /// # Errors
    /// If a field is unknown, missing, of the wrong type or out of range.
    pub fn drive(self, request: Value) -> Result<Self> {
        let known: Vec<&str> = SHARED.iter().copied().chain([SCENARIOS]).collect();
        let mut fields = Fields::new("pdk.drive", request, &known)?;
        fields.filled_list(SCENARIOS)?;
        self.take(&mut fields)
    }

    /// A scenario in a table; `place` says in errors which.
    ///
    /// # Errors
    /// If a field is unknown, missing, of the wrong type or out of range.
    pub fn submission(&self, place: &str, table: Value) -> Result<Submission> {
        let own = Scenario::FIELDS.iter().filter(|field| !field.luau_type.is_empty()).map(|field| field.name);
        let known: Vec<&str> = own.chain(SHARED.iter().copied()).chain(["name"]).collect();
        let mut fields = Fields::new(place, table, &known)?;
        let perturbations = fields.list("perturbations")?.unwrap_or_default();
        let perturbations = perturbations
            .iter()
            .map(|perturbation| AppliedPerturbation::from_json(perturbation).map_err(|error| error.at(place)))
            .collect::<Result<Vec<_>>>()?;
        let (name, road) = (fields.text("name")?, fields.any("road"));
        given_road::check(place, &road)?;
        let (own_seed, repeat) = (fields.seed("seed")?, fields.whole("repeat")?.unwrap_or_default());
        let Shared { simulator, driver, duration, failure, images_every, mode } =
            self.shared.clone().take(&mut fields)?;
        let needed = |what: &str, component: Option<ComponentSpec>| {
            component.ok_or_else(|| Error::new(format!("{place}: `{what}` is missing")))
        };
        let simulator = needed("simulator", simulator)?;
        let mode = match (mode, self.own_clock.contains(&simulator.name)) {
            (None, true) => Mode::Realtime,
            (Some(Mode::Lockstep), true) => {
                return Err(Error::new(format!(
                    "{place}: simulator `{}` has its own clock and does not wait for the driver; set `mode` to {}, or leave it out",
                    simulator.name,
                    Mode::Realtime
                )));
            }
            (mode, _) => mode.unwrap_or_default(),
        };
        let scenario = Scenario {
            simulator,
            driver: needed("driver", driver)?,
            seed: own_seed.unwrap_or_else(|| seed::of_scenario(self.seed, &canonical(&road), repeat)),
            road,
            perturbations,
            duration: duration.unwrap_or(DEFAULT_DURATION),
            failure: failure.unwrap_or_default(),
            mode,
            repeat,
            // They are noted when the scenario is submitted.
            files: BTreeMap::new(),
        };
        let images_every = images_every.unwrap_or(DEFAULT_IMAGES_EVERY);
        Ok(Submission { name: name.unwrap_or_else(|| scenario.default_name()), scenario, images_every })
    }
}

/// What counts as a failure: what the table says, and for the rest what is there already.
fn failure(
    fields: &mut Fields,
    name: &str,
    before: Option<FailureCriteria>,
) -> Result<Option<FailureCriteria>> {
    let table = fields.any(name);
    if table.is_null() {
        return Ok(before);
    }
    let (place, defaults) = (fields.table().to_owned(), before.unwrap_or_default());
    let mut fields = Fields::new(format!("{place}: `{name}`"), table, &FAILURE)?;
    let comparison = fields.text("comparison")?;
    let criteria = FailureCriteria {
        lane_departure: fields.number("lane_departure")?.or(defaults.lane_departure),
        comparison: comparison.map_or(Ok(defaults.comparison), |name| fields.read(&name))?,
        standstill_speed: fields.number("standstill_speed")?.unwrap_or(defaults.standstill_speed),
        standstill_seconds: fields.number("standstill_seconds")?.unwrap_or(defaults.standstill_seconds),
        over_line: fields.number("over_line")?.unwrap_or(defaults.over_line),
    };
    criteria.check().map_err(|error| error.at(place))?;
    Ok(Some(criteria))
}

/// What to evaluate.
#[derive(Debug, Clone)]
pub struct Evaluate {
    /// Where the frames come from.
    pub dataset: DatasetSpec,
    /// The driver under test.
    pub driver: ComponentSpec,
    /// Each perturbation at each level.
    pub cells: Vec<AppliedPerturbation>,
    /// At most this many frames, from the first.
    pub frames: Option<usize>,
    /// Whether the driver is ranked however it does on the frames as they are.
    pub trust: bool,
    /// The drift of the steering of which the levels are looked for that exceed it.
    pub tolerance: f64,
}

/// Where the frames come from.
#[derive(Debug, Clone)]
pub enum DatasetSpec {
    /// A folder; the reader is found by trying.
    Path(String),
    /// A reader with its parameters.
    Reader(ComponentSpec),
}

impl DatasetSpec {
    /// What a pipeline or a suite names: a text is a folder or a file, and all else a reader.
    ///
    /// # Errors
    /// If it is neither.
    pub fn from_json(value: &Value) -> Result<Self> {
        Ok(match value {
            Value::String(path) => Self::Path(path.clone()),
            other => Self::Reader(ComponentSpec::from_json("dataset", other)?),
        })
    }
}

impl Evaluate {
    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// If a field is unknown, missing or of the wrong type, or a level is out of range.
    pub fn from_json(request: Value) -> Result<Self> {
        let known = ["dataset", "driver", "perturbations", "levels", "frames", "trust", "tolerance"];
        let mut fields = Fields::new("pdk.evaluate", request, &known)?;
        let dataset = dataset(&mut fields)?;
        let driver = ComponentSpec::from_json("driver", &fields.needed("driver")?)?;
        let frames = fields.whole("frames")?.map(|frames| usize::try_from(frames).unwrap_or(usize::MAX));
        let trust = fields.truth("trust")?.unwrap_or_default();
        let tolerance = fields.number("tolerance")?.unwrap_or(DEFAULT_TOLERANCE);
        if tolerance.is_nan() || tolerance < 0.0 {
            return Err(Error::new(format!(
                "pdk.evaluate: `tolerance` is {tolerance}, but has to be a number of at least 0"
            )));
        }
        let cells = cells(&mut fields)?;
        Ok(Self { dataset, driver, cells, frames, trust, tolerance })
    }
}

/// Where frames come from, as a request has it.
///
/// # Errors
/// If it is missing, or is not a dataset.
pub fn dataset(fields: &mut Fields) -> Result<DatasetSpec> {
    DatasetSpec::from_json(&fields.needed("dataset")?)
}

/// Each perturbation of a request at each of its levels.
///
/// # Errors
/// If one is missing, unknown or out of range.
pub fn cells(fields: &mut Fields) -> Result<Vec<AppliedPerturbation>> {
    let perturbations = fields.filled_list("perturbations")?;
    let levels = fields.filled_list("levels")?;
    let mut cells = Vec::new();
    for perturbation in &perturbations {
        let applied = AppliedPerturbation::from_json_without_level(perturbation)?;
        for level in &levels {
            let number = level.as_f64().ok_or_else(|| {
                Error::new(format!(
                    "pdk.evaluate: {level} in `levels` is not a number; they are numbers from 0 to 4"
                ))
            })?;
            pdk_model::level::Level::from_json("levels", level)?;
            cells.push(applied.clone().at_level(number));
        }
    }
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn drive(request: Value) -> Result<Vec<Submission>> {
        let own_clock = BTreeSet::from(["donkey".to_owned()]);
        let scenarios = request[SCENARIOS].as_array().cloned().unwrap_or_default();
        let defaults = Defaults { shared: Shared::default(), seed: 0, own_clock }.drive(request)?;
        let one = |(number, scenario)| {
            defaults.submission(&format!("pdk.drive: scenarios[{}]", number + 1), scenario)
        };
        scenarios.into_iter().enumerate().map(one).collect()
    }

    #[test]
    fn a_simulator_with_its_own_clock_is_driven_in_real_time() {
        let mode = |simulator: &str, mode: Value| {
            let scenario = json!({"simulator": simulator, "mode": mode});
            drive(json!({"driver": "x", "scenarios": [scenario]})).map(|all| all[0].scenario.mode)
        };
        assert_eq!(mode("lane", Value::Null), Ok(Mode::Lockstep));
        assert_eq!(mode("lane", json!("realtime")), Ok(Mode::Realtime));
        assert_eq!(mode("donkey", Value::Null), Ok(Mode::Realtime));
        assert_eq!(mode("donkey", json!("realtime")), Ok(Mode::Realtime));
        let error = mode("donkey", json!("lockstep")).unwrap_err();
        assert!(error.message().contains("simulator `donkey` has its own clock"), "{error}");
    }

    #[test]
    fn scenarios_are_named_after_their_perturbations() {
        let all = drive(json!({
            "simulator": "lane",
            "driver": { "name": "lane_keeper", "target_speed": 9 },
            "duration": 5,
            "scenarios": [{}, { "perturbations": ["fog@1", { "name": "rain", "level": 3 }], "driver": "x" },
                { "perturbations": ["fog", { "name": "rain", "level": { "points": [[0, 1], [1, 2]] } }] }],
        }))
        .unwrap();
        let names: Vec<_> = all.iter().map(|submission| submission.name.as_str()).collect();
        assert_eq!(names, ["nominal", "fog@1 + rain@3", "fog@2 + rain over time"]);
        assert_eq!(all[1].scenario.duration, 5.0);
        assert_eq!(all[0].scenario.driver.parameters["target_speed"], 9);
        assert_eq!(all[1].scenario.driver.name, "x");
    }

    #[test]
    fn luck_follows_from_road_and_repeat() {
        let with = |scenario: Value| {
            drive(json!({"simulator": "lane", "driver": "x", "scenarios": [{}, scenario]})).unwrap()[1]
                .scenario
                .clone()
        };
        let seed = |scenario: Value| with(scenario).seed;
        let nominal = seed(json!({"road": {"angles": [0, 1]}}));
        assert_eq!(
            nominal,
            seed(json!({"road": {"angles": [0, 1.0]}, "perturbations": ["fog@1"], "name": "x"}))
        );
        assert_ne!(nominal, seed(json!({"road": {"angles": [0, 2]}})));
        assert_ne!(nominal, seed(json!({"road": {"angles": [0, 1]}, "repeat": 1})));
        assert_eq!(seed(json!({"seed": 9_007_199_254_740_991_u64})), 9_007_199_254_740_991);
        assert_ne!(with(json!({"repeat": 1, "seed": 1})).id(), with(json!({"repeat": 2, "seed": 1})).id());
        assert_eq!(with(json!({"name": "a"})).id(), with(json!({"name": "b"})).id());
    }

    #[test]
    fn mistakes_in_drives_are_named() {
        let error = |request| drive(request).unwrap_err().to_string();
        assert!(
            error(json!({"simulater": "lane"})).contains("no field `simulater`; did you mean `simulator`?")
        );
        let no_scenarios = json!({"simulator": "lane", "driver": "x", "scenarios": []});
        assert!(error(no_scenarios).contains("`scenarios` is empty"));
        assert_eq!(
            error(json!({"driver": "x", "scenarios": [{}]})),
            "pdk.drive: scenarios[1]: `simulator` is missing"
        );
        let with = |field: &str, value: Value| {
            let mut scenario = json!({});
            scenario[field] = value;
            error(json!({"simulator": "lane", "driver": "x", "scenarios": [{}, scenario]}))
        };
        assert!(with("duration", json!(-1)).starts_with("pdk.drive: scenarios[2]: `duration` is -1 s"));
        assert_eq!(
            with("perturbations", json!("contrast@1")),
            "pdk.drive: scenarios[2]: `perturbations` is \"contrast@1\", but has to be a list: { ... }"
        );
        assert!(
            with("seed", json!(1.5))
                .starts_with("pdk.drive: scenarios[2]: `seed` is 1.5, but has to be a whole")
        );
        // What Lua makes of 2^53 + 1, and what other languages do not round.
        for large in [json!(1_u64 << 53), json!((1_u64 << 53) + 1), json!(u64::MAX), json!(1e18)] {
            let error = with("seed", large);
            assert!(error.contains("`seed` is ") && error.contains("from 0 to 9007199254740991"), "{error}");
        }
        assert_eq!(
            with("road", json!({"angles": [0, "x"]})),
            "pdk.drive: scenarios[2]: `road.angles[2]` is \"x\", but has to be a number"
        );
        assert!(with("perturbations", json!(["fog@9"])).contains("scenarios[2]: the level in `fog@9`"));
        assert!(with("lenght", json!(1)).contains("scenarios[2]: there is no field `lenght`"));
        assert!(with("mode", json!("fast")).contains("has to be lockstep or realtime"));
        let images = json!({"simulator": "lane", "driver": "x", "scenarios": [{}], "images_every": -1});
        assert_eq!(
            error(images),
            "pdk.drive: `images_every` is -1, but has to be a whole number of at least 0"
        );
    }

    #[test]
    fn a_scenario_says_what_counts_as_a_failure() {
        let all = drive(json!({
            "simulator": "lane", "driver": "x", "failure": {"lane_departure": 4, "standstill_seconds": 3},
            "scenarios": [{}, {"failure": {"lane_departure": 2, "comparison": "more_than"}}],
        }))
        .unwrap();
        let limits = |index: usize| {
            let failure = all[index].scenario.failure;
            (failure.lane_departure, failure.comparison.name(), failure.standstill_seconds, failure.over_line)
        };
        assert_eq!(limits(0), (Some(4.0), "at_least", 3.0, 1.1));
        assert_eq!(limits(1), (Some(2.0), "more_than", 3.0, 1.1));
        let error = |failure: Value| {
            drive(json!({"simulator": "lane", "driver": "x", "scenarios": [{"failure": failure}]}))
                .unwrap_err()
                .to_string()
        };
        assert!(
            error(json!({"xte": 4}))
                .starts_with("pdk.drive: scenarios[1]: `failure`: there is no field `xte`")
        );
        assert!(
            error(json!({"lane_departure": -1}))
                .contains("scenarios[1]: `lane_departure` in `failure` is -1 m")
        );
        assert!(error(json!({"comparison": ">"})).contains("has to be at_least or more_than"));
    }

    #[test]
    fn mistakes_in_evaluations_are_named() {
        let error = |field: &str, value: Value| {
            let mut request =
                json!({"dataset": "x", "driver": "y", "perturbations": ["fog"], "levels": [1], "frames": 3});
            assert_eq!(Evaluate::from_json(request.clone()).unwrap().cells.len(), 1);
            request[field] = value;
            Evaluate::from_json(request).unwrap_err().to_string()
        };
        for (field, value, part) in [
            ("levels", json!([]), "pdk.evaluate: `levels` is empty; give it"),
            ("perturbations", json!([]), "pdk.evaluate: `perturbations` is empty; give it"),
            ("perturbations", json!("fog"), "pdk.evaluate: `perturbations` is \"fog\", but has to be a list"),
            ("levels", json!(["high"]), "pdk.evaluate: \"high\" in `levels` is not a number"),
            ("levels", json!([9]), "the level in `levels` is 9, but has to be"),
            ("frames", json!(-1), "pdk.evaluate: `frames` is -1, but has to be a whole number"),
            ("perturbations", json!(["fog@1"]), "level"),
            ("frmes", json!(1), "pdk.evaluate: there is no field `frmes`; did you mean `frames`?"),
        ] {
            let error = error(field, value);
            assert!(error.contains(part), "{error}");
        }
    }
}
