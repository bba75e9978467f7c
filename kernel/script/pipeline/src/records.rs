//! The tables that pipelines write and read, as types for editors.

mod applied;
mod driving;
mod evaluation;
mod field;
mod road;
mod search;
mod statistics;

use pdk_lua::ApiRecord;

#[cfg(test)]
pub(crate) use self::driving::SESSION_REQUEST;
pub use self::road::ROAD_REQUEST;

/// All of them, in the order of the type definition file.
pub const RECORDS: [&ApiRecord; 37] = [
    &applied::COMPONENT,
    &applied::SCHEDULE,
    &applied::REGION,
    &applied::DURING,
    &applied::SELECTION,
    &applied::ATTENTION,
    &applied::APPLIED,
    &driving::FAILURE_CRITERIA,
    &driving::SCENARIO,
    &driving::SESSION_REQUEST,
    &driving::DRIVE_REQUEST,
    &driving::OUTCOME,
    &driving::MEASURES,
    &statistics::ESTIMATE,
    &statistics::PAIRED,
    &statistics::INDEPENDENT,
    &statistics::TRIAL,
    &statistics::FAILING_LEVEL,
    &statistics::BISECTION,
    &search::SEARCH_RANGE,
    &search::SEARCH_STRATEGY,
    &search::SEARCH_JUDGEMENT,
    &search::SEARCH_REQUEST,
    &search::SEARCH_RESULT,
    &road::ROAD_REQUEST,
    &road::ROAD,
    &evaluation::EVALUATE_REQUEST,
    &evaluation::EVALUATION,
    &evaluation::EVALUATION_ROW,
    &evaluation::EVALUATION_INTERVAL,
    &evaluation::EVALUATION_CHECK,
    &evaluation::EVALUATION_NUMBER_CHECK,
    &evaluation::EVALUATION_LEVEL,
    &evaluation::TASK_REQUEST,
    &evaluation::TASK,
    &evaluation::TASK_RESULT,
    &evaluation::TASK_TOTAL,
];
