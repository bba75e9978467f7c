//! Perturbed copies of datasets: each perturbation at each level makes a folder that has the form of the original, labels included.
//!
//! | module | subject |
//! |---|---|
//! | [`conditions`] | which perturbations at which levels, and the folder of each |
//! | `contents` | what the files of a dataset are: pictures, labels that are understood, others |
//! | [`labels`] | labels in files, moved: `coco`, `yolo`, `lines`, `mask`, `records`, `table`; `rle` packs masks |
//! | `unit` | a file of the dataset under all conditions, done by one worker |
//! | `rewrite` | files of a recording that its reader writes again, and files that are carried over |
//! | `source` | a folder of pictures, or a recording that a reader opens |
//! | `checks` | whether labels can be moved along |
//! | `manifest` | what was written, with hashes and seeds; the journal by which a run is continued |
//! | [`options`] | what a user decides besides |
//! | [`corrupt`] | all of it, on all cores |

mod checks;
pub mod conditions;
mod contents;
pub mod corrupt;
pub mod labels;
mod manifest;
pub mod options;
mod rewrite;
mod source;
mod unit;
