//! The part of a drive that a perturbation is limited to.

use pdk_model::during::{During, Span};

use crate::mask::Mask;

/// A part made ready for frames.
pub struct Part {
    during: During,
    /// The box of what is perturbed, and everything but that of what is left out.
    masks: [Option<Mask>; 2],
}

impl Part {
    /// A part.
    pub fn new(during: &During) -> Self {
        let mask = |span: Span, inverted| span.area.map(|area| Mask::of_box(area, inverted));
        let masks = [mask(during.span, false), mask(during.except.unwrap_or_default(), true)];
        Self { during: *during, masks }
    }

    /// Whether it limits what is changed of a frame, and not only which frames are changed.
    pub fn has_box(&self) -> bool {
        self.during.has_box()
    }

    /// Whether nothing of the frame at this time, in seconds, is perturbed.
    pub fn spares(&self, time: f64) -> bool {
        self.during.spares(time)
    }

    /// How much of each pixel of the frame at this time is changed, 0 to 255, by what is perturbed and by what is left out of it; nothing
    /// if they do not limit it.
    pub fn weights(&mut self, time: f64, width: usize, height: usize) -> [Option<&[u8]>; 2] {
        let [within, without] = &mut self.masks;
        let left_out = self.during.except.is_some_and(|except| except.contains(time));
        [within.as_mut(), without.as_mut().filter(|_| left_out)]
            .map(|mask| mask.map(|mask| mask.weights(width, height)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// What is changed of a frame of two by two pixels at a time: nothing, all, or these of its pixels.
    fn changed(during: Value, time: f64) -> Option<Vec<u8>> {
        let mut part = Part::new(&During::from_json(&during).unwrap());
        if part.spares(time) {
            return None;
        }
        let mut all = vec![255; 4];
        for weights in part.weights(time, 2, 2).into_iter().flatten() {
            all.iter_mut().zip(weights).for_each(|(all, weight)| *all = (*all).min(*weight));
        }
        Some(all)
    }

    #[test]
    fn a_span_and_a_box_limit_what_is_changed() {
        let right = json!({"from": 1, "to": 2, "box": [0.5, 0, 1, 1]});
        assert_eq!(changed(right.clone(), 0.9), None);
        assert_eq!(changed(right.clone(), 1.0), Some(vec![0, 255, 0, 255]));
        assert_eq!(changed(right, 2.0), None);
        assert_eq!(changed(json!({}), 7.0), Some(vec![255; 4]));
    }

    #[test]
    fn what_is_left_out_is_left_out_of_the_rest() {
        let but_one_corner = json!({"to": 3, "except": {"from": 1, "to": 2, "box": [0.5, 0.5, 1, 1]}});
        assert_eq!(changed(but_one_corner.clone(), 0.0), Some(vec![255; 4]));
        assert_eq!(changed(but_one_corner.clone(), 1.5), Some(vec![255, 255, 255, 0]));
        assert_eq!(changed(but_one_corner, 3.0), None);
        let but_a_second = json!({"box": [0, 0, 1, 0.5], "except": {"from": 1, "to": 2}});
        assert_eq!(changed(but_a_second.clone(), 1.0), None);
        assert_eq!(changed(but_a_second, 2.0), Some(vec![255, 255, 0, 0]));
    }
}
