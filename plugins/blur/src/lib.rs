//! Perturbations of the blur family.
