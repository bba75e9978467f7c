//! What a run has used, for a tool that says so.

use pdk_record::manifest::ComponentRecord;

/// What a run has used.
#[derive(Debug, Clone)]
pub struct Used {
    /// The components, with their files.
    pub components: Vec<ComponentRecord>,
    /// What scenarios left to the machine, such as the engine of networks, and what it was.
    pub settled: Vec<(String, String)>,
}
