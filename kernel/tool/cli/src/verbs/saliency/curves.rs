//! How faithful maps are: what the driver does when what they mark is taken away, and when nothing else is left.
//!
//! Deletion: the pixels that matter most are replaced by the frame's mean colour, more and more of them; the sooner the
//! steering moves away, the more faithful the map. Insertion: from the mean colour alone, the pixels that matter most come back
//! first; the sooner the steering returns, the more faithful. Both areas are the mean distance from the steering on the whole
//! frame, so that more is better for deletion and less for insertion (Petsiuk et al., 2018, for numbers instead of classes).
//!
//! Sensitivity and infidelity: how well the map says what patches of the frame matter ([`super::patches`]).
//!
//! Coarse maps have it easier than fine ones, whatever they mark, since large spots hide more. So each map is compared with
//! itself in other places: mirrored and moved around the frame at random.

use std::collections::BTreeMap;

use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{DriveContext, Driver, Frame, FrameBuf, Random};
use pdk_sdk::seed;
use pdk_statistics::CONFIDENCE;
use pdk_statistics::estimate::Estimate;
use pdk_statistics::mean;
use pdk_supervise::calls::{self, Function};
use pdk_terminal::table::table;
use pdk_terminal::text::wrapped;
use serde_json::{Value, json};

use super::patches::{Agreement, Patches};
use super::shown::Shown;

/// Shares of the frame that are taken away or put back, from one step to the whole.
const STEPS: usize = 20;
/// How often each map is moved to another place.
const MOVES: usize = 3;

/// What was measured on one frame.
#[derive(Debug, Clone, Copy, Default)]
struct Areas {
    deletion: f64,
    insertion: f64,
    patches: Agreement,
}

/// What was measured on all frames, by method.
pub struct Curves {
    driver: Box<dyn Driver>,
    place: String,
    speed: f64,
    seed: u64,
    measured: Vec<Vec<Measured>>,
}

/// A frame with what is the same for all of its maps.
pub struct Seen<'a> {
    shown: &'a Shown,
    speed: f64,
    index: u64,
    /// The frame's mean colour, which takes the place of what is taken away.
    color: [u8; 3],
    /// How the driver steers at the frame.
    whole: f64,
    /// By how much the steering changes if the mean colour is all that is left.
    without: f64,
    patches: Patches,
}

/// What was measured of a method's map of one frame.
struct Measured {
    own: Areas,
    /// The mean over the moved maps.
    moved: Areas,
    /// The number of the road on which the frame was recorded, if that is known.
    road: Option<usize>,
}

impl Curves {
    /// Makes the driver.
    ///
    /// # Errors
    /// If it refuses its parameters.
    pub fn new(
        registry: &Registry,
        driver: &ComponentSpec,
        speed: f64,
        seed: u64,
        methods: usize,
    ) -> Result<Self> {
        let (instance, _) = registry.driver(&driver.name, &driver.parameters)?;
        Ok(Self {
            driver: instance,
            place: format!("driver `{}`", driver.name),
            speed,
            seed,
            measured: (0..methods).map(|_| Vec::new()).collect(),
        })
    }

