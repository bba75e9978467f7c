//! Components: found, loaded, described, and made.
//!
//! | module | subject |
//! |---|---|
//! | [`installation`] | where the parts of pdk itself lie |
//! | [`product`] | what the product consists of besides the kernel |
//! | [`search_path`] | where components are looked for |
//! | [`registry`] | finds components and makes instances of them; [`loader`] loads plugins, `door` opens their libraries and proves that they fit, `reading` reads what they say of themselves |
//! | [`held`] | an instance whose every call is noted |
//! | [`inspection`] | opens libraries in a process that dies afterwards, before they are opened where they are needed; [`elf`] looks at the file |
//! | [`catalog`] | what there is, as plain data that can be sent to another process |

pub mod catalog;
mod description;
mod door;
pub mod elf;
pub mod hash;
pub mod held;
pub mod inspection;
pub mod installation;
pub mod loader;
pub mod product;
mod reading;
pub mod registry;
pub mod scales;
pub mod search_path;

pub use description::check as check_description;
