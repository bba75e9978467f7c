//! The scenarios of a suite in the order in which they are looked at. Each follows from the hash of the suite and its number, so it is the
//! same on every machine and for every driver, and each that is drawn has a road, a perturbation, a level and luck of its own.

use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{DEFAULT_DURATION, Scenario};
use pdk_road::{MapBox, Road};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed::Random;
use serde_json::{Value, json};

use crate::loaded::Loaded;
use crate::recording::Block;
use crate::requirement::Kind;
use crate::series::{Series, key, order};
use crate::stretch::Stretch;
use crate::suite::{Roads, Suite};

/// How many roads are drawn until one is valid.
const ATTEMPTS: usize = 10_000;

/// A scenario of a suite.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Where it comes from.
    pub series: Series,
    /// Its number in the series, from 0.
    pub number: usize,
    /// The perturbation of a drawn scenario as the suite writes it; none for a clear view.
    pub perturbation: Option<String>,
    /// Its level.
    pub level: Option<f64>,
    /// The place of a drawn block among the blocks of its recordings; none for a road.
    pub place: Option<usize>,
    /// The scenario, without a driver.
    pub scenario: Scenario,
}

impl Step {
    /// Whether both drivers drive it.
    pub fn is_pair(&self) -> bool {
        !matches!(self.series, Series::Requirement(_))
    }

    /// What tables call it.
    pub fn title(&self) -> String {
        let Self { series, number, .. } = self;
        let name = format!("{series} {}: {}", number + 1, self.scenario.default_name());
        match Stretch::of(&self.scenario) {
            Some(Stretch { start, end, .. }) => format!("{name}, frames {start} to {}", end - 1),
            None => name,
        }
    }
}

/// All scenarios of a suite, in order: the fixed ones, those of requirements about a measure, and those that are drawn.
///
/// # Errors
/// The iterator has an error if no valid road can be drawn.
pub fn steps(loaded: &Loaded) -> impl Iterator<Item = Result<Step>> + '_ {
    let suite = &loaded.suite;
    let fixed = (0..suite.scenarios.len()).map(|number| (Series::Fixed, number));
    let required = suite.required();
    let measured: Vec<(Series, usize)> = (0..)
        .zip(&required)
        .filter_map(|(place, requirement)| match &requirement.kind {
            Kind::Measure { on: [_, of], .. } => {
                Some((0..*of).map(move |number| (Series::Requirement(place), number)))
            }
            _ => None,
        })
        .flatten()
        .collect();
    let drawn = (0..loaded.pairs()).map(|number| (Series::Drawn, number));
    fixed.chain(measured).chain(drawn).map(move |(series, number)| step(loaded, series, number))
}

/// A scenario of a suite by its series and number.
///
/// # Errors
/// If there is no such scenario, or no valid road can be drawn.
pub fn step(loaded: &Loaded, series: Series, number: usize) -> Result<Step> {
    let suite = &loaded.suite;
    if series == Series::Fixed {
        let scenario = suite.fixed(number)?;
        return Ok(Step { series, number, perturbation: None, level: None, place: None, scenario });
    }
    let mut random = key(&loaded.hash, series, number).sequence();
    if !suite.recordings.is_empty() {
        return of_recording(loaded, series, number, &mut random);
    }
    let place = usize::try_from(random.below(suite.places.len() as u32)).unwrap_or_default();
    let place = suite.places.get(place).ok_or_else(|| Error::new("the suite has no [[place]]"))?;
    let road = road(&mut random, &place.road)?;
    let seed = random.next_u64() >> 11;
    let (perturbation, applied) = perturbed(suite, series, &mut random)?;
    let level = level_of(applied.as_ref());
    let perturbations = applied.into_iter().collect();
    let scenario = Scenario { road, perturbations, seed, ..place.scenario()? };
    Ok(Step { series, number, perturbation, level, place: None, scenario })
}

/// A block of a recording. Each is drawn once, in a random order, so that blocks that are looked at early are rarely neighbours.
fn of_recording(loaded: &Loaded, series: Series, number: usize, random: &mut Random) -> Result<Step> {
    let opened = &loaded.opened;
    let (block, place) = match series {
        Series::Requirement(_) => {
            let mut order = order(&loaded.hash, series).sequence();
            (opened.drawn_apart(number, &mut order), None)
        }
        _ => {
            let block = opened.drawn(number);
            (block, block.map(|block| block.place))
        }
    };
    let Block { reader, stretch, .. } = block.ok_or_else(|| {
        Error::new(format!(
            "the recordings have {} blocks, which is not enough for `{series} {}`; name longer recordings, or set a smaller `block`",
            opened.blocks.len(),
            number + 1
        ))
    })?;
    let seed = random.next_u64() >> 11;
    let (perturbation, applied) = perturbed(&loaded.suite, series, random)?;
    let level = level_of(applied.as_ref());
    let scenario = Scenario {
        simulator: reader.clone(),
        road: serde_json::to_value(stretch)?,
        perturbations: applied.into_iter().collect(),
        duration: DEFAULT_DURATION,
        seed,
        ..Scenario::default()
    };
    Ok(Step { series, number, perturbation, level, place, scenario })
}

