//! In which regions of the space points are critical: a decision tree.
//!
//! Breiman, Friedman, Olshen, Stone, "Classification and regression trees" (1984), with entropy as the measure of impurity.
//! Logarithms come from `libm`, so that the same points give the same tree on every machine.

use pdk_model::search::{Range, Space, label};

use crate::point::Point;

/// When a node is split.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The smallest share of all points that a node to be split holds.
    pub split_share: f64,
    /// The fewest points in a leaf.
    pub leaf: usize,
    /// The smallest decrease of impurity, in bits, weighted with the node's share of all points.
    pub decrease: f64,
    /// How many splits lie above a leaf at most.
    pub depth: usize,
    /// Whether critical points count as much, all together, as the others do. Else a tree does not see them if they are few.
    pub balanced: bool,
}

/// The limits of the published experiment.
pub const PUBLISHED: Limits =
    Limits { split_share: 0.07, leaf: 5, decrease: 0.05, depth: 100, balanced: false };

/// A node: a region of the space, the points in it, and where it is split.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// The smallest and the largest position of each variable; only whole ones where only these have values.
    pub region: Vec<(f64, f64)>,
    /// The places of its points in the list from which the tree was made.
    pub rows: Vec<usize>,
    /// How many of these are critical.
    pub critical: usize,
    /// The variable and the threshold at which it is split, and the places of the nodes at or below it, and above it; none
    /// for a leaf.
    pub split: Option<Split>,
}

/// Where a node is split.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split {
    /// The variable.
    pub variable: usize,
    /// Positions up to it go to the one side, larger ones to the other.
    pub threshold: f64,
    /// The place of the node with the smaller positions.
    pub below: usize,
    /// The place of the node with the larger positions.
    pub above: usize,
}

impl Node {
    /// The share of its points that is critical.
    pub fn share(&self) -> f64 {
        if self.rows.is_empty() { 0.0 } else { self.critical as f64 / self.rows.len() as f64 }
    }
}

/// A tree over points, the root first.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// Its nodes: the root, and each node before those beneath it.
    pub nodes: Vec<Node>,
}

impl Tree {
    /// The tree over points in a space.
    pub fn new(space: &Space, points: &[&Point], limits: Limits) -> Self {
        let region = space.variables.iter().map(|variable| variable.range.bounds()).collect();
        let rows: Vec<usize> = (0..points.len()).collect();
        let critical = points.iter().filter(|point| point.critical).count();
        let weight = match limits.balanced && critical > 0 {
            true => (points.len() - critical) as f64 / critical as f64,
            false => 1.0,
        };
        let total = weight * critical as f64 + (points.len() - critical) as f64;
        let grower = Grower { space, points, limits, weight, total };
        let mut nodes = vec![Node { region, rows, critical, split: None }];
        let mut open = vec![(0, 0)];
        while let Some((place, depth)) = open.pop() {
            let Some((variable, threshold)) = grower.split(&nodes[place], depth) else { continue };
            let (below, above) = grower.divide(&nodes[place], variable, threshold);
            nodes[place].split =
                Some(Split { variable, threshold, below: nodes.len(), above: nodes.len() + 1 });
            open.extend([(nodes.len(), depth + 1), (nodes.len() + 1, depth + 1)]);
            nodes.extend([below, above]);
        }
        Self { nodes }
    }

    /// The leaves, those with larger positions first.
    pub fn leaves(&self) -> Vec<&Node> {
        let mut leaves = Vec::new();
        let mut open = vec![0];
        while let Some(place) = open.pop() {
            match self.nodes[place].split {
                Some(split) => open.extend([split.below, split.above]),
                None => leaves.push(&self.nodes[place]),
            }
        }
        leaves
    }
}

struct Grower<'a> {
    space: &'a Space,
    points: &'a [&'a Point],
    limits: Limits,
    /// How much a critical point counts; the others count 1.
    weight: f64,
    total: f64,
}

