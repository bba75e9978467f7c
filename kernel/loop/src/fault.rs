//! Why a scenario could not be driven to its end.

use pdk_sdk::error::{Error, ErrorKind};

/// Whose fault it is.
pub enum Fault {
    /// The simulator failed.
    Simulator(Error),
    /// Another component failed: the outcome of this scenario.
    Component(Error),
    /// pdk itself failed, or the machine: the end of the run.
    Kernel(Error),
}

/// Topics that were made and do not work any more: other processes see their memory too. Another time it may go better.
impl From<pdk_bus::Error> for Fault {
    fn from(error: pdk_bus::Error) -> Self {
        Fault::Component(Error::of(ErrorKind::Lost, format!("the topics of the scenario: {error}")))
    }
}
