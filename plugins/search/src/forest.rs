//! A forest of extremely randomised regression trees: a model of what a function is likely to be where it was not evaluated.
//!
//! Geurts, Ernst, Wehenkel, "Extremely randomized trees" (2006). It takes any kind of variable, needs no scale, and tells by how
//! much its trees disagree how sure it is.

use pdk_sdk::seed::Random;

/// The fewest points in a node that is split.
const FEWEST: usize = 4;

/// The forest.
pub struct Forest {
    trees: Vec<Vec<Node>>,
}

enum Node {
    /// Positions below the threshold go to the next node, others to that with the number.
    Split { variable: usize, threshold: f64, above: usize },
    /// The mean of the points here.
    Leaf(f64),
}

impl Forest {
    /// A forest of this many trees over points and their values. There has to be at least one point.
    pub fn new(points: &[&[f64]], values: &[f64], trees: usize, random: &mut Random) -> Self {
        let grow = |_| {
            let mut rows: Vec<usize> = (0..points.len()).collect();
            let mut nodes = Vec::new();
            grow(points, values, &mut rows, &mut nodes, random);
            nodes
        };
        Self { trees: (0..trees).map(grow).collect() }
    }

    /// The predicted value at a position, and the standard deviation of the trees' predictions.
    pub fn predict(&self, x: &[f64]) -> (f64, f64) {
        let (mut sum, mut squares) = (0.0, 0.0);
        for nodes in &self.trees {
            let value = predict(nodes, x);
            sum += value;
            squares += value * value;
        }
        let count = self.trees.len() as f64;
        let mean = sum / count;
        (mean, libm::sqrt((squares / count - mean * mean).max(0.0)))
    }
}

fn predict(nodes: &[Node], x: &[f64]) -> f64 {
    let mut place = 0;
    loop {
        match &nodes[place] {
            Node::Leaf(value) => return *value,
            Node::Split { variable, threshold, above } => {
                place = if x[*variable] < *threshold { place + 1 } else { *above };
            }
        }
    }
}

/// Grows the tree over these rows, behind the nodes that are there.
fn grow(points: &[&[f64]], values: &[f64], rows: &mut [usize], nodes: &mut Vec<Node>, random: &mut Random) {
    let mean = rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len() as f64;
    let split = match rows.len() < FEWEST || rows.iter().all(|&row| values[row] == values[rows[0]]) {
        true => None,
        false => best_split(points, values, rows, random),
    };
    let Some((variable, threshold)) = split else {
        nodes.push(Node::Leaf(mean));
        return;
    };
    // Stable, so that the order of the rows follows from that before.
    rows.sort_by_key(|&row| points[row][variable] >= threshold);
    let count = rows.iter().filter(|&&row| points[row][variable] < threshold).count();
    let place = nodes.len();
    nodes.push(Node::Leaf(mean));
    let (below, above) = rows.split_at_mut(count);
    grow(points, values, below, nodes, random);
    let behind = nodes.len();
    grow(points, values, above, nodes, random);
    nodes[place] = Node::Split { variable, threshold, above: behind };
}

/// Of one random threshold for each variable, that which leaves the least variance.
fn best_split(
    points: &[&[f64]],
    values: &[f64],
    rows: &[usize],
    random: &mut Random,
) -> Option<(usize, f64)> {
    let mut best: Option<(f64, usize, f64)> = None;
    let variables = 0..points[rows[0]].len();
    for variable in variables {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &row in rows {
            low = low.min(points[row][variable]);
            high = high.max(points[row][variable]);
        }
        // Drawn for each, so that what one variable is like does not change what others draw.
        let draw = random.unit();
        if low >= high {
            continue;
        }
        // Above the lowest, so that neither side is empty.
        let threshold = high - draw * (high - low);
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for &row in rows {
            let side = usize::from(points[row][variable] >= threshold);
            sums[side] += values[row];
            counts[side] += 1.0;
        }
        if counts[0] == 0.0 || counts[1] == 0.0 {
            continue;
        }
        // The variance between the sides: what it is more, it is less within them.
        let between = sums[0] * sums[0] / counts[0] + sums[1] * sums[1] / counts[1];
        if best.is_none_or(|(most, ..)| between > most) {
            best = Some((between, variable, threshold));
        }
    }
    best.map(|(_, variable, threshold)| (variable, threshold))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::key;

    #[test]
    fn a_forest_is_near_the_function_and_unsure_where_it_has_seen_nothing() {
        let mut random = key(1).sequence();
        let points: Vec<Vec<f64>> = (0..400).map(|_| vec![random.uniform(0.0, 0.5), random.unit()]).collect();
        let function = |x: &[f64]| 4.0 * x[0] + libm::sin(6.0 * x[1]);
        let values: Vec<f64> = points.iter().map(|x| function(x)).collect();
        let rows: Vec<&[f64]> = points.iter().map(Vec::as_slice).collect();
        let forest = Forest::new(&rows, &values, 40, &mut random);
        let mut error = 0.0;
        for _ in 0..200 {
            let x = [random.uniform(0.05, 0.45), random.uniform(0.05, 0.95)];
            error += (forest.predict(&x).0 - function(&x)).abs() / 200.0;
        }
        assert!(error < 0.15, "{error}");
        let seen = forest.predict(&points[7]);
        assert!((seen.0 - values[7]).abs() < 0.2, "{seen:?}");
    }

    #[test]
    fn one_point_is_a_forest() {
        let forest = Forest::new(&[&[1.0]], &[3.0], 5, &mut key(1).sequence());
        assert_eq!(forest.predict(&[9.0]), (3.0, 0.0));
    }
}
