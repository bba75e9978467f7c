//! The perturbation `rainy`.

super::painter::painter! {
    Rainy: "rainy", "46ba8d284b04dbfa88670b49929e37a37d654c116e3bb61e2c404facb33830f6",
    "Repaints a dry day as a rainy one, with thick air and a wet road, by a network",
    "Park et al., Contrastive Learning for Unpaired Image-to-Image Translation, 2020"
}
