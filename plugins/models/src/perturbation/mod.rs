//! The perturbations: [`repaint`] runs a network in a file, the others those that are part of this plugin ([`painter`]).

mod artistic;
mod night;
mod painter;
mod rainy;
mod repaint;

pub use artistic::Artistic;
pub use night::Night;
pub use rainy::Rainy;
pub use repaint::Repaint;
