//! The test kit: what every component has to hold, whatever it does. `pdk check` runs it on a finished plugin; an author
//! runs the same in unit tests:
//!
//! ```
//! # use pdk_sdk::prelude::*;
//! # struct Mirror;
//! # impl Component for Mirror {
//! #     fn description() -> Description { Description::perturbation("mirror", "Mirrors the frame") }
//! #     fn new(_: &Config) -> Result<Self> { Ok(Mirror) }
//! # }
//! # impl Perturbation for Mirror {
//! #     fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, _: &Context<'_>) -> Result<()> {
//! #         dst.copy_from(src);
//! #         Ok(())
//! #     }
//! # }
//! // In a test:
//! pdk_sdk::testing::perturbation::<Mirror>();
//! ```

use pdk_model::component::ComponentSpec;
use pdk_ops::{Frame, FrameBuf, FrameMut};
use pdk_seed::Key;
use serde_json::{Map, Value};

use crate::component::Component;
use crate::config::{Config, frame_values};
use crate::dataset::{Dataset, Entry};
use crate::describe::{Description, LEVELS};
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, Result};
use crate::history::Recollection;
use crate::mask::Mask;
use crate::perturbation::{Context, Perturbation};
use crate::predictor::{Output, Predictor};
use crate::saliency::{HeatmapMut, MapContext, Saliency};
use crate::search::{Evaluated, Problem, Range, Search, Space, Variable};
use crate::simulator::{Scenario, Simulator};
use crate::timeline::{Timeline, Told};

/// Makes an instance from parameters.
pub type Make<'a, T> = &'a mut dyn FnMut(&Config) -> Result<Box<T>>;

/// Frame sizes that find most mistakes: a single pixel, odd sizes, a usual one.
const SIZES: [(usize, usize); 4] = [(1, 1), (3, 2), (33, 17), (160, 120)];

/// Runs [`check_perturbation`] on a type, in a test.
///
/// # Panics
/// If a check fails, with its sentence.
pub fn perturbation<T: Component + Perturbation + 'static>() {
    let description = T::description();
    let mut make = |config: &Config| Ok(Box::new(T::new(config)?) as Box<dyn Perturbation>);
    for_each_config(&description, |config| check_perturbation(&description, config, &mut make));
}

/// One function for each other kind.
macro_rules! on_types {
    ($($function:ident: $bound:ident by $check:ident;)*) => {
        $(
            #[doc = concat!("Runs [`", stringify!($check), "`] on a type, in a test.")]
            ///
            /// # Panics
            /// If a check fails, with its sentence.
            pub fn $function<T: Component + $bound + 'static>() {
                let mut make = |config: &Config| Ok(Box::new(T::new(config)?) as Box<dyn $bound>);
                for_each_config(&T::description(), |config| $check(config, &mut make));
            }
        )*
    };
}

/// Runs [`check_simulator`] on a type, in a test.
///
/// # Panics
/// If a check fails, with its sentence.
pub fn simulator<T: Component + Simulator + 'static>() {
    let description = T::description();
    let mut make = |config: &Config| Ok(Box::new(T::new(config)?) as Box<dyn Simulator>);
    for_each_config(&description, |config| check_simulator(&description, config, &mut make));
}

on_types! {
    driver: Driver by check_driver;
    saliency: Saliency by check_saliency;
    mask: Mask by check_mask;
    predictor: Predictor by check_predictor;
    search: Search by check_search;
    dataset: Dataset by check_dataset;
}

fn for_each_config(description: &Description, mut check: impl FnMut(&Config) -> Result<()>) {
    for config in configs(description) {
        if let Err(error) = config.and_then(|config| check(&config)) {
            panic!("{}: {error}", description.name);
        }
    }
}

/// The parameter values that a component is checked with: its examples, or its defaults if it has none.
pub fn configs(description: &Description) -> Vec<Result<Config>> {
    let defaults = Map::new();
    let examples: Vec<&Map<String, Value>> = match description.examples.is_empty() {
        true => vec![&defaults],
        false => description.examples.iter().collect(),
    };
    examples.into_iter().map(|example| Config::check(description, example)).collect()
}

/// A frame with some structure: a gradient, an edge and texture.
pub fn sample_frame(width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    let mut view = frame.as_mut();
    for y in 0..height {
        for x in 0..width {
            let edge = if x > width / 2 { 60 } else { 0 };
            let texture = ((x * 7 + y * 13) % 31) as u8;
            let shade = (y * 150 / height.max(1)) as u8;
            view.set_pixel(x, y, [shade + edge + texture / 2, shade / 2 + texture, 200 - shade + texture]);
        }
    }
    frame
}

