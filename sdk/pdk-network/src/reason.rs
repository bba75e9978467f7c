//! What is known about a network, and why.

use crate::described::Described;

/// The name under which a driver gives, among what it says about itself for the record, the conventions that it assumes because nothing
/// says otherwise. A run reports them at its start.
pub const ASSUMED: &str = "assumed";

/// What is known about something, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reason {
    /// What it is about, such as `scale`.
    pub subject: String,
    /// What is known.
    pub value: String,
    /// Why.
    pub why: String,
    /// Whether it is a convention that nothing confirms.
    pub assumed: bool,
}

/// What of these reasons is a convention, in a sentence.
pub fn assumptions(reasons: &[Reason]) -> Option<String> {
    let assumed: Vec<String> = reasons
        .iter()
        .filter(|reason| reason.assumed)
        .map(|Reason { subject, value, .. }| format!("{subject} {value}"))
        .collect();
    (!assumed.is_empty()).then(|| assumed.join(", "))
}

/// Adds a reason.
pub(crate) fn because(
    reasons: &mut Vec<Reason>,
    subject: &str,
    value: impl Into<String>,
    why: impl Into<String>,
    assumed: bool,
) {
    reasons.push(Reason { subject: subject.to_owned(), value: value.into(), why: why.into(), assumed });
}

/// Where a field was given, as a reason.
pub(crate) fn given(described: &Described, field: &str) -> Option<String> {
    described.given.get(field).map(|(_, place)| format!("{place} says so"))
}
