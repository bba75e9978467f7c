//! Looks at one scenario after the other, in order, and says when enough has been seen. It knows nothing of drives, so a program that
//! has the outcomes can make the decision again.

use pdk_statistics::anytime::{Claim, Sequence, Side};
use pdk_statistics::neighbours::Neighbours;
use serde::{Deserialize, Serialize};

use crate::loaded::Loaded;
use crate::repeats::{Counted, Drove, Luck};
use crate::requirement::{By, Kind, Requirement};
use crate::series::Series;
use crate::step::Step;
use crate::suite::{Suite, Undecided};

/// What came of a scenario of a suite.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// The drives of the old driver; none if only the new one drove.
    pub old: Option<Drove>,
    /// The drives of the new driver.
    pub new: Drove,
    /// The measure of a requirement about one in each drive of the new driver; none if the drive did not come to its end.
    pub measured: Vec<Option<f64>>,
}

/// What is known about a requirement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// It was shown to be met.
    Met,
    /// It was shown not to be met.
    NotMet,
    /// Neither was shown.
    Undecided,
}

impl State {
    /// As tables have it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::NotMet => "not met",
            Self::Undecided => "undecided",
        }
    }
}

/// What came of a requirement, with the figures by which it was decided.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What it is called.
    pub requirement: String,
    /// What is known.
    pub state: State,
    /// What was found, in a clause.
    pub said: String,
    /// How many scenarios say something about it.
    pub scenarios: usize,
    /// In how many of them the old driver failed; none if the new one alone was driven in them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub old_failed: Option<usize>,
    /// In how many of them the new driver failed.
    pub new_failed: usize,
    /// The figures of a test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<Figures>,
}

/// The figures of a test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// The failure rate of the new driver less that of the old one.
    pub difference: f64,
    /// It is above this, with an error of at most `alpha`.
    pub low: f64,
    /// It is below this, with an error of at most `alpha`.
    pub high: f64,
    /// By how much it may be above 0.
    pub tolerated: f64,
    /// The share of the suite's alpha that this test has.
    pub alpha: f64,
    /// The correlation between the differences of blocks of recordings that follow each other; none for roads, and for few blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neighbours: Option<f64>,
}

/// What a gate decides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Whether the new driver passed.
    pub passed: bool,
    /// Every requirement, and each group of one that goes by groups.
    pub findings: Vec<Finding>,
    /// How far drives of the same scenario disagree; none if no scenario was repeated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub luck: Option<Luck>,
}

/// A requirement, or a group of one, while scenarios are looked at.
struct Check {
    title: String,
    rule: Rule,
    scenarios: usize,
    old_failed: Option<usize>,
    new_failed: usize,
    /// None as long as it is open.
    state: Option<State>,
}

enum Rule {
    Test(Box<Test>),
    NoNewFailure { fixed: usize, drawn: usize, found: usize },
    Passes { of: usize, allowed: usize },
    Measure { place: usize, below: f64, above: f64, need: usize, of: usize, good: usize, drawn: &'static str },
}

struct Test {
    group: Group,
    tolerated: f64,
    alpha: f64,
    not_worse: Claim,
    worse: Claim,
    seen: Sequence,
    neighbours: Neighbours,
}

/// Which drawn scenarios belong to a test.
#[derive(Debug, Clone, PartialEq)]
enum Group {
    All,
    Perturbation(String),
    Level(f64),
}

impl Group {
    fn has(&self, step: &Step) -> bool {
        match self {
            Self::All => true,
            Self::Perturbation(name) => step.perturbation.as_ref() == Some(name),
            Self::Level(level) => step.level == Some(*level),
        }
    }
}

/// Looks at scenarios in their order.
pub struct Judge {
    checks: Vec<Check>,
    undecided: Undecided,
    counted: Counted,
}

impl Judge {
    /// Nothing has been seen yet.
    pub fn new(loaded: &Loaded) -> Self {
        let suite = &loaded.suite;
        let mut checks = Vec::new();
        for (place, requirement) in suite.required().iter().enumerate() {
            checks.extend(rules(loaded, place, requirement).into_iter().map(|(title, rule)| Check {
                title,
                rule,
                scenarios: 0,
                old_failed: None,
                new_failed: 0,
                state: None,
            }));
        }
        // Bonferroni: the tests share the probability of an error.
        let tests = checks.iter().filter(|check| matches!(check.rule, Rule::Test(_))).count().max(1);
        for check in &mut checks {
            if let Rule::Test(test) = &mut check.rule {
                test.alpha = suite.test.alpha / tests as f64;
            }
        }
        Self { checks, undecided: suite.test.undecided, counted: Counted::default() }
    }

