//! The derivative of a drive: how its largest cross-track error changes with the level of each perturbation at each frame, and its mean error with a
//! picture that it shows.
//!
//! Drives repeat bit for bit, so a drive can be put back to any of its frames and gone through backwards. At each frame four things are known
//! or found by differences: how the next state follows from this one and from the control, how the control follows from the state through camera,
//! perturbations and driver, and how it follows from the level. The chain rule, from the frame of the largest error back to the start, puts them
//! together (the adjoint method; Griewank and Walther, Evaluating Derivatives, 2008). So the influence of the levels of all frames costs about as
//! much as some ten drives, however many frames there are.
//!
//! A derivative says something as long as the drive is smooth in what is changed. Frames have 8 bits a channel, values are clipped, wheels turn
//! no faster than they can, and errors grow from frame to frame: so the derivative is compared with drives ([`windows`]), and what is reported
//! reaches back only as far as these agree.
//!
//! | module | subject |
//! |---|---|
//! | [`analysis`] | all of it, one after the other |
//! | [`rehearsal`] | a drive in this process, which can be put back to any of its frames |
//! | [`course`] | the level of every frame, and courses beside it |
//! | [`variant`] | a level a little lower and a little higher, by which it is differentiated |
//! | [`sweep`] | the way back through a drive |
//! | [`regions`] | where in the frames it comes from, by the exact gradient of the driver's network |
//! | [`span`] | the part of a drive in which the levels decide |
//! | [`windows`] | how far back a derivative holds, by drives |
//! | [`bends`] | what becomes of a drive if one angle of its road is changed, by drives |
//! | [`picture`] | how a drive changes with the picture that a perturbation shows |
//! | [`momentum`] | the steps of a picture in training |
//! | [`least`] | the least change of a course with which a drive leaves its lane |
//! | [`plot`] | pictures of all that |

pub mod analysis;
pub mod bends;
pub mod course;
pub mod least;
pub mod momentum;
pub mod picture;
pub mod plot;
pub mod regions;
pub mod rehearsal;
pub mod span;
pub mod sweep;
pub mod variant;
pub mod windows;