fn ensure(holds: bool, sentence: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::new(sentence())) }
}

/// Checks that a perturbation works at every level and size, writes every pixel, and that its output depends on the
/// source, the parameters and the key alone: not on the stride, on what `dst` held, or on earlier frames.
///
/// # Errors
/// The first check that fails.
pub fn check_perturbation(
    description: &Description,
    config: &Config,
    make: Make<'_, dyn Perturbation>,
) -> Result<()> {
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let key = Key([9; 32]);
    let mut values = Vec::new();
    let mut veteran = make(config)?;
    // Far enough in its sequence to have as many frames before it as it asks for.
    let (frame_index, time) = (5 + u64::from(description.history), 0.25);
    for (width, height) in SIZES {
        let source = sample_frame(width, height);
        for level in 0..=2 * (LEVELS - 1) {
            let intensity = level as f64 / 2.0;
            let place = format!("at {width}x{height} and level {intensity}");
            frame_values(description, config, intensity, &mut values);
            let mut kept = earlier_frames(description.history, frame_index, width, height);
            let mut kept_for_other = kept.clone();
            let cx = Context::new(intensity, frame_index, time, &key)
                .with_values(&names, &values)
                .with_history(kept.before(source.as_ref(), frame_index));
            let other = Context::new(intensity, frame_index + 1, 0.3, &key)
                .with_values(&names, &values)
                .with_history(kept_for_other.before(source.as_ref(), frame_index + 1));

            let mut alone = FrameBuf::new(width, height);
            make(config)?.apply(source.as_ref(), alone.as_mut(), &cx).map_err(|e| e.at(&place))?;

            let mut dirty = FrameBuf::new(width, height);
            dirty.as_mut().rows_mut().for_each(|row| row.fill(0xa5));
            veteran.apply(source.as_ref(), dirty.as_mut(), &other).map_err(|e| e.at(&place))?;
            dirty.as_mut().rows_mut().for_each(|row| row.fill(0x5a));
            veteran.apply(source.as_ref(), dirty.as_mut(), &cx).map_err(|e| e.at(&place))?;
            ensure(alone == dirty, || {
                format!(
                    "{place} a frame comes out differently alone and after others; the result may depend on the source, \
                     the parameters and the key only, and every pixel of dst has to be written"
                )
            })?;

            let (strided_source, stride) = with_gaps(source.as_ref());
            let strided_source =
                Frame::with_stride(&strided_source, width, height, stride).map_err(Error::new)?;
            let mut target = vec![0x77; stride * height];
            let strided_target =
                FrameMut::with_stride(&mut target, width, height, stride).map_err(Error::new)?;
            veteran.apply(strided_source, strided_target, &cx).map_err(|e| e.at(&place))?;
            let strided = Frame::with_stride(&target, width, height, stride).map_err(Error::new)?;
            ensure(strided == alone.as_ref(), || {
                format!("{place} a frame comes out differently with a stride")
            })?;
            let gaps = target.chunks(stride).flat_map(|row| &row[width * 3..]);
            ensure(gaps.into_iter().all(|&byte| byte == 0x77), || {
                format!("{place} bytes between the rows of dst are written")
            })?;
        }
    }
    Ok(())
}

/// The frames before one, each of another brightness.
fn earlier_frames(history: u32, frame_index: u64, width: usize, height: usize) -> Recollection {
    let mut kept = Recollection::of(history as usize);
    for index in frame_index - u64::from(history)..frame_index {
        let mut frame = sample_frame(width, height);
        let darker = (index * 37 % 101) as u8;
        frame.as_mut().rows_mut().flatten().for_each(|value| *value = value.saturating_sub(darker));
        kept.keep(frame.as_ref(), index, index as f64 / 20.0);
    }
    kept
}

/// The same pixels with gaps between the rows.
fn with_gaps(frame: Frame<'_>) -> (Vec<u8>, usize) {
    let stride = frame.width() * 3 + 7;
    let mut bytes = vec![0xee; stride * frame.height()];
    for (y, row) in frame.rows().enumerate() {
        bytes[y * stride..][..row.len()].copy_from_slice(row);
    }
    (bytes, stride)
}

