//! What is read first.

use crate::declare::fixed;
use crate::sized::Plugin;

fixed! {
    /// What a plugin exports. The version is where it is in every version of the interface.
    pub struct Header {
        /// The version of the interface that the plugin was built for.
        pub version: u64,
        /// The plugin.
        pub plugin: *const Plugin,
    }
}

// SAFETY: a header and what it points to are constants.
unsafe impl Sync for Header {}