impl Grower<'_> {
    /// The variable and the threshold at which a node is split best; none if it stays a leaf.
    fn split(&self, node: &Node, depth: usize) -> Option<(usize, f64)> {
        let size = node.rows.len();
        let fewest = libm::ceil(self.limits.split_share * self.points.len() as f64).max(2.0);
        if depth >= self.limits.depth || (size as f64) < fewest || node.critical == 0 || node.critical == size
        {
            return None;
        }
        let others = (size - node.critical) as f64;
        let (all_critical, all) =
            (self.weight * node.critical as f64, self.weight * node.critical as f64 + others);
        let impurity = entropy(all_critical, all);
        let mut best: Option<(f64, usize, f64)> = None;
        for variable in 0..self.space.variables.len() {
            let position = |row: usize| self.points[row].x[variable];
            let mut order = node.rows.clone();
            order.sort_by(|&a, &b| position(a).total_cmp(&position(b)));
            let (mut critical, mut weight) = (0.0, 0.0);
            for place in 0..size - 1 {
                let counts = if self.points[order[place]].critical { self.weight } else { 1.0 };
                weight += counts;
                critical += if self.points[order[place]].critical { counts } else { 0.0 };
                let (here, next) = (position(order[place]), position(order[place + 1]));
                if here >= next || place + 1 < self.limits.leaf || size - place - 1 < self.limits.leaf {
                    continue;
                }
                let rest = all - weight;
                let left = weight / all * entropy(critical, weight);
                let right = rest / all * entropy(all_critical - critical, rest);
                let decrease = all / self.total * (impurity - left - right);
                // Of equal ones the first.
                if best.is_none_or(|(most, ..)| decrease > most + 1e-12) {
                    best = Some((decrease, variable, here + (next - here) / 2.0));
                }
            }
        }
        best.filter(|(decrease, ..)| *decrease >= self.limits.decrease && *decrease > 0.0)
            .map(|(_, variable, threshold)| (variable, threshold))
    }

    /// The two parts of a node.
    fn divide(&self, node: &Node, variable: usize, threshold: f64) -> (Node, Node) {
        let part = |rows: Vec<usize>| {
            let critical = rows.iter().filter(|&&row| self.points[row].critical).count();
            Node { region: node.region.clone(), rows, critical, split: None }
        };
        let (below, above): (Vec<usize>, Vec<usize>) =
            node.rows.iter().partition(|&&row| self.points[row].x[variable] <= threshold);
        let (mut below, mut above) = (part(below), part(above));
        let whole = self.space.variables[variable].range.is_discrete();
        below.region[variable].1 = if whole { libm::floor(threshold) } else { threshold };
        above.region[variable].0 = if whole { libm::floor(threshold) + 1.0 } else { threshold };
        (below, above)
    }
}

/// The entropy in bits of a share.
fn entropy(part: f64, whole: f64) -> f64 {
    let bits = |share: f64| if share > 0.0 { -share * libm::log2(share) } else { 0.0 };
    if whole <= 0.0 { 0.0 } else { bits(part / whole) + bits(1.0 - part / whole) }
}

/// A region in words, such as `perturbation >= fog_filter and intensity >= 3`; `everywhere` for the whole space.
pub fn words(space: &Space, region: &[(f64, f64)]) -> String {
    let mut conditions = Vec::new();
    for (variable, &(low, high)) in space.variables.iter().zip(region) {
        let name = &variable.name;
        let (lowest, highest) = variable.range.bounds();
        let value = |position: f64| match variable.range.value(position) {
            // More digits than that do not help a reader.
            value if matches!(variable.range, Range::Real { .. }) => {
                short(value.as_f64().unwrap_or_default())
            }
            value => label(&value),
        };
        match &variable.range {
            Range::Choice { values } if low > lowest || high < highest => {
                let among: Vec<String> = values
                    .iter()
                    .enumerate()
                    .filter(|(place, _)| (low..=high).contains(&(*place as f64)))
                    .map(|(_, value)| label(value))
                    .collect();
                conditions.push(format!("{name} is {}", among.join(" or ")));
            }
            _ if low == high && lowest < highest => conditions.push(format!("{name} = {}", value(low))),
            _ => {
                if low > lowest {
                    conditions.push(format!("{name} >= {}", value(low)));
                }
                if high < highest {
                    conditions.push(format!("{name} <= {}", value(high)));
                }
            }
        }
    }
    if conditions.is_empty() { "everywhere".to_owned() } else { conditions.join(" and ") }
}

