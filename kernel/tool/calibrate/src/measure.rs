//! Measures where the levels of a scale lie for a perturbation.

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_model::level::{Level, MAX_INTENSITY};
use pdk_model::level_scale::{LevelScale, MeasuredScale, PUBLISHED_LEVELS};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scale_file::OfPerturbation;
use pdk_sdk::describe::{Description, Kind, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;

use crate::cost;
use crate::costs::Costs;
use crate::curve::Curve;

/// Between two published levels that are measured.
const STEP: f64 = 0.5;
/// How often a level is tried until its cost is close.
const MOST_TRIES: usize = 6;
/// A cost that differs by this factor is close enough to stop.
const CLOSE: f64 = 1.02;
/// A cost that differs by this factor is another one.
const FAR: f64 = 1.1;
/// Between two levels of a scale of which it is said where they lie.
const POINT_STEP: f64 = 0.25;
/// Frames a second, for what moves.
const RATE: f64 = 20.0;
/// Frames of a sequence between two frames that are measured, so that what comes and goes is seen at different moments.
const APART: u64 = 37;

/// Where the levels of a scale lie for perturbations with their parameters, each measured on all frames; or why one cannot be measured.
/// `done` is called after each.
pub fn all(
    registry: &Registry,
    perturbations: &[AppliedPerturbation],
    frames: &[FrameBuf],
    costs: &Costs,
    seed: u64,
    done: &(dyn Fn() + Sync),
) -> Vec<Result<OfPerturbation>> {
    pdk_parallel::map(perturbations, |applied| {
        let measured = of(registry, applied, frames, costs, seed);
        done();
        measured
    })
}

/// Where the levels of a scale lie for a perturbation.
///
/// # Errors
/// If it cannot be measured on single frames, or fails at a published level.
fn of(
    registry: &Registry,
    applied: &AppliedPerturbation,
    frames: &[FrameBuf],
    costs: &Costs,
    seed: u64,
) -> Result<OfPerturbation> {
    let description = &registry.catalog().get(Kind::Perturbation, &applied.name)?.description;
    let place = |error: Error| error.at(format_args!("perturbation `{}`", applied.name));
    if !description.acts_on.is_frame() || description.history > 0 {
        let sentence =
            "what it does cannot be seen in single frames, so that it has no place on a scale; leave it out";
        return Err(place(Error::new(sentence)));
    }
    let mut bench = Bench::new(registry, description, applied, frames, seed)?;
    let curve = bench.curve()?;
    let points = points(&curve, costs, &mut |published| bench.cost(published))?;
    Ok(OfPerturbation {
        name: applied.name.clone(),
        parameters: applied.parameters.clone(),
        version: description.version,
        points,
    })
}

/// A perturbation with the frames that it is tried on.
struct Bench<'a> {
    chain: Chain,
    applied: AppliedPerturbation,
    moving: bool,
    frames: &'a [FrameBuf],
    seed: u64,
    perturbed: FrameBuf,
}

impl<'a> Bench<'a> {
    fn new(
        registry: &Registry,
        description: &Description,
        applied: &AppliedPerturbation,
        frames: &'a [FrameBuf],
        seed: u64,
    ) -> Result<Self> {
        let (low, high) = PUBLISHED_LEVELS;
        // A scale that leads to every published level.
        let scale = MeasuredScale {
            name: "published levels".to_owned(),
            version: description.version,
            points: vec![[0.0, low], [MAX_INTENSITY, high]],
        };
        let applied =
            AppliedPerturbation { level_scale: Some(LevelScale::Measured(scale)), ..applied.clone() };
        let chain = Chain::new(registry, std::slice::from_ref(&applied), seed)?;
        let moving = description.temporal == Temporal::Dynamic;
        Ok(Self { chain, applied, moving, frames, seed, perturbed: FrameBuf::default() })
    }

    /// What it costs at a published level, on average over the frames.
    fn cost(&mut self, published: f64) -> Result<f64> {
        let (low, high) = PUBLISHED_LEVELS;
        self.applied.level = Level::Constant((published - low) / (high - low) * MAX_INTENSITY);
        let mut sum = 0.0;
        for (number, frame) in self.frames.iter().enumerate() {
            self.perturbed.resize(frame.width(), frame.height());
            self.chain
                .begin_again(std::slice::from_ref(&self.applied), self.seed.wrapping_add(number as u64));
            let index = if self.moving { APART * (number as u64 + 1) } else { 0 };
            let moment = Moment::new(index, index as f64 / RATE);
            let applied = self.chain.apply(frame.as_ref(), self.perturbed.as_mut(), &moment);
            applied.map_err(|error| error.at(format_args!("at the published level {published}")))?;
            sum += cost::of(frame.as_ref(), self.perturbed.as_ref());
        }
        Ok(sum / self.frames.len() as f64)
    }

    /// What it costs at all published levels at which it can be measured.
    fn curve(&mut self) -> Result<Curve> {
        let (low, high) = PUBLISHED_LEVELS;
        let mut measured = Vec::new();
        for step in 0..=((high - low) / STEP) as usize {
            let published = low + step as f64 * STEP;
            match self.cost(published) {
                Ok(cost) => measured.push([published, cost]),
                // Beyond the published levels it may not go on; what comes before them and fails is left out too.
                Err(_) if published > MAX_INTENSITY => break,
                Err(_) if published < 0.0 => measured.clear(),
                Err(error) => return Err(error),
            }
        }
        Ok(Curve::new(&measured))
    }
}

