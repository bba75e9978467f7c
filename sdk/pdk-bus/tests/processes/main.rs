//! Topics between processes: this test program starts itself again as the publisher or the tap.

// The helpers of a test may fail like the test itself.
#![allow(clippy::unwrap_used)]

mod killed;
mod peer;
mod topics;
