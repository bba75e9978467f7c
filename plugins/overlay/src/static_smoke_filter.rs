//! Swathes of smoke, standing still.

crate::published::still! { StaticSmoke: "static_smoke_filter", "smoke", "swathes of smoke", 2, not_default }
