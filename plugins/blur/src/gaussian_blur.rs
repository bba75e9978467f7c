//! Gaussian blur: dirt or grease on the lens.

use pdk_sdk::ops::gaussian::{Workspace, gaussian_blur};
use pdk_sdk::prelude::*;

/// Smooths with a Gaussian kernel.
pub struct GaussianBlur {
    workspace: Workspace,
}

impl Component for GaussianBlur {
    fn description() -> Description {
        Description::perturbation("gaussian_blur", "Smooths with a Gaussian kernel")
            .family("blur")
            .keeps_geometry()
            .mathematics("v * G, sigma = 0.3 ((size - 1)/2 - 1) + 0.8")
            .source(
                "Gaussian filter with 8-bit weights and standard deviation 0.3 * ((size - 1) / 2 - 1) + 0.8",
            )
            .parameter(
                Parameter::by_level(
                    "kernel_size",
                    [3.0, 7.0, 15.0, 25.0, 41.0],
                    "width of the kernel, rounded to the nearest odd number",
                )
                .range(1.0, 99.0)
                .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

/// The odd number nearest to `size`.
pub fn nearest_odd(size: f64) -> usize {
    2 * ((size - 1.0) / 2.0).round() as usize + 1
}

impl Perturbation for GaussianBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        gaussian_blur(src, dst, nearest_odd(cx.number("kernel_size")), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{GaussianBlur, nearest_odd};
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<GaussianBlur>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<GaussianBlur>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn kernel_sizes_are_odd() {
        let sizes = [1.0, 1.9, 2.1, 3.0, 4.5, 40.0, 41.0, 99.0].map(nearest_odd);
        assert_eq!(sizes, [1, 1, 3, 3, 5, 41, 41, 99]);
    }
}