    /// Measures what is the same for all maps of a frame.
    ///
    /// # Errors
    /// If the driver fails.
    pub fn see<'a>(&mut self, shown: &'a Shown, index: u64) -> Result<Seen<'a>> {
        let (frame, speed) = (shown.frame.as_ref(), shown.speed.unwrap_or(self.speed));
        let color = mean_color(frame);
        let whole = self.steering(frame, speed)?;
        let mut random = seed::key(self.seed, "patches", 0).frame(index);
        let mut change = |frame: Frame<'_>| Ok((self.steering(frame, speed)? - whole).abs());
        let without = change(plain(frame, color).as_ref())?;
        let patches = Patches::measure(frame, color, &mut random, change)?;
        Ok(Seen { shown, speed, index, color, whole, without, patches })
    }

    /// Measures a method's map of a frame.
    ///
    /// # Errors
    /// If the driver fails.
    pub fn add(&mut self, method: usize, seen: &Seen<'_>, map: &[f32]) -> Result<()> {
        // The same moves for every method, so that methods are compared under the same luck.
        let mut random = seed::key(self.seed, "moved maps", 0).frame(seen.index);
        let own = self.areas(seen, map)?;
        let mut moved = Areas::default();
        for _ in 0..MOVES {
            moved.add(self.areas(seen, &relocate(map, seen.shown.frame.width(), &mut random))?);
        }
        self.measured[method].push(Measured { own, moved, road: seen.shown.road });
        Ok(())
    }

    /// How the driver steers at a frame. One that remembers has seen nothing before it, as when its map was made.
    fn steering(&mut self, frame: Frame<'_>, speed: f64) -> Result<f64> {
        let cx = DriveContext { speed, ..DriveContext::default() };
        let driver = &mut self.driver;
        let control = calls::call(&self.place, Function::Reset, || driver.reset())
            .and_then(|()| calls::call(&self.place, Function::Drive, || driver.drive(frame, &cx)));
        Ok(control.map_err(|error| error.at(&self.place))?.steering)
    }

    fn areas(&mut self, seen: &Seen<'_>, map: &[f32]) -> Result<Areas> {
        let Seen { shown, speed, color, whole, without, ref patches, .. } = *seen;
        let frame = shown.frame.as_ref();
        let mut order: Vec<usize> = (0..map.len()).collect();
        order.sort_by(|&a, &b| map[b].total_cmp(&map[a]));
        let (mut taken, mut left) = (shown.frame.clone(), plain(frame, color));
        // The insertion begins where the deletion ends: with nothing of the frame.
        let mut areas =
            Areas { deletion: 0.0, insertion: without, patches: patches.agreement(map, frame.width()) };
        for step in 1..STEPS {
            for &at in &order[order.len() * (step - 1) / STEPS..order.len() * step / STEPS] {
                let (x, y) = (at % frame.width(), at / frame.width());
                taken.as_mut().set_pixel(x, y, color);
                left.as_mut().set_pixel(x, y, frame.pixel(x, y));
            }
            areas.deletion += (self.steering(taken.as_ref(), speed)? - whole).abs();
            areas.insertion += (self.steering(left.as_ref(), speed)? - whole).abs();
        }
        areas.deletion += without;
        areas.deletion /= STEPS as f64;
        areas.insertion /= STEPS as f64;
        Ok(areas)
    }

    /// What was found about a method.
    fn found(&self, method: usize) -> Found {
        let frames = &self.measured[method];
        let over = |value: &dyn Fn(usize, &Measured) -> f64| {
            let values = by_road(frames, value);
            // Without frames there is nothing to report.
            let estimate = mean::over_roads(&values, (f64::NEG_INFINITY, f64::INFINITY), CONFIDENCE);
            estimate.unwrap_or(Estimate { value: f64::NAN, low: f64::NAN, high: f64::NAN })
        };
        let first = &self.measured[0];
        Found {
            deletion: over(&|_, both| both.own.deletion).value,
            insertion: over(&|_, both| both.own.insertion).value,
            deletion_gain: over(&|_, both| both.own.deletion - both.moved.deletion),
            insertion_gain: over(&|_, both| both.moved.insertion - both.own.insertion),
            sensitivity: over(&|_, both| both.own.patches.sensitivity).value,
            infidelity: over(&|_, both| both.own.patches.infidelity).value,
            sensitivity_gain: over(&|_, both| both.own.patches.sensitivity - both.moved.patches.sensitivity),
            infidelity_gain: over(&|_, both| both.moved.patches.infidelity - both.own.patches.infidelity),
            against_first: over(&|at, both| both.own.faithfulness() - first[at].own.faithfulness()),
        }
    }

    /// How many roads were measured, or frames if their roads are not known. One alone says nothing about others, so there are intervals
    /// from two on.
    fn independent(&self) -> usize {
        self.measured.first().map_or(0, |frames| by_road(frames, &|_, _| 0.0).len())
    }

    fn said(&self, estimate: &Estimate) -> Value {
        match self.independent() {
            0 | 1 => json!({ "value": estimate.value, "low": null, "high": null }),
            _ => json!(estimate),
        }
    }

    /// The results as JSON.
    pub fn to_json(&self, labels: &[&str]) -> Value {
        let methods = labels.iter().enumerate().map(|(method, label)| {
            let found = self.found(method);
            json!({
                "method": label,
                "frames": self.measured[method].len(),
                "independent": self.independent(),
                "deletion": { "area": found.deletion, "better_than_moved": self.said(&found.deletion_gain) },
                "insertion": { "area": found.insertion, "better_than_moved": self.said(&found.insertion_gain) },
                "sensitivity": { "correlation": found.sensitivity, "better_than_moved": self.said(&found.sensitivity_gain) },
                "infidelity": { "share": found.infidelity, "better_than_moved": self.said(&found.infidelity_gain) },
                "deletion_less_insertion_against_first": self.said(&found.against_first),
            })
        });
        methods.collect()
    }

    /// The results as a table.
    pub fn table(&self, labels: &[&str]) -> String {
        let against = format!("against {}", labels.first().copied().unwrap_or_default());
        let mut rows = table([
            "method",
            "deletion",
            "better than moved by",
            "insertion",
            "better than moved by",
            against.as_str(),
        ]);
        let mut patches =
            table(["method", "sensitivity-n", "better than moved by", "infidelity", "better than moved by"]);
        let (frames, independent) = (self.measured.first().map_or(0, Vec::len), self.independent());
        let shown = |Estimate { value, low, high }| match independent {
            0 | 1 => format!("{value:+.4}"),
            _ => format!("{value:+.4} [{low:+.4}, {high:+.4}]"),
        };
        for (method, label) in labels.iter().enumerate() {
            let found = self.found(method);
            rows.add_row([
                (*label).to_owned(),
                format!("{:.4}", found.deletion),
                shown(found.deletion_gain),
                format!("{:.4}", found.insertion),
                shown(found.insertion_gain),
                if method == 0 { String::new() } else { shown(found.against_first) },
            ]);
            patches.add_row([
                (*label).to_owned(),
                format!("{:.4}", found.sensitivity),
                shown(found.sensitivity_gain),
                format!("{:.4}", found.infidelity),
                shown(found.infidelity_gain),
            ]);
        }
        let over = match frames {
            0 | 1 => "change of the steering on one frame".to_owned(),
            _ if independent < frames => {
                format!("mean change of the steering over {frames} frames of {independent} roads")
            }
            _ => format!("mean change of the steering over {frames} frames"),
        };
        let intervals = match independent {
            0 | 1 if frames > 1 => "; for intervals it takes more roads",
            0 | 1 => "; for intervals it takes more frames",
            _ if independent < frames => "; in brackets 95 % intervals, paired by road",
            _ => "; in brackets 95 % intervals, paired by frame",
        };
        let curves = format!(
            "{over}: when what matters most is taken away first, more is better; when it comes back first, less is better; the last column has \
             the difference of both, less that of the first method{intervals}"
        );
        let agreement = "sensitivity-n: the correlation of the map with the change of the steering when patches are taken away, more is better; \
                         infidelity: the share of that change which the map leaves unexplained, less is better";
        format!("{rows}\n{}\n\n{patches}\n{}", wrapped("", &curves), wrapped("", agreement))
    }
}

