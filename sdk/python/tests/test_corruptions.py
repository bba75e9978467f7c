"""The suite of ImageNet-C, beside the package imagecorruptions if that is installed."""

import importlib

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb.corruptions import corrupt, get_corruption_names

#: Deterministic corruptions, and the share of values that are equal and the largest difference that are held on noise, where few
#: values are whole before their fractions are dropped.
DETERMINISTIC = {
    "gaussian_blur": (0.999, 1),
    "defocus_blur": (0.95, 1),
    "zoom_blur": (0.999, 1),
    "brightness": (0.999, 1),
    "contrast": (1.0, 0),
    "saturate": (0.999, 1),
    "pixelate": (1.0, 0),
    "jpeg_compression": (0.999, 1),
}
#: Random ones, which are compared by their statistics.
RANDOM = [
    "gaussian_noise",
    "shot_noise",
    "impulse_noise",
    "speckle_noise",
    "glass_blur",
    "motion_blur",
    "snow",
    "fog",
    "elastic_transform",
    "spatter",
]
#: Grey levels that means and deviations may differ by, besides five times what chance explains.
NEGLIGIBLE = 0.5


@pytest.fixture(scope="module")
def published():
    """imagecorruptions, with what it calls in the present releases of numpy and scikit-image."""
    filters = pytest.importorskip("skimage.filters")
    numpy.float_ = numpy.float64
    module = pytest.importorskip("imagecorruptions")
    smooth = filters.gaussian

    def gaussian(image, *arguments, multichannel=False, **named):
        return smooth(image, *arguments, channel_axis=-1 if multichannel else None, **named)

    importlib.import_module("imagecorruptions.corruptions").gaussian = gaussian
    return module


def test_the_names_are_those_of_the_suite():
    assert len(get_corruption_names()) == 15 and len(get_corruption_names("all")) == 19
    assert get_corruption_names("noise") == ["gaussian_noise", "shot_noise", "impulse_noise"]
    for name in get_corruption_names("all"):
        assert f"imagenet_c_{name}" in pdk.names()
    with pytest.raises(ValueError, match="there is no subset"):
        get_corruption_names("everything")


def test_severities_are_levels(image):
    for severity in range(1, 6):
        expected = pdk.perturb(image, f"imagenet_c_snow@{severity - 1}", seed=3)
        assert numpy.array_equal(corrupt(image, severity, "snow", seed=3), expected)
    assert numpy.array_equal(corrupt(image, corruption_number=7, seed=3), corrupt(image, 1, "snow", seed=3))


def test_draws_follow_from_the_image(image):
    noisy = corrupt(image, corruption_name="gaussian_noise")
    assert numpy.array_equal(noisy, corrupt(image.copy(), corruption_name="gaussian_noise"))
    other = corrupt(image[:, ::-1], corruption_name="gaussian_noise")[:, ::-1]
    assert not numpy.array_equal(noisy, other)


def test_grey_images_get_three_channels(image):
    grey = image[..., 0]
    expected = corrupt(numpy.stack([grey] * 3, axis=2), 2, "contrast")
    assert numpy.array_equal(corrupt(grey, 2, "contrast"), expected)
    assert numpy.array_equal(corrupt(grey[..., None], 2, "contrast"), expected)


def test_mistakes_are_said(image):
    for wrong in [{"corruption_name": "rain"}, {"corruption_number": 19}, {}, {"corruption_name": "fog", "severity": 6}]:
        with pytest.raises(ValueError):
            corrupt(image, **wrong)
    with pytest.raises(TypeError):
        corrupt(image.astype(float), corruption_name="fog")
    with pytest.raises(ValueError, match="32 pixels"):
        corrupt(image[:20], corruption_name="fog")


def test_every_corruption_of_the_suite_is_compared():
    assert sorted([*DETERMINISTIC, *RANDOM, "frost"]) == sorted(get_corruption_names("all"))


@pytest.mark.parametrize("name", DETERMINISTIC)
def test_deterministic_ones_agree_with_the_package(name, published):
    equal, furthest = DETERMINISTIC[name]
    noise = numpy.random.default_rng(1).integers(0, 256, (240, 320, 3)).astype(numpy.uint8)
    for severity in range(1, 6):
        theirs = published.corrupt(noise, severity=severity, corruption_name=name).astype(int)
        difference = numpy.abs(corrupt(noise, severity, name) - theirs)
        share = (difference == 0).mean()
        assert share >= equal and difference.max() <= furthest, (severity, share, difference.max())


@pytest.mark.parametrize("name", RANDOM)
def test_random_ones_have_the_statistics_of_the_package(name, image, published):
    numpy.random.seed(1)
    count = 16
    for severity in (1, 3, 5):
        theirs = [published.corrupt(image, severity=severity, corruption_name=name) for _ in range(count)]
        ours = [corrupt(image, severity, name, seed=seed) for seed in range(count)]
        for what in (numpy.mean, numpy.std):
            one, other = ([what(each) for each in images] for images in (ours, theirs))
            chance = numpy.sqrt((numpy.var(one) + numpy.var(other)) / (count - 1))
            difference = abs(numpy.mean(one) - numpy.mean(other))
            assert difference < 5 * chance + NEGLIGIBLE, (severity, what.__name__, difference, chance)
