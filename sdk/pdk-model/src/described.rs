//! Structures whose fields are listed once: the macro writes the structure, how it is recorded, and the table of its fields, from which the
//! types for editors and the tables in the documents are written.

use serde_json::Value;

/// A field of a structure that is recorded or that scripts see.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type in Luau; ends in `?` if it may be left out, and is empty if scripts do not see it.
    pub luau_type: &'static str,
    /// Its type in JSON, with its unit.
    pub json: &'static str,
    /// When a record has it.
    pub present: &'static str,
    /// What it is.
    pub doc: &'static str,
}

impl Field {
    /// A field of scripts alone.
    pub const fn of_scripts(name: &'static str, luau_type: &'static str, doc: &'static str) -> Self {
        Self { name, luau_type, json: "", present: "", doc }
    }
}

/// The fields as a table in Markdown, a row each.
pub fn markdown(fields: &[Field]) -> String {
    let row = |field: &Field| {
        let Field { name, json, present, doc, .. } = field;
        format!("| `{name}` | {json} | {present} | {doc} |\n")
    };
    let rows: String = fields.iter().map(row).collect();
    format!("| field | type | present | meaning |\n|---|---|---|---|\n{rows}")
}

/// How many fields several lists have that scripts see, for [`joined`].
pub const fn count(lists: &[&[Field]]) -> usize {
    let (mut count, mut list) = (0, 0);
    while list < lists.len() {
        let mut place = 0;
        while place < lists[list].len() {
            count += !lists[list][place].luau_type.is_empty() as usize;
            place += 1;
        }
        list += 1;
    }
    count
}

/// The fields of several lists that scripts see, as one list; `N` is their [`count`].
pub const fn joined<const N: usize>(lists: &[&[Field]]) -> [Field; N] {
    let mut all = [Field::of_scripts("", "", ""); N];
    let (mut count, mut list) = (0, 0);
    while list < lists.len() {
        let mut place = 0;
        while place < lists[list].len() {
            if !lists[list][place].luau_type.is_empty() {
                all[count] = lists[list][place];
                count += 1;
            }
            place += 1;
        }
        list += 1;
    }
    all
}

/// The fields of these names, in their order, for constants: a name that is not there is an error of the compiler.
pub const fn picked<const N: usize>(fields: &[Field], names: &[&str]) -> [Field; N] {
    let mut all = [Field::of_scripts("", "", ""); N];
    let mut count = 0;
    while count < N {
        let mut place = 0;
        while !equal(fields[place].name, names[count]) {
            place += 1;
        }
        all[count] = fields[place];
        count += 1;
    }
    all
}

const fn equal(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut place = 0;
    while place < one.len() && place < other.len() && one[place] == other[place] {
        place += 1;
    }
    place == one.len() && place == other.len()
}

/// A field as JSON; null if it has no value.
pub fn value(value: &impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// Writes a structure, and from the same list `FIELDS`, the table of its fields, and `values`, which gives their values in this order. A
/// row is `name: type, Luau "its type in Luau", JSON "its type in JSON"`, and then, if a record may lack it, when it has it and the
/// condition under which it is left out.
macro_rules! described {
    ($(#[$outer:meta])* pub struct $Structure:ident {
        $($(#[doc = $doc:literal])+ $name:ident: $type:ty, Luau $luau:literal, JSON $json:literal
            $(, $present:literal unless $empty:literal)?;)*
    }) => {
        $(#[$outer])*
        pub struct $Structure {
            $($(#[doc = $doc])+ $(#[serde(default, skip_serializing_if = $empty)])? pub $name: $type,)*
        }

        impl $Structure {
            /// Its fields, in the order in which they are recorded.
            pub const FIELDS: &'static [$crate::described::Field] = &[$($crate::described::Field {
                name: stringify!($name),
                luau_type: $luau,
                json: $json,
                present: $crate::described::described!(@present $($present)?),
                doc: concat!($($doc),+).trim_ascii(),
            },)*];

            /// The values of its fields in their order; null for those that have none.
            pub fn values(&self) -> Vec<(&'static $crate::described::Field, serde_json::Value)> {
                let values = [$($crate::described::value(&self.$name),)*];
                Self::FIELDS.iter().zip(values).collect()
            }
        }
    };
    (@present) => { "always" };
    (@present $present:literal) => { $present };
}
pub(crate) use described;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_scripts_do_not_see_is_left_out_of_their_lists() {
        const HIDDEN: Field = Field::of_scripts("hidden", "", "x");
        const SEEN: Field = Field::of_scripts("seen", "number", "x");
        const LISTS: &[&[Field]] = &[&[SEEN, HIDDEN], &[], &[SEEN]];
        assert_eq!(joined::<{ count(LISTS) }>(LISTS), [SEEN, SEEN]);
        assert_eq!(picked(&[SEEN, HIDDEN], &["hidden"]), [HIDDEN]);
    }
}
