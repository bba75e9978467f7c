//! Flakes of snow, standing still.

crate::published::still! { StaticSnow: "static_snow_filter", "snow", "flakes of snow", 3 }