/// Checks that a driver gives finite controls, and the same ones after a reset.
///
/// # Errors
/// The first check that fails.
pub fn check_driver(config: &Config, make: Make<'_, dyn Driver>) -> Result<()> {
    let mut driver = make(config)?;
    let frame = sample_frame(160, 120);
    let mut runs = [Vec::new(), Vec::new()];
    for run in &mut runs {
        driver.reset()?;
        for frame_index in 0..3 {
            let cx = DriveContext { frame_index, time: frame_index as f64 / 30.0, speed: 8.0 };
            let control = driver.drive(frame.as_ref(), &cx)?;
            control.checked()?;
            run.push(control);
        }
    }
    ensure(runs[0] == runs[1], || "after a reset it decides differently on the same frames".to_owned())
}

/// Checks that a simulator renders, moves, returns after each step the state that the next frame has, and does the same again
/// after a reset; the last not if it has its own clock. One that is a program of its own has to be there.
///
/// # Errors
/// The first check that fails.
pub fn check_simulator(
    description: &Description,
    config: &Config,
    make: Make<'_, dyn Simulator>,
) -> Result<()> {
    let mut simulator = make(config)?;
    let camera = simulator.camera();
    let component = ComponentSpec::new;
    let scenario =
        Scenario { seed: 1, duration: 10.0, ..Scenario::new(component("simulator"), component("driver")) };
    let mut runs = [Vec::new(), Vec::new()];
    for run in &mut runs {
        let mut expected = simulator.reset(&scenario, 0)?;
        let mut timeline = Timeline::new(description.clock, camera.rate);
        for step in 0..5 {
            let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
            let state = simulator.frame(frame.as_mut())?;
            state.check()?;
            ensure(state == expected, || match step {
                0 => "the state of its first frame is not the one that reset returned".to_owned(),
                _ => "the state of a frame is not the one that act returned before it".to_owned(),
            })?;
            timeline.go_on(state.time, if step == 0 { Told::Frame } else { Told::Act })?;
            run.push((frame, state));
            expected = simulator.act(Control { steering: 0.1, throttle: 0.5 })?;
        }
    }
    let [first, second] = &runs;
    ensure(first[4].1.time > first[0].1.time, || "its time does not advance".to_owned())?;
    ensure(first == second || !description.clock.is_stepped(), || {
        "the same scenario comes out differently the second time, which only a simulator with its own clock may do".to_owned()
    })
}

/// Checks that a saliency map has values from 0 to 1 and comes out the same twice.
///
/// # Errors
/// The first check that fails.
pub fn check_saliency(config: &Config, make: Make<'_, dyn Saliency>) -> Result<()> {
    let mut method = make(config)?;
    let frame = sample_frame(160, 120);
    let [width, height] = method.map_size(160, 120)?;
    ensure((1..=160).contains(&width) && (1..=120).contains(&height), || {
        format!(
            "its map of a frame of 160x120 has {width}x{height} values; it has to have one, and no more than the frame has pixels"
        )
    })?;
    let key = Key([9; 32]);
    let mut maps = [vec![f32::NAN; width * height], vec![f32::NAN; width * height]];
    for map in &mut maps {
        let cx = MapContext::new(5, 0.25, &key);
        method.map(frame.as_ref(), &cx, HeatmapMut::new(map, width, height)?)?;
        ensure(map.iter().all(|value| (0.0..=1.0).contains(value)), || {
            "its map has values that are not from 0 to 1, or that were not written".to_owned()
        })?;
    }
    ensure(maps[0] == maps[1], || "the same frame gives two maps".to_owned())
}

/// Checks that a mask has values from 0 to 1 for frames of several sizes and comes out the same twice.
///
/// # Errors
/// The first check that fails.
pub fn check_mask(config: &Config, make: Make<'_, dyn Mask>) -> Result<()> {
    let mut mask = make(config)?;
    let key = Key([9; 32]);
    for (width, height) in SIZES {
        let frame = sample_frame(width, height);
        let mut maps = [vec![f32::NAN; width * height], vec![f32::NAN; width * height]];
        for map in &mut maps {
            mask.weights(
                frame.as_ref(),
                &MapContext::new(5, 0.25, &key),
                HeatmapMut::new(map, width, height)?,
            )?;
            ensure(map.iter().all(|value| (0.0..=1.0).contains(value)), || {
                format!(
                    "on a frame of {width}x{height} it has values that are not from 0 to 1, or that were not written"
                )
            })?;
        }
        ensure(maps[0] == maps[1], || "the same frame gives two masks".to_owned())?;
    }
    Ok(())
}

