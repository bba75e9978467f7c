//! What the descriptions of the suite share.

use pdk_sdk::prelude::*;

/// The beginning of a corruption's description. The version is that of the suite: it rises with a change of any output.
#[track_caller]
pub fn corruption(name: &str, doc: &str) -> Description {
    Description::perturbation(&format!("imagenet_c_{name}"), doc)
        .family("imagenet_c")
        .keeps_geometry()
        .not_default()
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
}

/// Whether something that was made for one frame fits the next: the size, the key and numbers that it was made with.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MadeFor {
    size: [usize; 2],
    key: Option<Key>,
    numbers: Vec<f64>,
}

impl MadeFor {
    /// Notes what is wanted now; false if that is what was noted before.
    pub fn is_new(&mut self, size: [usize; 2], key: Option<Key>, numbers: &[f64]) -> bool {
        let is_new = self.size != size || self.key != key || self.numbers != numbers;
        if is_new {
            (self.size, self.key) = (size, key);
            self.numbers.clear();
            self.numbers.extend_from_slice(numbers);
        }
        is_new
    }
}
