//! What an evaluation of a predictor came to as long as there is no summary, from the lines of its pictures. What can be said from these lines
//! alone is said: the precision of a detector needs the labels, which the record does not have.

use std::collections::BTreeMap;

use pdk_metrics::segmentation::Pixels;
use serde_json::Value;

use crate::view::{Task, TaskNumber};

/// What the page calls it: the manifest does not name the metric.
const NAME: &str = "the task under way";

/// The lines of an evaluation.
#[derive(Default)]
pub struct UnderWay {
    original: Sums,
    cells: Vec<(String, f64, Sums)>,
    /// Where a cell stands in `cells`: its label and the bits of its level.
    places: BTreeMap<(String, u64), usize>,
}

impl UnderWay {
    /// Adds a line: what was measured of a picture under a perturbation at a level, or of the picture as it is.
    pub fn add(&mut self, cell: Option<(String, f64)>, measured: &Value) {
        let Some((label, level)) = cell else { return self.original.add(measured) };
        let cells = &mut self.cells;
        let place = *self.places.entry((label.clone(), level.to_bits())).or_insert_with(|| {
            cells.push((label, level, Sums::default()));
            cells.len() - 1
        });
        cells[place].2.add(measured);
    }

    /// What the page says about it.
    pub fn finish(self, number: u64, bad_frames: Vec<(String, String)>) -> Task {
        let of_cells: Vec<_> =
            self.cells.iter().map(|(label, level, sums)| (label, *level, sums.numbers())).collect();
        let numbers = self.original.numbers().into_iter().map(|(name, original)| {
            let cells = of_cells.iter().filter_map(|(label, level, numbers)| {
                let (_, value) = numbers.iter().find(|(own, _)| *own == name)?;
                Some(((*label).clone(), *level, *value))
            });
            TaskNumber { cells: cells.collect(), original: Some(original), name }
        });
        Task {
            number,
            name: NAME.to_owned(),
            frames: self.original.pictures,
            numbers: numbers.collect(),
            bad_frames,
        }
    }
}

/// What was measured of pictures.
#[derive(Default)]
struct Sums {
    pictures: usize,
    pixels: Pixels,
    /// Numbers by their names in the order in which these came: the sum, and how many there are.
    numbers: Vec<(String, f64, usize)>,
}

impl Sums {
    fn add(&mut self, measured: &Value) {
        self.pictures += 1;
        if let (Some(top), class) = (measured["top"].as_array(), &measured["class"]) {
            for (name, among) in [("top1_error", 1), ("top5_error", 5)] {
                self.number(name, f64::from(!top.iter().take(among).any(|found| found == class)));
            }
            return;
        }
        let counts = ["right", "predicted", "labelled"].map(|of| measured[of].as_array());
        if let [Some(right), Some(predicted), Some(labelled)] = counts {
            let [right, predicted, labelled] =
                [right, predicted, labelled].map(|counts| counts.iter().filter_map(Value::as_u64).collect());
            self.pixels.add_all(&Pixels { right, predicted, labelled });
            return;
        }
        for (name, value) in measured.as_object().into_iter().flatten() {
            if let Some(value) = value.as_f64() {
                self.number(name, value);
            }
        }
    }

    fn number(&mut self, name: &str, value: f64) {
        match self.numbers.iter_mut().find(|(known, ..)| known == name) {
            Some((_, sum, count)) => (*sum, *count) = (*sum + value, *count + 1),
            None => self.numbers.push((name.to_owned(), value, 1)),
        }
    }

    fn numbers(&self) -> Vec<(String, f64)> {
        let pixels = [("miou", self.pixels.mean_over_union()), ("pixel_accuracy", self.pixels.accuracy())];
        let pixels = pixels.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
        let means = self.numbers.iter().map(|(name, sum, count)| (name.clone(), sum / *count as f64));
        pixels.chain(means).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_the_lines_say_is_shown_for_each_kind_of_task() {
        let task = |original: [Value; 2], perturbed: Value| {
            let mut task = UnderWay::default();
            original.iter().for_each(|measured| task.add(None, measured));
            task.add(Some(("fog".into(), 2.0)), &perturbed);
            task.finish(3, vec![("a.png".into(), "it is empty".into())])
        };
        let top = |top: [u64; 2]| json!({"class": 1, "top": top});
        let found = task([top([1, 0]), top([0, 1])], top([0, 2]));
        assert_eq!((found.number, found.frames, found.bad_frames.len()), (3, 2, 1));
        let number = |name: &str, original: f64, perturbed: f64| TaskNumber {
            name: name.into(),
            original: Some(original),
            cells: vec![("fog".into(), 2.0, perturbed)],
        };
        let same = |found: &Task, wanted: &[TaskNumber]| {
            assert_eq!(format!("{:?}", found.numbers), format!("{wanted:?}"));
        };
        same(&found, &[number("top1_error", 0.5, 1.0), number("top5_error", 0.0, 1.0)]);
        let pixels = json!({"right": [2, 1], "predicted": [3, 1], "labelled": [2, 2]});
        let of_pixels = task(
            [pixels.clone(), pixels.clone()],
            json!({"right": [0, 2], "predicted": [0, 4], "labelled": [2, 2]}),
        );
        same(
            &of_pixels,
            &[number("miou", (2.0 / 3.0 + 0.5) / 2.0, 0.25), number("pixel_accuracy", 0.75, 0.5)],
        );
        same(
            &task([json!({"ade": 1.0}), json!({"ade": 2.0})], json!({"ade": 4.0})),
            &[number("ade", 1.5, 4.0)],
        );
        // Boxes say nothing without the labels.
        same(&task([json!([[1, 2]]), json!([])], json!([])), &[]);
    }
}