/// What was found about a method: mean areas, and differences with their intervals.
struct Found {
    deletion: f64,
    insertion: f64,
    deletion_gain: Estimate,
    insertion_gain: Estimate,
    sensitivity: f64,
    infidelity: f64,
    sensitivity_gain: Estimate,
    infidelity_gain: Estimate,
    against_first: Estimate,
}

impl Areas {
    /// Adds the areas of one of the moved maps to their mean.
    fn add(&mut self, one: Self) {
        let share = 1.0 / MOVES as f64;
        self.deletion += share * one.deletion;
        self.insertion += share * one.insertion;
        self.patches.sensitivity += share * one.patches.sensitivity;
        self.patches.infidelity += share * one.patches.infidelity;
    }

    /// One number for both: more is better.
    fn faithfulness(&self) -> f64 {
        self.deletion - self.insertion
    }
}

/// A value of each road: the mean over its frames, which resemble each other. A frame whose road is not known counts for itself.
fn by_road(frames: &[Measured], value: &dyn Fn(usize, &Measured) -> f64) -> Vec<f64> {
    let mut roads: BTreeMap<(Option<usize>, usize), Vec<f64>> = BTreeMap::new();
    for (at, both) in frames.iter().enumerate() {
        roads.entry((both.road, if both.road.is_some() { 0 } else { at })).or_default().push(value(at, both));
    }
    roads.values().map(|values| values.iter().sum::<f64>() / values.len() as f64).collect()
}