fn perturbed(suite: &Suite, series: Series, random: &mut Random) -> Result<Drawn> {
    match series {
        Series::Requirement(place) => required_perturbation(suite, place),
        _ => drawn_perturbation(suite, random),
    }
}

fn level_of(applied: Option<&AppliedPerturbation>) -> Option<f64> {
    applied.and_then(|applied| serde_json::to_value(applied).ok()?.get("level")?.as_f64())
}

fn road(random: &mut Random, roads: &Roads) -> Result<Value> {
    let lengths = vec![roads.segment; roads.segments];
    let map = MapBox::for_segments(&lengths);
    let mut refused = String::new();
    for _ in 0..ATTEMPTS {
        let angles = pdk_road::random_angles(random, roads.segments, roads.limit as i32);
        let valid = Road::from_angles(&angles, &lengths).and_then(|road| {
            pdk_road::check(&road, pdk_road::WIDTH, &map)?;
            pdk_road::check_bends(&road, pdk_road::SMALLEST_RADIUS)
        });
        match valid {
            Ok(()) => return Ok(json!({"angles": angles, "segment": roads.segment})),
            Err(reason) => refused = reason,
        }
    }
    Err(Error::new(format!(
        "no valid road of {} segments in {ATTEMPTS} attempts; the last: {refused}; allow smaller angles with `limit`",
        roads.segments
    )))
}

type Drawn = (Option<String>, Option<AppliedPerturbation>);

fn drawn_perturbation(suite: &Suite, random: &mut Random) -> Result<Drawn> {
    if random.unit() < suite.nominal {
        return Ok((None, None));
    }
    let one = |random: &mut Random, count: usize| random.below(count as u32) as usize;
    let Some(text) = suite.perturbations.get(one(random, suite.perturbations.len())) else {
        return Ok((None, None));
    };
    let levels = suite.levels_of(text)?;
    let applied = levels.get(one(random, levels.len())).cloned();
    Ok((Some(text.clone()), applied))
}

