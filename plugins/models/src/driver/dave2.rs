//! The network `dave2`.

super::trained::network! {
    Dave2: "dave2", "11e4f3b254f98268b186306bbba3d3dfc429d6f5ab4a42315f98313fef6324d3",
    "Drives with a network that learned from images of `lane`",
    super::trained::DAVE2
}