/// A number with four digits that count.
pub fn short(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let magnitude = libm::floor(libm::log10(number.abs())) as i32;
    let text = format!("{number:.*}", (3 - magnitude).max(0) as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn space() -> Space {
        serde_json::from_value(json!({"variables": [
            {"name": "level", "type": "real", "min": 0.0, "max": 4.0},
            {"name": "perturbation", "type": "ordinal", "values": ["blur", "fog", "rain", "snow"]},
            {"name": "light", "type": "choice", "values": ["day", "dusk", "night"]},
        ]}))
        .unwrap()
    }

    fn grid(critical: impl Fn(&[f64]) -> bool) -> Vec<Point> {
        let mut points = Vec::new();
        for level in 0..20 {
            for (perturbation, light) in (0..12).map(|i| (f64::from(i % 4), f64::from(i / 4))) {
                let x = vec![f64::from(level) / 5.0, perturbation, light];
                points.push(Point { critical: critical(&x), x, f: vec![], violation: 0.0 });
            }
        }
        points
    }

    fn critical_regions(points: &[Point], limits: Limits) -> Vec<String> {
        let all: Vec<&Point> = points.iter().collect();
        let tree = Tree::new(&space(), &all, limits);
        assert_eq!(tree.leaves().iter().map(|leaf| leaf.rows.len()).sum::<usize>(), points.len());
        tree.leaves()
            .iter()
            .filter(|leaf| leaf.share() > 0.5)
            .map(|leaf| words(&space(), &leaf.region))
            .collect()
    }

    #[test]
    fn a_box_of_critical_points_is_found_and_told_in_words() {
        let points = grid(|x| x[0] > 2.5 && x[1] >= 2.0);
        assert_eq!(critical_regions(&points, PUBLISHED), ["level >= 2.5 and perturbation >= rain"]);
        let points = grid(|x| x[2] == 1.0 && x[1] == 1.0);
        assert_eq!(
            critical_regions(&points, Limits { decrease: 0.0, ..PUBLISHED }),
            ["perturbation = fog and light is dusk"]
        );
        assert_eq!(words(&space(), &[(0.0, 4.0), (0.0, 3.0), (0.0, 1.0)]), "light is day or dusk");
        assert_eq!(words(&space(), &[(0.0, 4.0), (0.0, 3.0), (0.0, 2.0)]), "everywhere");
    }

    #[test]
    fn few_critical_points_are_seen_where_they_count_as_much_as_the_others() {
        // 6 of 240.
        let points = grid(|x| x[0] >= 3.8 && x[1] >= 2.0);
        let limits = Limits { leaf: 3, split_share: 0.0, ..PUBLISHED };
        assert!(critical_regions(&points, Limits { decrease: 0.08, ..limits }).is_empty());
        assert_eq!(
            critical_regions(&points, Limits { decrease: 0.08, balanced: true, ..limits }),
            ["level >= 3.7 and perturbation >= rain"]
        );
    }

    #[test]
    fn numbers_are_printed_with_their_significant_digits() {
        let told = [0.0, 2.5, -0.001_234_56, 123_456.7, 0.1 + 0.2].map(short);
        assert_eq!(told, ["0", "2.5", "-0.001235", "123457", "0.3"]);
    }
}
