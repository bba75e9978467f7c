//! Perturbations of the noise family.
