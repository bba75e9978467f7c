//! How faithful maps are: what the driver does when what they mark is taken away, and when nothing else is left.
//!
//! Deletion: the pixels that matter most are replaced by the frame's mean colour, more and more of them; the sooner the
//! steering moves away, the more faithful the map. Insertion: from the mean colour alone, the pixels that matter most come back
//! first; the sooner the steering returns, the more faithful. Both areas are the mean distance from the steering on the whole
//! frame, so that more is better for deletion and less for insertion (Petsiuk et al., 2018, for numbers instead of classes).
//!
//! Coarse maps have it easier than fine ones, whatever they mark, since large spots hide more. So each map is compared with
//! itself in other places: mirrored and moved around the frame at random.

use pdk_core::calls::{self, Function};
use pdk_core::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_pipeline::table::table;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{DriveContext, Driver, Frame, FrameBuf, Random};
use pdk_sdk::seed;
use serde_json::{Value, json};

/// Shares of the frame that are taken away or put back, from one step to the whole.
const STEPS: usize = 20;
/// How often each map is moved to another place.
const MOVES: usize = 3;
/// Samples of the bootstrap.
const SAMPLES: usize = 5000;

/// What was measured on one frame.
#[derive(Debug, Clone, Copy)]
struct Areas {
    deletion: f64,
    insertion: f64,
}

/// What was measured on all frames, by method.
pub struct Curves {
    driver: Box<dyn Driver>,
    place: String,
    speed: f64,
    seed: u64,
    /// For each method and frame the areas of the map, and the mean of those of the moved maps.
    measured: Vec<Vec<(Areas, Areas)>>,
}

