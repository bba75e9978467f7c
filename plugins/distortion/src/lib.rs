//! Perturbations of the distortion family.
