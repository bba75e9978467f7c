//! Segmentation: the mean intersection over union (M. Everingham et al., "The PASCAL Visual Object Classes Challenge", 2010).

/// How often each class was taken for each other one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    classes: usize,
    /// By labelled class, then by predicted one, behind which stands what is not a class.
    counts: Vec<u64>,
}

impl Confusion {
    /// Nothing yet, of this many classes.
    pub fn new(classes: usize) -> Self {
        Self { classes, counts: vec![0; classes * (classes + 1)] }
    }

    /// Adds the pixels of a picture. A label that is not a class does not count, such as 255 for what is not labelled; a prediction
    /// that is not a class is wrong.
    pub fn add(&mut self, predicted: &[usize], labelled: &[usize]) {
        for (predicted, labelled) in predicted.iter().zip(labelled) {
            if *labelled < self.classes {
                self.counts[labelled * (self.classes + 1) + (*predicted).min(self.classes)] += 1;
            }
        }
    }

    /// The intersection over union of each class; none for a class that is neither labelled nor predicted.
    pub fn over_union(&self) -> Vec<Option<f64>> {
        let at = |labelled: usize, predicted: usize| self.counts[labelled * (self.classes + 1) + predicted];
        let one = |class: usize| {
            let labelled: u64 = (0..=self.classes).map(|other| at(class, other)).sum();
            let predicted: u64 = (0..self.classes).map(|other| at(other, class)).sum();
            let union = labelled + predicted - at(class, class);
            (union > 0).then(|| at(class, class) as f64 / union as f64)
        };
        (0..self.classes).map(one).collect()
    }

    /// The mean over the classes that are there. None if there are none.
    pub fn mean_over_union(&self) -> Option<f64> {
        let known: Vec<f64> = self.over_union().into_iter().flatten().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_over_classes_that_are_there() {
        let mut confusion = Confusion::new(4);
        confusion.add(&[0, 0, 1, 1, 2], &[0, 1, 1, 1, 255]);
        assert_eq!(confusion.over_union(), [Some(0.5), Some(2.0 / 3.0), None, None]);
        assert!((confusion.mean_over_union().unwrap() - 7.0 / 12.0).abs() < 1e-12);
        let mut wrong = Confusion::new(1);
        wrong.add(&[0, 7], &[0, 0]);
        assert_eq!(wrong.over_union(), [Some(0.5)]);
        assert_eq!(Confusion::new(2).mean_over_union(), None);
    }
}
