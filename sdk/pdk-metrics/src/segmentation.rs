//! Segmentation: of the pixels that are of a class or are said to be, how many are both (the intersection over union, as in M. Everingham
//! et al., "The PASCAL Visual Object Classes Challenge: A Retrospective", 2015).

/// Pixels by class, of one picture or of many.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Pixels {
    /// Those that are of the class and are said to be.
    pub right: Vec<u64>,
    /// Those that are said to be of it.
    pub predicted: Vec<u64>,
    /// Those that are of it.
    pub labelled: Vec<u64>,
}

impl Pixels {
    /// No pixels of this many classes.
    pub fn new(classes: usize) -> Self {
        Self { right: vec![0; classes], predicted: vec![0; classes], labelled: vec![0; classes] }
    }

    /// Adds a pixel. What is said to be of a class that does not exist is wrong, and counts for no other class.
    pub fn add(&mut self, predicted: usize, labelled: usize) {
        if let Some(count) = self.labelled.get_mut(labelled) {
            *count += 1;
            if let Some(count) = self.predicted.get_mut(predicted) {
                *count += 1;
            }
            if predicted == labelled {
                self.right[labelled] += 1;
            }
        }
    }

    /// Adds the pixels of another picture.
    pub fn add_all(&mut self, other: &Self) {
        let add = |own: &mut Vec<u64>, other: &[u64]| {
            own.resize(own.len().max(other.len()), 0);
            own.iter_mut().zip(other).for_each(|(own, other)| *own += other);
        };
        add(&mut self.right, &other.right);
        add(&mut self.predicted, &other.predicted);
        add(&mut self.labelled, &other.labelled);
    }

    /// The intersection over union of each class; none if no pixel is of it or is said to be.
    pub fn over_union(&self) -> Vec<Option<f64>> {
        let of = |class: usize| {
            let union = self.predicted[class] + self.labelled[class] - self.right[class];
            (union > 0).then(|| self.right[class] as f64 / union as f64)
        };
        (0..self.right.len()).map(of).collect()
    }

    /// The mean of the intersections over union (mIoU). None if no class has one.
    pub fn mean_over_union(&self) -> Option<f64> {
        let found: Vec<f64> = self.over_union().into_iter().flatten().collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    }

    /// The share of the pixels that are right. None if there are none.
    pub fn accuracy(&self) -> Option<f64> {
        let all: u64 = self.labelled.iter().sum();
        (all > 0).then(|| self.right.iter().sum::<u64>() as f64 / all as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unions_count_what_is_missed_and_what_is_made_up() {
        let mut pixels = Pixels::new(3);
        for (predicted, labelled) in [(0, 0), (0, 0), (1, 0), (1, 1), (7, 1)] {
            pixels.add(predicted, labelled);
        }
        let mut all = Pixels::new(3);
        all.add_all(&pixels);
        assert_eq!(all, pixels);
        // Of three zeros two are found, and nothing else is said to be zero; of two ones one is found, and another is made up.
        assert_eq!(pixels.over_union(), [Some(2.0 / 3.0), Some(1.0 / 3.0), None]);
        assert_eq!(pixels.mean_over_union(), Some(0.5));
        assert_eq!(pixels.accuracy(), Some(0.6));
        assert_eq!((Pixels::new(2).mean_over_union(), Pixels::new(2).accuracy()), (None, None));
    }
}
