//! Searching for failures.

use pdk_lua::ApiRecord;

use super::field::field;

pub(super) const SEARCH_RANGE: ApiRecord = ApiRecord {
    name: "SearchRange",
    doc: "The values that a variable of a search may take: one of the fields.",
    fields: &[
        field("integer", "{ number }?", "The smallest and the largest of whole numbers."),
        field("real", "{ number }?", "The smallest and the largest of all numbers."),
        field(
            "ordinal",
            "{ any }?",
            "A list in which neighbours are alike, such as perturbations ranked by their effect.",
        ),
        field("choice", "{ any }?", "A list whose order has no meaning."),
    ],
};

pub(super) const SEARCH_STRATEGY: ApiRecord = ApiRecord {
    name: "SearchStrategy",
    doc: "A strategy of the pipeline's own.",
    fields: &[
        field(
            "start",
            "((problem: { variables: { any }, objectives: { string }, evaluations: number? }, random: Random) -> ())?",
            "Called once. A variable has `name` and `type`, and `min` and `max` or `values`. Everything that is drawn comes from \
             `random`.",
        ),
        field(
            "ask",
            "(n: number) -> { { [string]: any } }",
            "The next candidates, at most `n`, each a table with a value for each variable. None if the search is over.",
        ),
        field(
            "tell",
            "((results: { { id: number, values: { [string]: any }, objectives: { number }, violation: number, critical: boolean, \
             failure: string? } }) -> ())?",
            "How the candidates of the last `ask` did: all of them, in their order. Objectives are those of the search in the order \
             of their names, and smaller is better; there are none if a candidate could not be evaluated.",
        ),
        field("batch", "number?", "How many candidates it is asked for at once. The default is 16."),
    ],
};

pub(super) const SEARCH_JUDGEMENT: ApiRecord = ApiRecord {
    name: "SearchJudgement",
    doc: "The result of a candidate.",
    fields: &[
        field(
            "objectives",
            "{ [string]: number }?",
            "A value for each objective. For a scenario, those that are left out are fields of its outcome, or `time_to_failure` (the \
             share of the road that was left) or `criticality` (negative where the driver failed, the less the earlier).",
        ),
        field(
            "critical",
            "boolean?",
            "Whether it shows what is searched for. The default for a scenario is whether the driver failed.",
        ),
        field(
            "violations",
            "{ number }?",
            "For each constraint that only the drive shows, by how much it is violated; 0 or less if it holds.",
        ),
    ],
};

pub(super) const SEARCH_REQUEST: ApiRecord = ApiRecord {
    name: "SearchRequest",
    doc: "What `pdk.search` takes.",
    fields: &[
        field("space", "{ [string]: SearchRange }", "The variables."),
        field(
            "constraints",
            "{ ((values: { [string]: any }) -> number) | { weights: { [string]: number }, at_most: number } }?",
            "What has to hold for a candidate to be evaluated: functions that return at most 0, and sums of weights times values \
             that are at most a number. The value of an ordinal is its place in its list, from 0.",
        ),
        field(
            "objectives",
            "{ [string]: \"minimise\" | \"maximise\" }",
            "The objectives. With several, the result is the set of candidates that no other candidate dominates.",
        ),
        field("strategy", "string | Component | SearchStrategy", "Who proposes: see `pdk list search`."),
        field(
            "evaluate",
            "(values: { [string]: any }) -> Scenario | SearchJudgement",
            "Makes a scenario of the values of a candidate, or evaluates it by itself: then what it returns has `objectives`.",
        ),
        field(
            "outcome",
            "((outcome: Outcome, values: { [string]: any }) -> SearchJudgement)?",
            "Judges the outcome of a scenario. Not called if a component failed.",
        ),
        field(
            "stop",
            "{ evaluations: number?, seconds: number?, hypervolume: number? }",
            "When to stop, whichever comes first: after this many different candidates, after this much time, or when the best \
             compromises dominate such a volume.",
        ),
        field(
            "reference",
            "{ [string]: number }?",
            "The worst value of each objective that counts for the hypervolume.",
        ),
        field("name", "string?", "The name of the files in the record. The default is `search`."),
        field("seed", "number?", "The seed of what the strategy draws. The default is the run's seed."),
        field("simulator", "(string | Component)?", "The simulator of the scenarios."),
        field("driver", "(string | Component)?", "The driver under test."),
        field("duration", "number?", "The time limit of a scenario in seconds of simulation time."),
        field("failure", "FailureCriteria?", "As in `DriveRequest`."),
        field("images_every", "number?", "As in `DriveRequest`."),
        field("mode", "(\"lockstep\" | \"realtime\")?", "As in `DriveRequest`."),
    ],
};

pub(super) const SEARCH_RESULT: ApiRecord = ApiRecord {
    name: "SearchResult",
    doc: "What `pdk.search` returns. Candidates go by their numbers, from 0.",
    fields: &[
        field("name", "string", "What the files in the record are called."),
        field(
            "stopped",
            "\"evaluations\" | \"seconds\" | \"hypervolume\" | \"strategy\" | \"exhausted\" | \"nothing new\"",
            "Why it ended: a limit was reached, the strategy proposed no more, every candidate was evaluated, or ten thousand in a \
             row were known.",
        ),
        field("evaluations", "number", "How many different candidates were evaluated."),
        field("proposed", "number", "How many were proposed."),
        field(
            "duplicates",
            "number",
            "How many were the same as an earlier one, and answered with its result.",
        ),
        field("failures", "number", "How many could not be evaluated."),
        field("critical", "number", "How many different candidates are critical."),
        field(
            "first_critical",
            "number?",
            "How many different candidates were evaluated up to the first critical one; none if there is none.",
        ),
        field(
            "distinct_failures",
            "{ number }",
            "Critical candidates that differ by more than a tenth of the ranges.",
        ),
        field("front", "{ number }", "The candidates that no other is better than."),
        field(
            "tests",
            "{ { number: number, values: { [string]: any }, objectives: { [string]: number }?, violation: number?, \
             critical: boolean?, same_as: number?, failure: string?, cause: string?, verdict: string?, \
             scenario: string? } }",
            "All candidates.",
        ),
        field(
            "tree",
            "{ nodes: { any }, critical_regions: { { region: string, evaluations: number, critical: number, share: number } } }?",
            "The decision tree over all evaluations, and the regions in which most are critical, in words.",
        ),
        field(
            "convergence",
            "{ { evaluations: number, hypervolume: number?, critical: number, distinct_failures: number } }",
            "What was reached after how many evaluations. If there is no `reference`, hypervolumes are those up to the worst value \
             of each objective in this search.",
        ),
        field(
            "[string]",
            "any",
            "What was asked for: space, objectives, strategy, seed, `hypervolume_reference`.",
        ),
    ],
};
