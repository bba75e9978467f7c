//! What every component has, whatever its kind.

use crate::config::Config;
use crate::describe::Description;
use crate::error::Result;
use crate::input_files::InputFiles;

/// A component: it describes itself, and instances are made from checked parameters.
pub trait Component: Sized {
    /// Name, documentation and parameters.
    fn description() -> Description;

    /// Makes an instance. `config` has been checked against the description: every parameter has a value of the right
    /// type and range.
    ///
    /// # Errors
    /// If the instance cannot be made: a file that cannot be read, values that do not go together.
    fn new(config: &Config) -> Result<Self>;

    /// The files that an instance with this configuration reads, as far as they are known beforehand. Files that a parameter names
    /// need not be listed. The record of a run holds their hashes, and a run is continued only if they are the same.
    ///
    /// # Errors
    /// If a folder cannot be listed. What [`new`](Self::new) would refuse is better left out here.
    fn input_files(_config: &Config) -> Result<Vec<InputFiles>> {
        Ok(Vec::new())
    }
}
