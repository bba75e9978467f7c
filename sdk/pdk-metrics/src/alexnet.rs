//! Errors of AlexNet, by which mean corruption errors are divided.

/// The errors of AlexNet on ImageNet-C, each the mean over the five levels, as D. Hendrycks and T. Dietterich published them with their
/// benchmark.
pub const ERRORS: [(&str, f64); 15] = [
    ("imagenet_c_gaussian_noise", 0.886428),
    ("imagenet_c_shot_noise", 0.894468),
    ("imagenet_c_impulse_noise", 0.922640),
    ("imagenet_c_defocus_blur", 0.819880),
    ("imagenet_c_glass_blur", 0.826268),
    ("imagenet_c_motion_blur", 0.785948),
    ("imagenet_c_zoom_blur", 0.798360),
    ("imagenet_c_snow", 0.866816),
    ("imagenet_c_frost", 0.826572),
    ("imagenet_c_fog", 0.819324),
    ("imagenet_c_brightness", 0.564592),
    ("imagenet_c_contrast", 0.853204),
    ("imagenet_c_elastic_transform", 0.646056),
    ("imagenet_c_pixelate", 0.717840),
    ("imagenet_c_jpeg_compression", 0.606500),
];
/// Its error on the pictures as they are: 43.5 %.
pub const CLEAN: f64 = 0.435;
