//! The embedded simulator and its classical driver.