/// Checks that a predictor gives the same outputs for the same frame after a reset, and the same names and shapes for another one.
///
/// # Errors
/// The first check that fails.
pub fn check_predictor(config: &Config, make: Make<'_, dyn Predictor>) -> Result<()> {
    let mut predictor = make(config)?;
    let mut predict = |width: usize, height: usize| {
        predictor.reset()?;
        predictor.predict(sample_frame(width, height).as_ref(), &DriveContext::default())
    };
    let (first, second) = (predict(160, 120)?, predict(160, 120)?);
    let bits = |outputs: &[Output]| -> Vec<u32> {
        outputs.iter().flat_map(|output| output.values.iter().map(|value| value.to_bits())).collect()
    };
    ensure(!first.is_empty(), || "it gives no outputs".to_owned())?;
    ensure(bits(&first) == bits(&second), || "the same frame gives other values after a reset".to_owned())?;
    let names = |outputs: &[Output]| outputs.iter().map(|output| output.name.clone()).collect::<Vec<_>>();
    ensure(names(&first) == names(&predict(320, 240)?), || {
        "another frame gives outputs of other names".to_owned()
    })
}

/// Checks that a search strategy proposes no more than it is asked for, that all it proposes lies in the space, and that what it
/// proposes does not depend on how many candidates it is asked for and how many results it gets at once.
///
/// # Errors
/// The first check that fails.
pub fn check_search(config: &Config, make: Make<'_, dyn Search>) -> Result<()> {
    let problem = search_problem();
    let key = Key([7; 32]);
    let mut ways = Vec::new();
    for at_once in [1, 7, 64] {
        let mut strategy = make(config)?;
        strategy.start(&problem, &key)?;
        ways.push(searched(strategy.as_mut(), &problem, at_once)?);
    }
    ensure(!ways[0].is_empty(), || "asked for a candidate it proposes none".to_owned())?;
    for way in &ways[1..] {
        // What was asked for at last may be more in one way than in another.
        let both = ways[0].len().min(way.len());
        let differs = (0..both).find(|&i| ways[0][i] != way[i]);
        ensure(differs.is_none(), || {
            format!(
                "candidate {} depends on how many candidates are asked for and told at once",
                differs.unwrap_or_default()
            )
        })?;
    }
    Ok(())
}

/// A small problem with a range of each kind.
fn search_problem() -> Problem {
    let variable = |name: &str, range| Variable { name: name.to_owned(), range };
    let values = |names: [&str; 3]| names.map(Value::from).to_vec();
    Problem {
        space: Space {
            variables: vec![
                variable("x", Range::Real { min: -1.0, max: 2.0 }),
                variable("n", Range::Integer { min: 0, max: 20 }),
                variable("rank", Range::Ordinal { values: values(["low", "middle", "high"]) }),
                variable("kind", Range::Choice { values: values(["a", "b", "c"]) }),
            ],
            constraints: Vec::new(),
        },
        objectives: vec!["first".to_owned(), "second".to_owned()],
        evaluations: Some(200),
    }
}

/// What a strategy proposes for some 200 candidates, where this many are asked for and told at once.
fn searched(strategy: &mut dyn Search, problem: &Problem, at_once: usize) -> Result<Vec<Map<String, Value>>> {
    let mut proposed = Vec::new();
    while proposed.len() < 200 {
        let candidates = strategy.ask(at_once)?;
        ensure(candidates.len() <= at_once, || {
            format!("asked for {at_once} candidates it proposes {}", candidates.len())
        })?;
        if candidates.is_empty() {
            break;
        }
        let mut results = Vec::new();
        for candidate in candidates {
            let number = proposed.len() as u64;
            ensure(candidate.id == number, || {
                format!("candidate {number} has the number {}; they count from 0", candidate.id)
            })?;
            let x = problem
                .space
                .positions(&candidate.values)
                .map_err(|error| error.at(format_args!("candidate {number}")))?;
            let failed = number % 17 == 16;
            results.push(Evaluated {
                id: number,
                objectives: if failed { Vec::new() } else { vec![x[0] * x[0] + x[2], x[1] - x[0] * x[3]] },
                violations: Vec::new(),
                critical: !failed && x[0] > 1.0 && x[1] > 10.0,
                failure: failed.then(|| "it failed".to_owned()),
            });
            proposed.push(candidate.values);
        }
        strategy.tell(&results)?;
    }
    Ok(proposed)
}

