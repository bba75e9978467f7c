//! Which of a model's outputs steer.

use pdk_sdk::prelude::*;

/// One number among a model's outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slot {
    /// Which output.
    pub output: usize,
    /// Which of its numbers.
    pub index: usize,
}

/// Where steering and throttle are found among a model's outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Selection {
    /// The steering.
    pub steering: Slot,
    /// The throttle, where the model gives one.
    pub throttle: Option<Slot>,
}

impl Selection {
    /// Chooses among outputs with these names and numbers of values. An empty name leaves the choice to the shape: one
    /// output of two numbers is steering and throttle, one of one number is the steering, two of one number each are
    /// steering and throttle.
    ///
    /// # Errors
    /// If a name is not there, or the outputs are none of these.
    pub fn new(names: &[String], sizes: &[usize], steering: &str, throttle: &str) -> Result<Self> {
        let wrong = |expected: &str| {
            let outputs: Vec<_> =
                names.iter().zip(sizes).map(|(name, size)| format!("`{name}` ({size})")).collect();
            Error::new(format!(
                "its outputs, with the number of values of each, are {}; {expected}",
                outputs.join(", ")
            ))
        };
        let find = |parameter: &str, name: &str| {
            let found = names.iter().position(|known| known == name);
            found.ok_or_else(|| wrong(&format!("none is called `{name}`, as `{parameter}` says")))
        };
        let first = |output| Slot { output, index: 0 };
        let (steering, throttle) = match (steering, throttle) {
            ("", "") => match sizes {
                [1] => (0, None),
                [2] => return Ok(Self { steering: first(0), throttle: Some(Slot { output: 0, index: 1 }) }),
                [1, 1] => (0, Some(1)),
                _ => {
                    return Err(wrong(
                        "a driving model has one output of steering and throttle, one of steering alone, or one of each; \
                         name them with `steering_output` and `throttle_output`",
                    ));
                }
            },
            ("", throttle) => {
                let throttle = find("throttle_output", throttle)?;
                let mut others = (0..names.len()).filter(|&output| output != throttle);
                match (others.next(), others.next()) {
                    (Some(steering), None) => (steering, Some(throttle)),
                    _ => return Err(wrong("name the one that steers with `steering_output`")),
                }
            }
            (steering, "") => {
                let steering = find("steering_output", steering)?;
                if sizes[steering] == 2 {
                    let throttle = Some(Slot { output: steering, index: 1 });
                    return Ok(Self { steering: first(steering), throttle });
                }
                (steering, None)
            }
            (steering, throttle) => {
                (find("steering_output", steering)?, Some(find("throttle_output", throttle)?))
            }
        };
        for output in [Some(steering), throttle].into_iter().flatten() {
            if sizes[output] != 1 {
                return Err(wrong(&format!("`{}` has to be one number", names[output])));
            }
        }
        Ok(Self { steering: first(steering), throttle: throttle.map(first) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn select(outputs: &[(&str, usize)], steering: &str, throttle: &str) -> Result<Selection> {
        let names: Vec<_> = outputs.iter().map(|(name, _)| (*name).to_owned()).collect();
        let sizes: Vec<_> = outputs.iter().map(|(_, size)| *size).collect();
        Selection::new(&names, &sizes, steering, throttle)
    }

    fn selection(steering: (usize, usize), throttle: Option<(usize, usize)>) -> Selection {
        let slot = |(output, index)| Slot { output, index };
        Selection { steering: slot(steering), throttle: throttle.map(slot) }
    }

    #[test]
    fn the_usual_shapes_need_no_names() {
        assert_eq!(select(&[("out", 2)], "", "").unwrap(), selection((0, 0), Some((0, 1))));
        assert_eq!(select(&[("out", 1)], "", "").unwrap(), selection((0, 0), None));
        assert_eq!(select(&[("s", 1), ("t", 1)], "", "").unwrap(), selection((0, 0), Some((1, 0))));
    }

    #[test]
    fn names_choose_among_several() {
        let two = [("t", 1), ("s", 1)];
        assert_eq!(select(&two, "s", "t").unwrap(), selection((1, 0), Some((0, 0))));
        assert_eq!(select(&two, "", "t").unwrap(), selection((1, 0), Some((0, 0))));
        assert_eq!(select(&two, "s", "").unwrap(), selection((1, 0), None));
        let features = [("features", 64), ("both", 2)];
        assert_eq!(select(&features, "both", "").unwrap(), selection((1, 0), Some((1, 1))));
    }

    #[test]
    fn other_outputs_are_refused_with_what_was_found() {
        let error =
            |outputs: &[(&str, usize)], s: &str, t: &str| select(outputs, s, t).unwrap_err().to_string();
        let classes = error(&[("classes", 1000)], "", "");
        assert!(
            classes.starts_with(
                "its outputs, with the number of values of each, are `classes` (1000); a driving"
            )
        );
        assert!(error(&[("a", 1), ("b", 1), ("c", 1)], "", "c").contains("`steering_output`"));
        assert!(error(&[("a", 1)], "b", "").contains("none is called `b`, as `steering_output` says"));
        assert!(error(&[("a", 3)], "a", "").contains("`a` has to be one number"));
        assert!(error(&[("a", 2), ("b", 1)], "a", "b").contains("`a` has to be one number"));
        assert!(select(&[], "", "").is_err());
    }
}
