//! The network `transformer`.

super::trained::network! {
    Transformer: "transformer", "74fcc0641e96cc4e06e8be06d43fbeff2c3e6b52359c3bad6a65b89aac007370",
    "Drives with a small vision transformer that learned from images of `lane`",
    "Dosovitskiy et al., An Image is Worth 16x16 Words, 2021"
}
