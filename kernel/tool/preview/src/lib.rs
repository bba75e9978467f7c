//! What perturbations look like, and what they say of themselves: sheets, strips, clips and the pages of the reference.
//!
//! A sheet has a row for each perturbation, the same frame at levels 0 to 4. A strip and a clip show one that moves over time.
//! The reference is Markdown, a page for each family of perturbations, written from their descriptions alone. None of this is
//! part of a run: pictures are for people, who choose perturbations by them.
//!
//! ```text
//! catalog ── chosen ──► perturbations ── rows, over_time ──► pictures ── sheet, row, clip ──► files
//!    └─────── usable ──► descriptions ── pages ──► Markdown
//! ```
//!
//! | module | subject |
//! |---|---|
//! | [`preview`] | which perturbations are shown, and the frames that they make |
//! | [`mod@reference`] | the pages of the reference |
//! | [`method`] | the saliency method that shows what a driver's network looks at |
//! | [`modifiers`] | what every perturbation takes besides its own parameters, in help and in the reference |
//! | [`picture`] | frames to pictures, side by side and on sheets, and GIFs |
//! | [`text`] | labels, with a font that comes with the program |
//!
//! [`preview`] calls components, so it belongs in a process that another one supervises (`pdk_supervise::supervisor`). Everything
//! else is a function of plain data: [`mod@reference`] needs a catalog and no component, and [`picture`] and [`text`] serve the clips
//! of a replay as well.
//!
//! A frame is shown at two seconds, when what moves has begun to. Sizes of perturbations are in pixels, so the frame is
//! brought to the size of a camera's before it is perturbed, and to that of the picture only afterwards. If a perturbation
//! fails, its row is the error: a sheet without it is for the caller to decide on.

pub mod method;
pub mod modifiers;
pub mod picture;
pub mod preview;
pub mod reference;
pub mod text;
