//! The network `dave2_hardened`.

super::trained::network! {
    Dave2Hardened: "dave2_hardened", "b8fefc48c6a6291a8da135b7a7ee463731b56cf9212918d5507f8883686afc34",
    "Drives with a network that learned from images of `lane`, half of them through perturbations that made `dave2` fail",
    super::trained::DAVE2
}
