//! Who drives recorded scenarios again, and what they are held to: the same options for each verb that does.

use std::num::NonZeroUsize;
use std::time::Duration;

use pdk_sdk::error::{Error, Result};
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::{DEFAULT_MEMORY, DEFAULT_PATIENCE, Limits};

/// The options.
#[derive(clap::Args)]
pub struct Workers {
    /// How many scenarios are driven at the same time [default: one for each processor; one for a simulator that pdk does not
    /// start]
    #[arg(long, value_name = "N", conflicts_with = "pool")]
    workers: Option<NonZeroUsize>,
    /// A command that provides workers, in the place of this machine's (see docs/worker-protocol.md)
    #[arg(long, value_name = "COMMAND")]
    pool: Option<String>,
    /// How long one call of a component may take, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = DEFAULT_PATIENCE.as_secs_f64())]
    patience: f64,
    /// How much memory a process with components may take, in MiB
    #[arg(long, value_name = "MIB", default_value_t = DEFAULT_MEMORY, value_parser = clap::value_parser!(u64).range(1..))]
    memory: u64,
}

impl Workers {
    /// Where workers come from.
    pub fn pool(&self) -> Pool {
        match &self.pool {
            Some(command) => Pool::Command(command.clone()),
            None => self.workers.map_or(Pool::Usual, |workers| Pool::Here(workers.get())),
        }
    }

    /// What the processes with components are held to.
    ///
    /// # Errors
    /// If the time for a call is not one.
    pub fn limits(&self) -> Result<Limits> {
        let seconds = self.patience;
        let patience = Duration::try_from_secs_f64(seconds).ok().filter(|limit| !limit.is_zero());
        let patience = patience.ok_or_else(|| {
            Error::new(format!("--patience: {seconds} is not a positive number of seconds"))
        })?;
        Ok(Limits { patience, memory: self.memory })
    }
}
