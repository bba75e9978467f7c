//! Swathes of smoke, moving.

crate::published::moving! { DynamicSmoke: "dynamic_smoke_filter", "smoke", "swathes of smoke", "a loop of 4 s", 3 }
