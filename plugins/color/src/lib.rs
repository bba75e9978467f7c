//! Perturbations of the color family.
