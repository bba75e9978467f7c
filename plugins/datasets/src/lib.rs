//! Readers of recorded datasets.