    /// Looks at the next scenario.
    pub fn look(&mut self, step: &Step, seen: &Seen) {
        if let Some(old) = &seen.old {
            self.counted.look(step, old, &seen.new);
        }
        self.checks.iter_mut().filter(|check| check.state.is_none()).for_each(|check| check.look(step, seen));
    }

    /// Whether the decision does not depend on further scenarios: every requirement is decided, or one is not met.
    pub fn is_over(&self) -> bool {
        self.checks.iter().any(|check| check.state == Some(State::NotMet))
            || self.checks.iter().all(|check| check.state.is_some())
    }

    /// The decision by what has been seen.
    pub fn decide(&self) -> Decision {
        let findings: Vec<Finding> = self.checks.iter().map(Check::finding).collect();
        let passed = findings.iter().all(|finding| match finding.state {
            State::Met => true,
            State::NotMet => false,
            State::Undecided => self.undecided == Undecided::Passed,
        });
        Decision { passed, findings, luck: self.counted.luck() }
    }
}

/// What a requirement comes to: one rule, or one for each group.
fn rules(loaded: &Loaded, place: usize, requirement: &Requirement) -> Vec<(String, Rule)> {
    let (suite, drawn) = (&loaded.suite, loaded.pairs());
    let title = requirement.title(suite.drawn());
    let rule = match &requirement.kind {
        Kind::NotWorse { by, tolerated } => {
            let tolerated = tolerated.unwrap_or(suite.test.tolerated);
            let test = |group: Group| {
                Rule::Test(Box::new(Test {
                    group,
                    tolerated,
                    alpha: suite.test.alpha,
                    not_worse: Claim::new(Side::Below, tolerated),
                    worse: Claim::new(Side::Above, 0.0),
                    seen: Sequence::default(),
                    neighbours: Neighbours::default(),
                }))
            };
            let groups: Vec<(String, Group)> = match by {
                By::Overall => return vec![(title, test(Group::All))],
                By::Perturbation => suite
                    .perturbations
                    .iter()
                    .map(|name| (name.clone(), Group::Perturbation(name.clone())))
                    .collect(),
                By::Level => levels(suite)
                    .into_iter()
                    .map(|level| (format!("level {level}"), Group::Level(level)))
                    .collect(),
            };
            return groups
                .into_iter()
                .map(|(name, group)| (format!("{title}: {name}"), test(group)))
                .collect();
        }
        Kind::NoNewFailure { pairs } => Rule::NoNewFailure {
            fixed: suite.scenarios.len(),
            drawn: pairs.unwrap_or(drawn).min(drawn),
            found: 0,
        },
        Kind::Passes { allowed } => Rule::Passes { of: suite.scenarios.len(), allowed: *allowed },
        Kind::Measure { below, above, on: [need, of], .. } => Rule::Measure {
            place,
            below: below.unwrap_or(f64::INFINITY),
            above: above.unwrap_or(f64::NEG_INFINITY),
            need: *need,
            of: *of,
            good: 0,
            drawn: suite.drawn(),
        },
    };
    vec![(title, rule)]
}

/// The levels that drawn scenarios have, in order.
fn levels(suite: &Suite) -> Vec<f64> {
    let applied = suite.perturbations.iter().flat_map(|name| suite.levels_of(name).unwrap_or_default());
    let mut levels: Vec<f64> =
        applied.filter_map(|applied| serde_json::to_value(&applied).ok()?.get("level")?.as_f64()).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    levels
}

impl Check {
    fn look(&mut self, step: &Step, seen: &Seen) {
        let (old, new) = (seen.old.as_ref().is_some_and(Drove::has_failed), seen.new.has_failed());
        let counts = match &self.rule {
            Rule::Test(test) => step.series == Series::Drawn && test.group.has(step),
            Rule::NoNewFailure { drawn, .. } => match step.series {
                Series::Fixed => true,
                Series::Drawn => step.number < *drawn,
                Series::Requirement(_) => false,
            },
            Rule::Passes { .. } => step.series == Series::Fixed,
            Rule::Measure { place, .. } => step.series == Series::Requirement(*place),
        };
        if !counts {
            return;
        }
        self.scenarios += 1;
        if seen.old.is_some() {
            *self.old_failed.get_or_insert(0) += usize::from(old);
        }
        self.new_failed += usize::from(new);
        self.state = match &mut self.rule {
            Rule::Test(test) => test.look(f64::from(u8::from(new)) - f64::from(u8::from(old)), step.place),
            Rule::NoNewFailure { fixed, drawn, found } => {
                // A verdict that is not stable may be luck.
                let stable = seen.new.is_stable() && seen.old.as_ref().is_none_or(Drove::is_stable);
                *found += usize::from(new && !old && stable);
                if *found > 0 {
                    Some(State::NotMet)
                } else {
                    (self.scenarios == *fixed + *drawn).then_some(State::Met)
                }
            }
            Rule::Passes { of, allowed } => {
                if self.new_failed > *allowed {
                    Some(State::NotMet)
                } else {
                    (self.scenarios == *of).then_some(State::Met)
                }
            }
            Rule::Measure { below, above, need, of, good, .. } => {
                let within = |value: &f64| *value < *below && *value > *above;
                // The majority of the drives decides, and a tie counts as failed. A drive that was not measured meets no limit.
                let met = seen.measured.iter().flatten().filter(|value| within(value)).count();
                *good += usize::from(2 * met > seen.measured.len());
                let left = *of - self.scenarios;
                if *good >= *need {
                    Some(State::Met)
                } else {
                    (*good + left < *need).then_some(State::NotMet)
                }
            }
        };
    }