/// The mean colour of a frame.
fn mean_color(frame: Frame<'_>) -> [u8; 3] {
    let mut sums = [0u64; 3];
    for pixel in frame.rows().flat_map(|row| row.chunks_exact(3)) {
        sums.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += u64::from(value));
    }
    let count = (frame.width() * frame.height()) as u64;
    sums.map(|sum| ((sum + count / 2) / count) as u8)
}

/// A frame of one colour, as large as another one.
fn plain(frame: Frame<'_>, color: [u8; 3]) -> FrameBuf {
    let mut plain = FrameBuf::new(frame.width(), frame.height());
    plain
        .as_mut()
        .rows_mut()
        .for_each(|row| row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&color)));
    plain
}

/// The map mirrored or not, and moved around the frame, whose edges are joined.
fn relocate(map: &[f32], width: usize, random: &mut Random) -> Vec<f32> {
    let height = map.len() / width;
    let (right, down) = (random.below(width as u32) as usize, random.below(height as u32) as usize);
    let (mirrored, flipped) = (random.below(2) == 1, random.below(2) == 1);
    let place = |at: usize, by: usize, length: usize, turned: bool| {
        let at = (at + by) % length;
        if turned { length - 1 - at } else { at }
    };
    (0..map.len())
        .map(|at| {
            map[place(at / width, down, height, flipped) * width + place(at % width, right, width, mirrored)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use pdk_sdk::prelude::Control;

    /// Steers by the brightness of the upper left quarter.
    struct Corner;

    impl Driver for Corner {
        fn drive(&mut self, frame: Frame<'_>, _: &DriveContext) -> Result<Control> {
            let sum: u64 = (0..8)
                .flat_map(|y| (0..8).map(move |x| (x, y)))
                .map(|(x, y)| u64::from(frame.pixel(x, y)[0]))
                .sum();
            Ok(Control { steering: sum as f64 / 64.0 / 255.0, throttle: 0.0 })
        }
    }

    #[test]
    fn a_map_of_what_matters_is_better_than_the_same_map_elsewhere_and_its_opposite_is_worse() {
        let measured = vec![Vec::new(), Vec::new()];
        let mut curves =
            Curves { driver: Box::new(Corner), place: "corner".into(), speed: 0.0, seed: 1, measured };
        for index in 0..12 {
            let mut frame = FrameBuf::new(16, 16);
            for y in 0..16 {
                for x in 0..16 {
                    let bright = if x < 8 && y < 8 { 200 } else { 20 + index * 3 };
                    frame.as_mut().set_pixel(x, y, [bright; 3]);
                }
            }
            let map: Vec<f32> =
                (0..256).map(|at| if at % 16 < 8 && at / 16 < 8 { 1.0 } else { 0.0 }).collect();
            let opposite: Vec<f32> = map.iter().map(|value| 1.0 - value).collect();
            let shown = Shown { name: String::new(), frame, speed: None, road: None };
            let seen = curves.see(&shown, u64::from(index)).unwrap();
            curves.add(0, &seen, &map).unwrap();
            curves.add(1, &seen, &opposite).unwrap();
        }
        let right = curves.found(0);
        assert!(right.deletion > 0.0 && right.insertion > 0.0);
        for gain in [right.deletion_gain, right.insertion_gain] {
            assert!(gain.low > 0.0 && gain.low <= gain.value && gain.value <= gain.high, "{gain:?}");
        }
        let wrong = curves.found(1);
        for gain in [wrong.deletion_gain, wrong.insertion_gain, wrong.against_first] {
            assert!(gain.value < 0.0 && gain.high < 0.0, "{gain:?}");
        }
        assert_eq!(right.against_first.value, 0.0);
        assert_eq!(curves.to_json(&["right", "wrong"])[0]["frames"], 12);
        assert!(curves.table(&["right", "wrong"]).contains('['));
        // Frames of one road that are all alike: four roads are four values, however many frames they have.
        for frames in &mut curves.measured {
            for at in 0..frames.len() {
                let Measured { own, moved, .. } = frames[at / 3 * 3];
                (frames[at].own, frames[at].moved) = (own, moved);
            }
        }
        let narrow = curves.found(0).deletion_gain;
        curves.measured.iter_mut().flatten().zip(0..).for_each(|(both, at)| both.road = Some(at % 12 / 3));
        assert_eq!(
            (curves.independent(), curves.to_json(&["right", "wrong"])[0]["independent"].as_u64()),
            (4, Some(4))
        );
        let wide = curves.found(0).deletion_gain;
        assert!((wide.value - narrow.value).abs() < 1e-12 && wide.high - wide.low > narrow.high - narrow.low);
        assert!(curves.table(&["right", "wrong"]).contains("over 12 frames of 4 roads"));
        curves.measured.iter_mut().for_each(|frames| frames.truncate(1));
        let one = curves.table(&["right", "wrong"]);
        assert!(one.contains("on one frame") && !one.contains('['), "{one}");
        let json = curves.to_json(&["right", "wrong"]);
        assert!(json[1]["insertion"]["better_than_moved"]["low"].is_null());
        assert_eq!(json[0]["frames"], 1);
    }

    /// Steers by how many frames it has seen.
    struct Remembers(u32);

    impl Driver for Remembers {
        fn reset(&mut self) -> Result<()> {
            self.0 = 0;
            Ok(())
        }

        fn drive(&mut self, _: Frame<'_>, _: &DriveContext) -> Result<Control> {
            self.0 += 1;
            Ok(Control { steering: f64::from(self.0), throttle: 0.0 })
        }
    }

    #[test]
    fn what_a_driver_remembers_of_other_frames_does_not_count() {
        let driver = Box::new(Remembers(7));
        let mut curves =
            Curves { driver, place: "x".into(), speed: 0.0, seed: 1, measured: vec![Vec::new()] };
        let shown = Shown { name: String::new(), frame: FrameBuf::new(8, 8), speed: None, road: None };
        let seen = curves.see(&shown, 0).unwrap();
        curves.add(0, &seen, &[0.5; 64]).unwrap();
        let found = curves.found(0);
        assert_eq!((found.deletion, found.insertion), (0.0, 0.0));
    }

    /// Counts the frames that it has seen.
    struct Counts(Arc<AtomicUsize>);

    impl Driver for Counts {
        fn drive(&mut self, _: Frame<'_>, _: &DriveContext) -> Result<Control> {
            self.0.fetch_add(1, Ordering::Relaxed);
            Ok(Control::default())
        }
    }

    #[test]
    fn what_no_map_changes_is_measured_once_a_frame() {
        let count = Arc::new(AtomicUsize::new(0));
        let driver = Box::new(Counts(count.clone()));
        let measured = vec![Vec::new(), Vec::new()];
        let mut curves = Curves { driver, place: "x".into(), speed: 0.0, seed: 1, measured };
        let shown = Shown { name: String::new(), frame: FrameBuf::new(24, 16), speed: None, road: None };
        let seen = curves.see(&shown, 0).unwrap();
        let of_frame = count.swap(0, Ordering::Relaxed);
        assert_eq!(of_frame, 2 + Patches::SETS);
        for method in 0..2 {
            curves.add(method, &seen, &[0.5; 24 * 16]).unwrap();
            assert_eq!(count.swap(0, Ordering::Relaxed), (1 + MOVES) * 2 * (STEPS - 1));
        }
    }

    #[test]
    fn moving_a_map_keeps_its_values() {
        let map: Vec<f32> = (0..12).map(|value| value as f32).collect();
        let mut random = seed::key(3, "test", 0).sequence();
        let mut moved = relocate(&map, 4, &mut random);
        assert_ne!(moved, map);
        moved.sort_by(f32::total_cmp);
        assert_eq!(moved, map);
    }
}
