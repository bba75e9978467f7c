//! Birds in flight above the horizon, moving.

crate::published::moving! { DynamicObject: "dynamic_object_overlay", "birds", "birds in flight above the horizon", "a loop of 4 s", 4 }