    fn finding(&self) -> Finding {
        let Self { title, scenarios, old_failed, new_failed, .. } = self;
        let state = self.state.unwrap_or(State::Undecided);
        let (said, test) = match &self.rule {
            Rule::Test(test) => {
                let figures = test.figures();
                (test.said(state, &figures), Some(figures))
            }
            Rule::NoNewFailure { found: 0, .. } => (format!("none in {scenarios} scenarios"), None),
            Rule::NoNewFailure { .. } => (format!("one in {scenarios} scenarios"), None),
            Rule::Passes { .. } => (format!("fails {new_failed} of {scenarios}"), None),
            Rule::Measure { good, need, drawn, .. } => {
                (format!("{good} of {scenarios} {drawn}, {need} needed"), None)
            }
        };
        Finding {
            requirement: title.clone(),
            state,
            said,
            scenarios: *scenarios,
            old_failed: *old_failed,
            new_failed: *new_failed,
            test,
        }
    }
}

impl Test {
    fn look(&mut self, difference: f64, place: Option<usize>) -> Option<State> {
        self.seen.add(difference);
        self.not_worse.add(difference);
        self.worse.add(difference);
        if let Some(place) = place {
            self.neighbours.add(place, difference);
        }
        // The bounds take blocks for independent draws, so nothing is shown while neighbours resemble each other.
        self.shown().filter(|_| !self.neighbours.resemble())
    }

    fn shown(&self) -> Option<State> {
        match self.worse.is_shown(self.alpha) {
            true => Some(State::NotMet),
            false => self.not_worse.is_shown(self.alpha).then_some(State::Met),
        }
    }

    fn figures(&self) -> Figures {
        let Self { seen, tolerated, alpha, .. } = self;
        Figures {
            difference: seen.mean().unwrap_or_default(),
            low: seen.lower(*alpha),
            high: seen.upper(*alpha),
            tolerated: *tolerated,
            alpha: *alpha,
            neighbours: self.neighbours.correlation(),
        }
    }

