//! Perturbations of the stream family: frames that come late, twice, in part or not at all.
//!
//! Nothing is kept between calls. What happened to a frame is drawn from its number, so that each later frame knows it, and what it
//! looked like is in the history that pdk hands over.

mod bit_errors;
mod blank_frames;
mod codec;
mod delayed_frames;
mod frozen_frames;
mod ghosting;
mod lost_blocks;
mod partial_frames;
mod reordered_frames;

#[cfg(test)]
#[path = "../../allocations.rs"]
mod allocations;
#[cfg(test)]
mod test_sequence;

pdk_sdk::export! {
    perturbations: [
        bit_errors::BitErrors,
        blank_frames::BlankFrames,
        delayed_frames::DelayedFrames,
        frozen_frames::FrozenFrames,
        ghosting::Ghosting,
        lost_blocks::LostBlocks,
        partial_frames::PartialFrames,
        reordered_frames::ReorderedFrames,
    ]
}
