//! The network `dave2_augmented`.

super::trained::network! {
    Dave2Augmented: "dave2_augmented", "8cccfa4173b275f353bc472d27aa7efd229fa4b1c5eef2193425609cda02fa29",
    "Drives with a network that learned from images of `lane` with random noise, blur, brightness and contrast",
    super::trained::DAVE2
}