impl Curves {
    /// Makes the driver.
    ///
    /// # Errors
    /// Where it refuses its parameters.
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
            measured: vec![Vec::new(); methods],
        })
    }

    /// Measures the map of a frame.
    ///
    /// # Errors
    /// Where the driver fails.
    pub fn add(&mut self, method: usize, frame: Frame<'_>, map: &[f32], index: u64) -> Result<()> {
        // The same moves for every method, so that methods are compared under the same luck.
        let mut random = seed::key(self.seed, "moved maps", 0).frame(index);
        let own = self.areas(frame, map)?;
        let mut moved = Areas { deletion: 0.0, insertion: 0.0 };
        for _ in 0..MOVES {
            let areas = self.areas(frame, &relocate(map, frame.width(), &mut random))?;
            moved.deletion += areas.deletion / MOVES as f64;
            moved.insertion += areas.insertion / MOVES as f64;
        }
        self.measured[method].push((own, moved));
        Ok(())
    }

    fn steering(&mut self, frame: Frame<'_>) -> Result<f64> {
        let cx = DriveContext { speed: self.speed, ..DriveContext::default() };
        let driver = &mut self.driver;
        let control = calls::call(&self.place, Function::Drive, || driver.drive(frame, &cx));
        Ok(control.map_err(|error| error.at(&self.place))?.steering)
    }

    fn areas(&mut self, frame: Frame<'_>, map: &[f32]) -> Result<Areas> {
        let whole = self.steering(frame)?;
        let mut order: Vec<usize> = (0..map.len()).collect();
        order.sort_by(|&a, &b| map[b].total_cmp(&map[a]));
        let mut taken = FrameBuf::new(frame.width(), frame.height());
        taken.as_mut().copy_from(frame);
        let mean = mean_color(frame);
        let mut left = FrameBuf::new(frame.width(), frame.height());
        left.as_mut()
            .rows_mut()
            .for_each(|row| row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&mean)));
        let mut areas = Areas { deletion: 0.0, insertion: (self.steering(left.as_ref())? - whole).abs() };
        for step in 1..=STEPS {
            for &at in &order[order.len() * (step - 1) / STEPS..order.len() * step / STEPS] {
                let (x, y) = (at % frame.width(), at / frame.width());
                taken.as_mut().set_pixel(x, y, mean);
                left.as_mut().set_pixel(x, y, frame.pixel(x, y));
            }
            areas.deletion += (self.steering(taken.as_ref())? - whole).abs();
            if step < STEPS {
                areas.insertion += (self.steering(left.as_ref())? - whole).abs();
            }
        }
        Ok(Areas { deletion: areas.deletion / STEPS as f64, insertion: areas.insertion / STEPS as f64 })
    }

    /// The areas of each method, and how much better they are than those of the moved maps, with intervals of 95 %.
    fn results(&self, method: usize) -> [(f64, [f64; 3]); 2] {
        let frames = &self.measured[method];
        let mean = |values: &dyn Fn(&(Areas, Areas)) -> f64| {
            frames.iter().map(values).sum::<f64>() / frames.len() as f64
        };
        let deletion: Vec<_> = frames.iter().map(|(own, moved)| own.deletion - moved.deletion).collect();
        let insertion: Vec<_> = frames.iter().map(|(own, moved)| moved.insertion - own.insertion).collect();
        let mut random = seed::key(self.seed, "bootstrap", 0).sequence();
        [
            (mean(&|(own, _)| own.deletion), interval(&deletion, &mut random)),
            (mean(&|(own, _)| own.insertion), interval(&insertion, &mut random)),
        ]
    }

    /// The results as JSON.
    pub fn to_json(&self, labels: &[&str]) -> Value {
        let methods = labels.iter().enumerate().map(|(method, label)| {
            let [deletion, insertion] = self.results(method).map(|(area, [gain, low, high])| {
                json!({ "area": area, "better_by": gain, "interval": [low, high] })
            });
            json!({ "method": label, "frames": self.measured[method].len(), "deletion": deletion, "insertion": insertion })
        });
        methods.collect()
    }

    /// The results as a table.
    pub fn table(&self, labels: &[&str]) -> String {
        let mut rows =
            table(["method", "deletion", "better than moved by", "insertion", "better than moved by"]);
        for (method, label) in labels.iter().enumerate() {
            let [deletion, insertion] = self.results(method).map(|(area, [gain, low, high])| {
                (format!("{area:.4}"), format!("{gain:+.4} [{low:+.4}, {high:+.4}]"))
            });
            rows.add_row([(*label).to_owned(), deletion.0, deletion.1, insertion.0, insertion.1]);
        }
        let frames = self.measured.first().map_or(0, Vec::len);
        format!(
            "{rows}\nmean change of the steering over {frames} frames: when what matters most is taken away first, more is \
             better; when it comes back first, less is better; in brackets 95 % intervals, paired by frame"
        )
    }
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

/// The mean, and the ends of its interval of 95 % by the bootstrap.
fn interval(values: &[f64], random: &mut Random) -> [f64; 3] {
    let mean = |sum: f64| sum / values.len() as f64;
    let mut means: Vec<f64> = (0..SAMPLES)
        .map(|_| mean((0..values.len()).map(|_| values[random.below(values.len() as u32) as usize]).sum()))
        .collect();
    means.sort_by(f64::total_cmp);
    [mean(values.iter().sum()), means[SAMPLES * 25 / 1000], means[SAMPLES * 975 / 1000]]
}

#[cfg(test)]
mod tests {
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
        let measured = vec![Vec::new(); 2];
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
            curves.add(0, frame.as_ref(), &map, u64::from(index)).unwrap();
            curves.add(1, frame.as_ref(), &opposite, u64::from(index)).unwrap();
        }
        for (area, [gain, low, high]) in curves.results(0) {
            assert!(area > 0.0 && low > 0.0 && low <= gain && gain <= high, "{area} {gain} {low} {high}");
        }
        for (_, [gain, _, high]) in curves.results(1) {
            assert!(gain < 0.0 && high < 0.0, "{gain} {high}");
        }
        assert_eq!(curves.to_json(&["right", "wrong"])[0]["frames"], 12);
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
