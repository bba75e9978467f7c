//! Bolts of lightning, moving.

crate::published::moving! { DynamicLightning: "dynamic_lightning_filter", "lightning", "bolts of lightning", "a loop of 10 s, in 40 % of which one shows; otherwise the frame stays as it is", 4 }
