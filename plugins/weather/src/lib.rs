//! Perturbations of the weather family.
