//! The macros with which structures of calls and numbers are declared, so that the check of the layout sees all of them.

/// Declares structures that begin with their size.
macro_rules! sized {
    ($($(#[$meta:meta])* pub struct $name:ident {
        $($(#[$field_meta:meta])* pub $field:ident: $type:ty,)*
    })*) => {
        $(
            $(#[$meta])*
            #[repr(C)]
            #[derive(Clone, Copy)]
            pub struct $name {
                /// The number of bytes of this structure, at the side that made it.
                pub size: usize,
                $($(#[$field_meta])* pub $field: $type,)*
            }

            // SAFETY: `repr(C)` with its size first; the check of the layout sees to it that there is no padding. Numbers,
            // pointers and optional functions take zeros, and there is nothing else in these structures.
            unsafe impl crate::prefix::Prefix for $name {}

            const _: () = {
                /// What abi_stable compares in place of the structure: its name, and that it begins with its size. The rest may have
                /// another length in a library than here.
                #[repr(C)]
                #[derive(abi_stable::StableAbi)]
                #[allow(dead_code)]
                struct $name {
                    size: usize,
                }

                // SAFETY: it is the type itself.
                unsafe impl abi_stable::abi_stability::GetStaticEquivalent_ for self::$name {
                    type StaticEquivalent = self::$name;
                }

                // SAFETY: the structure crosses by pointer alone. Both sides read and write no more of it than its size says, and the
                // beginning that this layout describes never changes.
                unsafe impl abi_stable::StableAbi for self::$name {
                    type IsNonZeroType = abi_stable::reexports::False;
                    const LAYOUT: &'static abi_stable::type_layout::TypeLayout = <$name as abi_stable::StableAbi>::LAYOUT;
                }
            };
        )*

        /// The layouts of all of them.
        #[cfg(test)]
        pub(crate) fn layouts() -> Vec<crate::layout::Structure> {
            vec![$(crate::layout::structure!($name { size: usize, $($field: $type),* })),*]
        }
    };
}

/// Declares numbers that stand for something.
macro_rules! numbers {
    ($($(#[$meta:meta])* pub const $name:ident = $number:literal;)*) => {
        $($(#[$meta])* pub const $name: u64 = $number;)*

        /// All of them, by name.
        #[cfg(test)]
        pub(crate) const ALL: &[(&str, u64)] = &[$((stringify!($name), $number)),*];
    };
}

pub(crate) use {numbers, sized};
