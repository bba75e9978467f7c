//! Waypoints as text: `x,y,z@x,y,z`, y up, in metres.

/// Waypoints as text. The shortest digits that give the same numbers again.
pub fn print(waypoints: &[[f64; 3]]) -> String {
    let points: Vec<String> = waypoints.iter().map(|[x, y, z]| format!("{x},{y},{z}")).collect();
    points.join("@")
}

/// Waypoints from text.
///
/// # Errors
/// If a point does not have three finite numbers.
pub fn parse(text: &str) -> Result<Vec<[f64; 3]>, String> {
    let point = |(i, point): (usize, &str)| {
        let numbers: Option<Vec<f64>> = point
            .split(',')
            .map(|number| number.trim().parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) => Ok([x, y, z]),
            _ => Err(format!("waypoint {} is `{point}`, but has to be three numbers: x,y,z", i + 1)),
        }
    };
    text.split('@').enumerate().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_wrong_point_is_named() {
        for wrong in ["", "1,2,3@1,2", "1,2,3@", "1,2,x", "1,2,inf", "1,2,3,4"] {
            assert!(parse(wrong).unwrap_err().contains("three numbers"), "{wrong}");
        }
        assert!(parse("1,2,3@1,2").unwrap_err().starts_with("waypoint 2 is `1,2`"));
    }

    proptest! {
        #[test]
        fn text_gives_the_same_points(points in prop::collection::vec(prop::array::uniform3(-1e6f64..1e6), 1..40)) {
            prop_assert_eq!(parse(&print(&points)).unwrap(), points);
        }
    }
}