/// Where the levels of a scale lie, as far as the perturbation reaches: the longest run of levels at which it was tried and costs what they stand
/// for. Between two levels that were measured its cost may jump, as that of a number of things does that grows by one.
fn points(
    curve: &Curve,
    costs: &Costs,
    cost_at: &mut dyn FnMut(f64) -> Result<f64>,
) -> Result<Vec<[f64; 2]>> {
    let Some((lowest, highest)) = curve.range() else { return Ok(Vec::new()) };
    // A perturbation that does nothing at its weakest reaches level 0 from below.
    let first = if lowest > 0.0 { costs.level_of(lowest).max(0.0) } else { 0.0 };
    let last = costs.level_of(highest).min(MAX_INTENSITY);
    // In hundredths, so that people can name what is reached.
    let (first, last) = ((first * 100.0).ceil() / 100.0, (last * 100.0).floor() / 100.0);
    let between = (0..=(MAX_INTENSITY / POINT_STEP) as usize).map(|step| step as f64 * POINT_STEP);
    let mut levels: Vec<f64> = between.filter(|level| (first..=last).contains(level)).collect();
    levels.extend([first, last].into_iter().filter(|_| first <= last));
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let (mut longest, mut run) = (Vec::new(), Vec::<[f64; 2]>::new());
    for level in levels {
        match found(curve, costs.at(level), cost_at)? {
            // Noise may put a level a little before the one below it.
            Some(published) => {
                run.push([level, run.last().map_or(published, |before| published.max(before[1]))])
            }
            None => run.clear(),
        }
        if run.len() > longest.len() {
            longest.clone_from(&run);
        }
    }
    Ok(longest)
}

/// The published level at which a perturbation was tried and costs so much, closely enough; none if its cost jumps there.
fn found(curve: &Curve, cost: f64, cost_at: &mut dyn FnMut(f64) -> Result<f64>) -> Result<Option<f64>> {
    let Some([mut low, mut high]) = curve.around(cost) else { return Ok(None) };
    let mut nearest: Option<(f64, f64)> = None;
    for attempt in 0..MOST_TRIES {
        // Along a line, but now and then in the middle: where the cost is bent, one end of the line would stay for ever.
        let share = match attempt % 3 {
            2 => 0.5,
            _ if high[1] > low[1] => ((cost - low[1]) / (high[1] - low[1])).clamp(0.0, 1.0),
            _ => 0.0,
        };
        // In thousandths: more digits say nothing.
        let published = ((low[0] + (high[0] - low[0]) * share) * 1000.0).round() / 1000.0;
        let tried = cost_at(published)?;
        let error = libm::log(tried / cost).abs();
        if nearest.is_none_or(|(_, least)| error < least) {
            nearest = Some((published, error));
        }
        if error < libm::log(CLOSE) {
            break;
        }
        if tried < cost { low = [published, tried] } else { high = [published, tried] }
    }
    Ok(nearest.filter(|(_, error)| *error < libm::log(FAR)).map(|(published, _)| published))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: Costs = Costs([1.0, 2.0, 4.0, 8.0, 16.0]);

    fn points_of(curve: &Curve, mut cost: impl FnMut(f64) -> f64) -> Vec<[f64; 2]> {
        points(curve, &COSTS, &mut |published| Ok(cost(published))).unwrap()
    }

    #[test]
    fn points_end_where_the_perturbation_ends() {
        // It costs twice its level plus one and a half.
        let cost = |level: f64| 1.5 + 2.0 * level;
        let line: Vec<_> = (0..=5).map(|level| [f64::from(level), cost(f64::from(level))]).collect();
        let points = points_of(&Curve::new(&line), cost);
        let levels: Vec<f64> = points.iter().map(|point| point[0]).collect();
        assert_eq!((levels[0], levels[levels.len() - 1]), (0.59, 3.52));
        for [level, published] in points {
            assert!((cost(published) - COSTS.at(level)).abs() < 2e-3, "{level}");
        }
        let weak = Curve::new(&[[0.0, 0.1], [4.0, 0.9]]);
        assert_eq!(points_of(&weak, |_| 0.5), [] as [[f64; 2]; 0]);
    }

    #[test]
    fn levels_are_tried_until_they_cost_what_they_should() {
        // Between two levels that were measured the cost is far from a line.
        let cost = |level: f64| 1.0 + 15.0 * (level / 4.0) * (level / 4.0) * (level / 4.0);
        let points = points_of(&Curve::new(&[[0.0, 1.0], [2.0, cost(2.0)], [4.0, 16.0]]), cost);
        assert_eq!(points.len(), 17);
        for [level, published] in points {
            assert!(libm::log(cost(published) / COSTS.at(level)).abs() < 0.1, "{level}");
        }
        // It jumps from 1 to 6, as a number of things does that grows by one. Level 2.5 costs 5.7, which is close to 6.
        let jump = |level: f64| if level < 1.0 { 1.0 } else { 5.0 + level };
        let points = points_of(&Curve::new(&[[0.0, 1.0], [2.0, 7.0], [11.0, 16.0]]), jump);
        assert_eq!((points[0][0], points[points.len() - 1]), (2.5, [4.0, 11.0]));
    }
}
