//! Overlay family.
