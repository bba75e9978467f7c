//! What every component has, whatever its kind.

use crate::config::Config;
use crate::describe::Description;
use crate::error::Result;

/// A component: it describes itself, and instances are made from checked parameters.
pub trait Component: Sized {
    /// Name, documentation and parameters.
    fn description() -> Description;

    /// Makes an instance. `config` has been checked against the description: every parameter has a value of the right
    /// type and range.
    ///
    /// # Errors
    /// Where the instance cannot be made: a file that cannot be read, values that do not go together.
    fn new(config: &Config) -> Result<Self>;
}
