//! The macros with which structures and numbers are declared, so that the check of the layout sees all of them.

/// Declares structures that never change.
macro_rules! fixed {
    ($($(#[$meta:meta])* pub struct $name:ident {
        $($(#[$field_meta:meta])* pub $field:ident: $type:ty,)*
    })*) => {
        $(
            $(#[$meta])*
            #[repr(C)]
            #[derive(Clone, Copy)]
            pub struct $name {
                $($(#[$field_meta])* pub $field: $type,)*
            }
        )*

    };
}

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
        )*

    };
}

/// Declares numbers that stand for something.
macro_rules! numbers {
    ($($(#[$meta:meta])* pub const $name:ident = $number:literal;)*) => {
        $($(#[$meta])* pub const $name: u64 = $number;)*

    };
}

pub(crate) use {fixed, numbers, sized};
