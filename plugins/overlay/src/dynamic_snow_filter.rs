//! Flakes of snow, moving.

crate::published::moving! { DynamicSnow: "dynamic_snow_filter", "snow", "flakes of snow", "a loop of 4 s", 4 }
