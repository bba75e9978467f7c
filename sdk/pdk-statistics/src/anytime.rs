//! A mean and what can be said about it at any time: however often one looks, and whenever one stops, an error is no more likely than
//! was allowed.
//!
//! This is a confidence sequence by betting: I. Waudby-Smith and A. Ramdas, "Estimating means of bounded random variables by betting",
//! Journal of the Royal Statistical Society B 86 (2024). Somebody who doubts that the mean is at least `limit` bets on each observation that
//! it is smaller, at odds that are fair if the mean is exactly `limit`. If the mean is `limit` or more, the capital is a nonnegative
//! supermartingale that begins with 1, so by Ville's inequality the probability that it ever reaches `1 / error` is at most `error`. Capital
//! that has grown so far is evidence against `limit`. The capital is spread evenly over fixed bets, from cautious to bold, as in the
//! section on hedged capital and grids of that paper: no bet depends on what is known of the drivers, and which one was good shows by itself.
//!
//! Observations lie from -1 to 1, such as the difference between two verdicts on one road. They need not be alike nor independent of each
//! other: it is enough that each has a mean, given all before it, on the same side of the limit.

/// How many bets the capital is spread over. More of them save one drive in twenty at most.
const BETS: u32 = 20;
/// Capital beyond this counts as this much, so that no product overflows.
const MOST: f64 = 1e200;
/// Steps of a bisection, after which a bound is exact to 2^-40.
const STEPS: u32 = 41;

/// On which side of a limit a mean is claimed to lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// It is smaller.
    Below,
    /// It is larger.
    Above,
}

/// A claim that a mean lies on one side of a limit, with the evidence for it so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    side: Side,
    limit: f64,
    /// The capital of each bet.
    capital: [f64; BETS as usize],
    /// The largest evidence of all looks.
    largest: f64,
}

impl Claim {
    /// The claim that the mean is smaller than `limit`, or larger; there is no evidence yet.
    pub fn new(side: Side, limit: f64) -> Self {
        Self { side, limit, capital: [1.0; BETS as usize], largest: 1.0 }
    }

    /// Takes an observation from -1 to 1 into account.
    pub fn add(&mut self, value: f64) {
        // How far the observation is on the claimed side, and how far it can be on the other one at most.
        let (gain, most) = match self.side {
            Side::Below => (self.limit - value, 1.0 - self.limit),
            Side::Above => (value - self.limit, 1.0 + self.limit),
        };
        for (capital, bet) in self.capital.iter_mut().zip(1..) {
            // The boldest bet loses all of its capital if the observation is as bad as it can be.
            let share = f64::from(bet) / f64::from(BETS);
            let factor = if most > 0.0 { 1.0 + share * gain / most } else { 1.0 };
            *capital = (*capital * factor.max(0.0)).min(MOST);
        }
        self.largest = self.largest.max(self.evidence());
    }

    /// The evidence for the claim: an e-value, which is 1 on average or less if the claim is false.
    pub fn evidence(&self) -> f64 {
        self.capital.iter().sum::<f64>() / f64::from(BETS)
    }

    /// The largest evidence so far. If the claim is false, it ever reaches `1 / error` with a probability of at most `error`.
    pub fn largest_evidence(&self) -> f64 {
        self.largest
    }

    /// Whether the claim has been shown by now, at an error that has at most this probability.
    pub fn is_shown(&self, error: f64) -> bool {
        self.largest * error >= 1.0
    }
}

/// Observations from -1 to 1, and the bounds of their mean.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sequence {
    values: Vec<f64>,
}

impl Sequence {
    /// Takes an observation from -1 to 1 into account.
    pub fn add(&mut self, value: f64) {
        self.values.push(value);
    }

    /// How many observations there are.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Their mean; none without observations.
    pub fn mean(&self) -> Option<f64> {
        (!self.values.is_empty()).then(|| self.values.iter().sum::<f64>() / self.values.len() as f64)
    }

    /// The smallest limit of which the observations show that the mean is below it. All the bounds that are ever computed while
    /// observations come in hold together with a probability of at least `1 - error`.
    pub fn upper(&self, error: f64) -> f64 {
        self.bound(Side::Below, error)
    }

