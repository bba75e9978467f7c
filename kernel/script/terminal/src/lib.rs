//! What a terminal shows: progress, tables, texts as wide as it is, and commands to paste.

pub mod shell;
pub mod table;
pub mod text;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar on standard error, followed by these numbers. Draws nothing if standard error is not a terminal.
pub fn progress(quiet: bool, numbers: &str) -> ProgressBar {
    let target = match quiet {
        true => ProgressDrawTarget::hidden(),
        false => ProgressDrawTarget::stderr(),
    };
    let bar = ProgressBar::with_draw_target(None, target);
    if let Ok(style) = ProgressStyle::with_template(&format!("{{elapsed_precise}} [{{wide_bar}}] {numbers}"))
    {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}