/// Checks that a dataset's frames can be read in any order.
///
/// # Errors
/// The first check that fails.
pub fn check_dataset(config: &Config, make: Make<'_, dyn Dataset>) -> Result<()> {
    let mut dataset = make(config)?;
    ensure(!dataset.is_empty(), || "it has no frames".to_owned())?;
    let last = dataset.len() - 1;
    // A panic in `name` shows in the next call.
    ensure(!dataset.name(last).is_empty(), || "its last frame has an empty name".to_owned())?;
    let before = dataset.read(last)?;
    dataset.read(0)?;
    ensure(before.is_plausible(), || {
        "its last frame has a steering, throttle, speed or time that is not finite".to_owned()
    })?;
    let again = dataset.read(last)?;
    // By their bits, because what was not recorded is not a number, which is unequal to itself.
    let bits = |entry: &Entry| [entry.steering, entry.throttle, entry.speed, entry.time].map(f64::to_bits);
    ensure(before.frame == again.frame && bits(&before) == bits(&again), || {
        "the same frame is read differently the second time".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::{Camera, State};

    /// Breaks one rule, as told.
    struct Rogue(&'static str, u8);

    impl Perturbation for Rogue {
        fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, _: &Context<'_>) -> Result<()> {
            let width = src.width();
            for y in 0..src.height() {
                match self.0 {
                    "leaves a pixel" => {
                        dst.row_mut(y)[3.min(width * 3)..].copy_from_slice(&src.row(y)[3.min(width * 3)..])
                    }
                    _ => dst.row_mut(y).copy_from_slice(src.row(y)),
                }
            }
            match self.0 {
                "remembers" => {
                    self.1 += 1;
                    dst.row_mut(0)[0] = self.1;
                }
                "ignores the stride" => {
                    let len = (width * 3 * src.height()).min(dst.data().len());
                    dst.data_mut()[..len].fill(1);
                }
                _ => {}
            }
            Ok(())
        }
    }

    fn check(rule: &'static str) -> Result<()> {
        let description = Description::perturbation("rogue", "Breaks a rule");
        let mut make = |_: &Config| Ok(Box::new(Rogue(rule, 0)) as Box<dyn Perturbation>);
        check_perturbation(&description, &Config::default(), &mut make)
    }

    #[test]
    fn every_broken_rule_is_found() {
        assert!(check("keeps them all").is_ok());
        assert!(check("remembers").unwrap_err().to_string().contains("alone and after others"));
        assert!(check("leaves a pixel").unwrap_err().to_string().contains("has to be written"));
        assert!(check("ignores the stride").unwrap_err().to_string().contains("stride"));
    }
    /// A vehicle that moves a metre a step; breaks one rule, as told.
    struct Road(&'static str, State);

    impl Simulator for Road {
        fn camera(&self) -> Camera {
            Camera { width: 4, height: 3, rate: 20.0 }
        }

        fn reset(&mut self, _: &Scenario, _: u32) -> Result<State> {
            self.1 = State::default();
            Ok(if self.0 == "starts elsewhere" { State { speed: 1.0, ..self.1 } } else { self.1 })
        }

        fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
            into.rows_mut().for_each(|row| row.fill(7));
            Ok(if self.0 == "loses itself" { State { heading: f64::NAN, ..self.1 } } else { self.1 })
        }

        fn act(&mut self, _: Control) -> Result<State> {
            let before = self.1;
            self.1.time += if self.0 == "stands still" { 0.0 } else { 0.05 };
            Ok(if self.0 == "lags" { before } else { self.1 })
        }
    }

    #[test]
    fn every_broken_rule_of_a_simulator_is_found() {
        let check = |rule| {
            let mut make = |_: &Config| Ok(Box::new(Road(rule, State::default())) as Box<dyn Simulator>);
            let description = Description::simulator("road", "A road");
            check_simulator(&description, &Config::default(), &mut make).map_err(|error| error.to_string())
        };
        assert_eq!(check("keeps them all"), Ok(()));
        assert!(check("lags").unwrap_err().contains("not the one that act returned"));
        assert!(check("starts elsewhere").unwrap_err().contains("not the one that reset returned"));
        assert!(check("loses itself").unwrap_err().contains("its heading is NaN rad, but has to be from"));
        assert!(check("stands still").unwrap_err().contains("its time goes on from 0.0 to 0.0 s"));
    }
}