fn required_perturbation(suite: &Suite, place: usize) -> Result<Drawn> {
    let required = suite.required();
    let Some(Kind::Measure { at, .. }) = required.get(place).map(|requirement| &requirement.kind) else {
        return Err(Error::new(format!("the requirement {} has no scenarios of its own", place + 1)));
    };
    let applied = at.as_deref().map(|at| AppliedPerturbation::from_json(&Value::from(at))).transpose()?;
    Ok((at.clone(), applied))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::fixture::{RECORDED, SMALL, open_recorded, suite};
    use crate::suite::Place;
    use pdk_model::scenario::Mode;

    #[test]
    fn scenarios_follow_from_the_contents_and_their_number() {
        let loaded = suite(SMALL).unwrap();
        let all: Vec<Step> = steps(&loaded).collect::<Result<_>>().unwrap();
        assert_eq!(all.len(), 50);
        assert_eq!(all[17], step(&loaded, Series::Drawn, 17).unwrap());
        let seeds: BTreeSet<u64> = all.iter().map(|step| step.scenario.seed).collect();
        let roads: BTreeSet<String> = all.iter().map(|step| step.scenario.road.to_string()).collect();
        assert_eq!((seeds.len(), roads.len()), (50, 50));
        // Each of what can be drawn is drawn.
        let drawn: BTreeSet<String> = all.iter().map(|step| step.scenario.default_name()).collect();
        assert_eq!(drawn.into_iter().collect::<Vec<_>>(), ["fog@1", "fog@2", "nominal", "rain@3"]);
        assert!(all.iter().all(|step| step.scenario.road["angles"].as_array().unwrap().len() == 4));
        assert!(
            all.iter()
                .filter(|step| step.perturbation.as_deref() == Some("rain@3"))
                .all(|step| step.level == Some(3.0))
        );
        let other = suite(&SMALL.replace("version = 1", "version = 2")).unwrap();
        assert_ne!(step(&other, Series::Drawn, 17).unwrap().scenario.seed, all[17].scenario.seed);
    }

    #[test]
    fn a_drawn_scenario_has_all_that_its_place_says() {
        let place = "duration = 12\nmode = \"realtime\"\nfailure = { lane_departure = 4 }";
        let loaded = suite(&SMALL.replace("duration = 12", place)).unwrap();
        let drawn = step(&loaded, Series::Drawn, 17).unwrap().scenario;
        // A field that scenarios get is either drawn or has to come from the place, and does not compile until it stands here.
        let Scenario {
            simulator,
            duration,
            failure,
            mode,
            driver,
            road,
            perturbations: _,
            seed,
            repeat,
            files,
        } = drawn;
        assert_eq!((simulator.to_string().as_str(), duration), ("flat (light=dusk)", 12.0));
        assert_eq!((failure.lane_departure, mode), (Some(4.0), Mode::Realtime));
        assert!(driver.name.is_empty() && repeat == 0 && files.is_empty());
        assert!(road["angles"].is_array() && seed > 0);
        assert_eq!(Place::known().collect::<Vec<_>>(), ["simulator", "duration", "failure", "mode"]);
        // A name is a simulator with its defaults, and time has its default, too.
        let simulator = "simulator = { name = \"flat\", light = \"dusk\" }";
        let plain = SMALL.replace(simulator, "simulator = \"flat\"").replace("duration = 12", "");
        let drawn = step(&suite(&plain).unwrap(), Series::Drawn, 0).unwrap().scenario;
        assert_eq!((drawn.simulator.to_string().as_str(), drawn.duration), ("flat", DEFAULT_DURATION));
    }

    #[test]
    fn a_requirement_about_a_measure_has_roads_of_its_own() {
        let text =
            "[[require]]\nkind = \"measure\"\nmeasure = \"time\"\nat = \"fog@2\"\nbelow = 9\non = [2, 3]";
        let loaded = suite(&format!("{SMALL}\n[[require]]\nkind = \"not_worse\"\n{text}")).unwrap();
        let all: Vec<Step> = steps(&loaded).collect::<Result<_>>().unwrap();
        assert_eq!(all.len(), 53);
        for step in &all[..3] {
            assert_eq!(
                (step.series, step.scenario.default_name()),
                (Series::Requirement(1), "fog@2".to_owned())
            );
            assert!(!step.is_pair());
        }
        for series in [Series::Fixed, Series::Drawn, Series::Requirement(4)] {
            assert_eq!(series.to_string().parse::<Series>().unwrap(), series);
        }
        assert!("requirement 0".parse::<Series>().is_err());
    }

    #[test]
    fn blocks_of_a_recording_are_drawn_once_each_with_luck_of_their_own() {
        let text = RECORDED.replace("levels = [1, 2]", "levels = [1, 2]\nnominal = 0.25");
        let measure =
            "kind = \"measure\"\nmeasure = \"steering_error\"\nat = \"fog@2\"\nbelow = 9\non = [2, 3]";
        let text = format!("{text}\n[[require]]\n{measure}\n[[require]]\nkind = \"not_worse\"");
        let mut loaded = suite(&text).unwrap();
        assert_eq!(steps(&loaded).next().unwrap().unwrap_err().to_string(), {
            "the recordings have 0 blocks, which is not enough for `requirement 1 1`; name longer recordings, or set a smaller `block`"
        });
        loaded.open(&Default::default(), &mut open_recorded(4000, &[0, 1000])).unwrap();
        assert_eq!(loaded.pairs(), 200);
        let all: Vec<Step> = steps(&loaded).collect::<Result<_>>().unwrap();
        assert_eq!(all.len(), 203);
        assert!(all[..3].iter().all(|step| !step.is_pair() && step.place.is_none()));
        let drawn = &all[3..];
        let places: BTreeSet<usize> = drawn.iter().filter_map(|step| step.place).collect();
        let seeds: BTreeSet<u64> = drawn.iter().map(|step| step.scenario.seed).collect();
        assert_eq!((places.len(), seeds.len()), (200, 200));
        // The order says nothing of the place.
        let in_order = drawn.windows(2).filter(|pair| pair[0].place < pair[1].place).count();
        assert!((70..130).contains(&in_order), "{in_order}");
        let names: BTreeSet<String> = drawn.iter().map(|step| step.scenario.default_name()).collect();
        assert_eq!(names.into_iter().collect::<Vec<_>>(), ["fog@1", "fog@2", "nominal", "rain@3"]);
        let Stretch { start, end, .. } = Stretch::of(&drawn[0].scenario).unwrap();
        assert!(
            drawn[0].title().ends_with(&format!(", frames {start} to {}", end - 1)),
            "{}",
            drawn[0].title()
        );
        assert_eq!(all[7], step(&loaded, Series::Drawn, 4).unwrap());
    }
}