    /// The largest limit of which the observations show that the mean is above it, in the same sense.
    pub fn lower(&self, error: f64) -> f64 {
        self.bound(Side::Above, error)
    }

    fn bound(&self, side: Side, error: f64) -> f64 {
        let shown = |limit: f64| {
            let mut claim = Claim::new(side, limit);
            self.values.iter().for_each(|value| claim.add(*value));
            claim.evidence() * error >= 1.0
        };
        // The evidence grows with the distance of the limit from the observations, so there is one place where it becomes enough.
        let far = if side == Side::Below { 1.0 } else { -1.0 };
        let (mut not_shown, mut enough) = (-far, far);
        for _ in 0..STEPS {
            let middle = (not_shown + enough) / 2.0;
            if shown(middle) {
                enough = middle;
            } else {
                not_shown = middle;
            }
        }
        enough
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(values: impl IntoIterator<Item = f64>) -> Sequence {
        Sequence { values: values.into_iter().collect() }
    }

    #[test]
    fn nothing_is_known_without_observations() {
        let none = Sequence::default();
        assert_eq!((none.lower(0.05), none.upper(0.05), none.mean()), (-1.0, 1.0, None));
        assert_eq!(Claim::new(Side::Below, 0.1).evidence(), 1.0);
    }

    #[test]
    fn bounds_close_in_on_the_mean_and_mirror_each_other() {
        let values = |count: usize| (0..count).map(|i| [1.0, 0.0, 0.0, -1.0, 0.0, 0.5, 0.0, 0.0][i % 8]);
        let mut before = (-1.0, 1.0);
        for count in [16, 80, 400, 2000] {
            let of = sequence(values(count));
            let (low, high) = (of.lower(0.05), of.upper(0.05));
            let mean = of.mean().unwrap();
            assert!(low < mean && mean < high && low > before.0 && high < before.1, "{low} {mean} {high}");
            let mirrored = sequence(values(count).map(|value| -value));
            assert!((mirrored.upper(0.05) + low).abs() < 1e-9 && (mirrored.lower(0.05) + high).abs() < 1e-9);
            assert!(of.lower(0.01) < low && of.upper(0.01) > high);
            before = (low, high);
        }
        assert!(before.1 - before.0 < 0.1, "{before:?}");
    }

    #[test]
    fn a_claim_is_shown_where_the_bound_passes_its_limit() {
        let mut claim = Claim::new(Side::Below, 0.1);
        let mut seen = Sequence::default();
        let mut first = None;
        for number in 1..=200 {
            let value = if number % 25 == 0 { 1.0 } else { 0.0 };
            claim.add(value);
            seen.add(value);
            if claim.evidence() >= 20.0 && first.is_none() {
                first = Some(number);
                assert!(seen.upper(0.05) <= 0.1 + 1e-9);
            } else if first.is_none() {
                assert!(seen.upper(0.05) > 0.1 - 1e-9);
            }
        }
        assert!(first.is_some_and(|number| number > 28) && claim.is_shown(0.05));
    }

    #[test]
    fn equal_observations_need_as_many_looks_as_failures_that_never_come() {
        // No difference at all: with one look, (1 - d)^n <= error would do, which is 29 drives; betting needs some more.
        let mut claim = Claim::new(Side::Below, 0.1);
        let needed = (1..).find(|_| {
            claim.add(0.0);
            claim.is_shown(0.05)
        });
        assert_eq!(needed, Some(42));
    }

    #[test]
    fn a_claim_at_the_end_of_the_range_cannot_be_shown() {
        let mut claim = Claim::new(Side::Above, -1.0);
        (0..1000).for_each(|_| claim.add(1.0));
        assert_eq!(claim.evidence(), 1.0);
        let mut claim = Claim::new(Side::Below, 0.2);
        (0..100_000).for_each(|_| claim.add(-1.0));
        assert!(claim.evidence() > MOST / 2.0);
        claim.add(1.0);
        assert!(claim.evidence().is_finite() && claim.is_shown(1e-100));
    }
}
