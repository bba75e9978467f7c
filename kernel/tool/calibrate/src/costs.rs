//! What the levels of a scale stand for.

use pdk_model::level::LEVELS;

/// What a perturbation costs at the levels 0, 1, 2, 3 and 4 of a scale, in rising order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs(pub [f64; LEVELS]);

impl Costs {
    /// The cost at a level: between whole levels it grows by equal factors.
    pub fn at(&self, level: f64) -> f64 {
        let lower = (level as usize).min(LEVELS - 2);
        let (low, high) = (self.0[lower], self.0[lower + 1]);
        low * libm::pow(high / low, level - lower as f64)
    }

    /// The level that costs so much, which may be outside 0 to 4.
    pub fn level_of(&self, cost: f64) -> f64 {
        let lower = self.0.partition_point(|&known| known <= cost).saturating_sub(1).min(LEVELS - 2);
        let (low, high) = (self.0[lower], self.0[lower + 1]);
        lower as f64 + libm::log(cost / low) / libm::log(high / low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: Costs = Costs([1.0, 2.0, 4.0, 8.0, 16.0]);

    #[test]
    fn costs_grow_by_equal_factors_between_levels() {
        assert_eq!([0.0, 1.0, 4.0].map(|level| COSTS.at(level)), [1.0, 2.0, 16.0]);
        assert!((COSTS.at(2.5) - 32f64.sqrt()).abs() < 1e-12);
        for level in [0.0, 0.5, 1.0, 3.75, 4.0] {
            assert!((COSTS.level_of(COSTS.at(level)) - level).abs() < 1e-12, "{level}");
        }
        assert!((COSTS.level_of(32.0) - 5.0).abs() < 1e-12 && (COSTS.level_of(0.5) + 1.0).abs() < 1e-12);
    }
}
