//! `pdk worker`: does jobs for a session.

use pdk_loop::loop_process;
use pdk_lua::LuaScripts;
use pdk_sdk::error::Result;
use pdk_session::worker;

/// Arguments of `pdk worker`
#[derive(clap::Args)]
pub struct Arguments {
    /// Call components in this very process, for a worker that looks after it
    #[arg(long, hide = true)]
    components: bool,
}

/// Does jobs until there are no more.
pub fn run(arguments: &Arguments) -> Result<()> {
    match arguments.components {
        true => loop_process::run(|search| Box::new(LuaScripts::new(search))),
        false => worker::run(),
    }
}