    fn said(&self, state: State, figures: &Figures) -> String {
        match state {
            State::Met => format!("not worse by more than {}", figures.tolerated),
            State::NotMet => "worse".to_owned(),
            State::Undecided if self.shown().is_some() => format!(
                "neighbouring blocks resemble each other (correlation {:+.2}), so `block` is too small",
                figures.neighbours.unwrap_or_default()
            ),
            State::Undecided => format!("worse by {:+.2} to {:+.2}", figures.low, figures.high),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{RECORDED, SMALL, open_recorded, suite};
    use crate::loaded::Loaded;
    use crate::step::step;

    const BOTH: [bool; 2] = [true, true];
    const NEITHER: [bool; 2] = [false, false];
    const NEW: [bool; 2] = [false, true];

    /// Looks at drawn scenarios that ended like this; returns the decision and how many were looked at.
    fn judge(loaded: &Loaded, mut failed: impl FnMut(&Step) -> [bool; 2]) -> (Decision, usize) {
        let mut judge = Judge::new(loaded);
        for (looked, step) in crate::step::steps(loaded).enumerate() {
            if judge.is_over() {
                return (judge.decide(), looked);
            }
            let step = step.unwrap();
            let [old, new] = failed(&step);
            let drove = |failed: bool| Drove(vec![failed]);
            let old = step.is_pair().then(|| drove(old));
            judge.look(&step, &Seen { old, new: drove(new), measured: vec![(!new).then_some(0.3)] });
        }
        (judge.decide(), loaded.pairs())
    }

    #[test]
    fn equal_drivers_pass_and_a_worse_one_fails_before_the_budget() {
        let loaded = suite(SMALL).unwrap();
        let (decision, looked) = judge(&loaded, |step| if step.number % 3 == 0 { BOTH } else { NEITHER });
        assert!(decision.passed && looked < 30, "{looked} {decision:?}");
        let Finding { state, test: Some(figures), .. } = &decision.findings[0] else {
            panic!("{decision:?}")
        };
        assert_eq!((*state, figures.difference, figures.tolerated), (State::Met, 0.0, 0.2));
        assert!(figures.high < 0.2 && figures.low < 0.0);
        let (decision, looked) = judge(&loaded, |step| if step.number % 2 == 0 { NEW } else { NEITHER });
        assert!(!decision.passed && looked < 40, "{looked} {decision:?}");
        assert!(decision.findings[0].said == "worse" && decision.findings[0].test.unwrap().low >= 0.0);
    }

    #[test]
    fn what_is_not_shown_counts_as_the_suite_says() {
        let turns = |step: &Step| [step.number % 4 == 1, step.number % 4 == 3];
        for (undecided, passed) in [("failed", false), ("passed", true)] {
            let text = SMALL.replace("pairs = 50", &format!("pairs = 12\nundecided = \"{undecided}\""));
            let (decision, looked) = judge(&suite(&text).unwrap(), turns);
            assert_eq!((decision.passed, decision.findings[0].state, looked), (passed, State::Undecided, 12));
        }
    }

    #[test]
    fn tests_share_alpha_and_each_sees_its_own_scenarios() {
        let text = format!(
            "{SMALL}\n[[require]]\nkind = \"not_worse\"\nby = \"perturbation\"\n[[require]]\nkind = \"not_worse\"\nby = \"level\""
        );
        let loaded = suite(&text.replace("pairs = 50", "pairs = 400")).unwrap();
        let (decision, _) =
            judge(&loaded, |step| if step.perturbation.as_deref() == Some("rain@3") { NEW } else { NEITHER });
        let titles: Vec<&str> =
            decision.findings.iter().map(|finding| finding.requirement.as_str()).collect();
        let all = [
            "not worse: fog",
            "not worse: rain@3",
            "not worse: level 1",
            "not worse: level 2",
            "not worse: level 3",
        ];
        assert_eq!(titles, all);
        assert!(decision.findings.iter().all(|finding| finding.test.unwrap().alpha == 0.05 / 5.0));
        assert_eq!(decision.findings[1].state, State::NotMet);
        assert_eq!(decision.findings[0].new_failed, 0);
        assert!(!decision.passed);
    }

    #[test]
    fn counts_are_decided_as_soon_as_they_cannot_change() {
        let measure = "[[require]]\nkind = \"measure\"\nmeasure = \"time\"\nbelow = 0.5\non = [2, 3]";
        let with = |text: &str| suite(&format!("{SMALL}\n{text}")).unwrap();
        let (decision, looked) = judge(&with(measure), |_| NEITHER);
        assert!(decision.passed && looked == 2 && decision.findings[0].said == "2 of 2 roads, 2 needed");
        let (decision, looked) = judge(&with(measure), |_| NEW);
        assert!(!decision.passed && looked == 2);
        let nothing_new = "[[require]]\nkind = \"no_new_failure\"\npairs = 9";
        let (decision, looked) = judge(&with(nothing_new), |_| BOTH);
        assert!(decision.passed && looked == 9, "{decision:?}");
        let (decision, looked) = judge(&with(nothing_new), |step| if step.number == 4 { NEW } else { BOTH });
        assert!(!decision.passed && looked == 5);
        let (decision, _) = judge(&with(nothing_new), |step| if step.number == 9 { NEW } else { BOTH });
        assert!(decision.passed);
    }

    #[test]
    fn the_measures_of_repeated_drives_meet_a_limit_if_most_of_them_do() {
        let met = |limits: &str, measured: &[Option<f64>]| {
            let measure =
                format!("[[require]]\nkind = \"measure\"\nmeasure = \"time\"\n{limits}\non = [1, 1]");
            let loaded = suite(&format!("{SMALL}\n{measure}")).unwrap();
            let mut judge = Judge::new(&loaded);
            let new = Drove(measured.iter().map(Option::is_none).collect());
            let step = step(&loaded, Series::Requirement(0), 0).unwrap();
            judge.look(&step, &Seen { old: None, new, measured: measured.to_vec() });
            judge.decide().passed
        };
        // A drive that was not measured counts as the worst, whichever side the limit is on.
        for (drives, passed) in [
            (&[Some(0.2)][..], true),
            (&[None], false),
            (&[Some(0.2), None], false),
            (&[Some(0.2), Some(0.9)], false),
            (&[Some(0.2), None, Some(0.3)], true),
            (&[Some(0.2), None, None], false),
            (&[Some(0.2), Some(0.9), Some(0.3)], true),
        ] {
            assert_eq!(met("below = 0.5", drives), passed, "{drives:?}");
            let above: Vec<_> = drives.iter().map(|drive| drive.map(|value| 1.0 - value)).collect();
            assert_eq!(met("above = 0.5", &above), passed, "{above:?}");
        }
        assert!(!met("below = 0.5\nabove = 0.1", &[Some(0.0), Some(0.9), Some(0.3)]));
    }

    #[test]
    fn a_requirement_sees_no_scenario_of_another_one() {
        let loaded = suite(SMALL).unwrap();
        let mut judge = Judge::new(&loaded);
        let mut other = step(&loaded, Series::Drawn, 0).unwrap();
        other.series = Series::Requirement(7);
        judge.look(&other, &Seen { old: None, new: Drove(vec![true]), measured: vec![None] });
        assert_eq!(judge.decide().findings[0].scenarios, 0);
    }

    #[test]
    fn blocks_that_resemble_their_neighbours_decide_nothing() {
        let mut loaded = suite(RECORDED).unwrap();
        loaded.open(&Default::default(), &mut open_recorded(4000, &[0])).unwrap();
        let place = |step: &Step| step.place.unwrap();
        // Each driver fails an eighth of the blocks, in runs of five or by turns.
        const OLD: [bool; 2] = [true, false];
        let failed = |number: usize| match number % 8 {
            0 => NEW,
            4 => OLD,
            _ => NEITHER,
        };
        let (in_runs, looked) = judge(&loaded, |step| failed(place(step) / 5));
        let finding = &in_runs.findings[0];
        assert_eq!((finding.state, looked, in_runs.passed), (State::Undecided, 200, false));
        assert!(
            finding.said.starts_with("neighbouring blocks resemble each other (correlation +0."),
            "{}",
            finding.said
        );
        let (by_turns, looked) = judge(&loaded, |step| failed(place(step)));
        assert!(by_turns.passed && looked < 200, "{looked} {by_turns:?}");
        assert!(by_turns.findings[0].test.unwrap().neighbours.is_none_or(|correlation| correlation < 0.0));
    }

    #[test]
    fn a_failure_that_is_not_stable_is_not_a_new_one() {
        let loaded = suite(&format!("{SMALL}\n[[require]]\nkind = \"no_new_failure\"\npairs = 3")).unwrap();
        let found = |new: [bool; 5]| {
            let mut judge = Judge::new(&loaded);
            for step in crate::step::steps(&loaded).take(3) {
                let seen =
                    Seen { old: Some(Drove(vec![false; 2])), new: Drove(new.to_vec()), measured: vec![None] };
                judge.look(&step.unwrap(), &seen);
            }
            judge.decide()
        };
        let lucky = found([true, false, true, false, true]);
        assert!(lucky.passed && lucky.findings[0].new_failed == 3, "{lucky:?}");
        assert!(!found([true, false, true, true, true]).passed);
        let luck = lucky.luck.unwrap();
        assert_eq!((luck.scenarios, luck.unstable, luck.new.value, luck.old.value), (3, 3, 1.0, 0.0));
    }
}
