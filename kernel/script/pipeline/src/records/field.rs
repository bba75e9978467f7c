//! A field of a table, in short.

use pdk_lua::ApiField;

/// A field that scripts write or read.
pub(super) const fn field(name: &'static str, luau_type: &'static str, doc: &'static str) -> ApiField {
    ApiField::of_scripts(name, luau_type, doc)
}
