"""The 19 corruptions of ImageNet-C, called as those of the package imagecorruptions: scripts switch by changing the import.

    from pdk_perturb.corruptions import corrupt, get_corruption_names

    for name in get_corruption_names():
        for severity in range(1, 6):
            corrupted = corrupt(image, corruption_name=name, severity=severity)

They are the perturbations `imagenet_c_NAME`, whose levels 0 to 4 are the severities 1 to 5: the same on the command line and in
pipelines. docs/python.md tells where they agree with imagecorruptions and where they differ.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy

import pdk_perturb as pdk

if TYPE_CHECKING:
    from pdk_perturb import Image

#: The name and version of the suite, for papers. A change of an output raises the version.
SUITE = "imagenet_c, version 1"

_SUBSETS = {
    "noise": ("gaussian_noise", "shot_noise", "impulse_noise"),
    "blur": ("defocus_blur", "glass_blur", "motion_blur", "zoom_blur"),
    "weather": ("snow", "frost", "fog", "brightness"),
    "digital": ("contrast", "elastic_transform", "pixelate", "jpeg_compression"),
    "validation": ("speckle_noise", "gaussian_blur", "spatter", "saturate"),
}
_COMMON = tuple(name for subset in ("noise", "blur", "weather", "digital") for name in _SUBSETS[subset])
_ALL = _COMMON + _SUBSETS["validation"]

#: The smallest height and width.
_SMALLEST = 32


def get_corruption_names(subset: str = "common") -> list[str]:
    """The names of a subset: common (15), validation (4), all, noise, blur, weather or digital."""
    names = {**_SUBSETS, "common": _COMMON, "all": _ALL}
    if subset not in names:
        raise ValueError(f"there is no subset `{subset}`; there are {', '.join(names)}")
    return list(names[subset])


def corrupt(
    image: Image,
    severity: int = 1,
    corruption_name: str | None = None,
    corruption_number: int = -1,
    *,
    seed: int | None = None,
) -> Image:
    """Corrupts an image of height x width x 3, height x width x 1 or height x width bytes; the result has three channels.

    `severity` is 1 to 5. The corruption is named, or has a number from 0 to 18 in the order of `get_corruption_names("all")`. Without
    a seed the draws follow from the image itself: they differ from image to image, and are the same whenever it is corrupted again.
    """
    if corruption_name is None:
        if not 0 <= corruption_number < len(_ALL):
            raise ValueError(f"name a corruption, or give a corruption_number from 0 to {len(_ALL) - 1}")
        corruption_name = _ALL[corruption_number]
    elif corruption_name not in _ALL:
        raise ValueError(f"there is no corruption `{corruption_name}`; there are {', '.join(_ALL)}")
    if severity not in (1, 2, 3, 4, 5):
        raise ValueError(f"severity is {severity}, but has to be 1, 2, 3, 4 or 5")
    image = _with_channels(image)
    if seed is None:
        seed = pdk.identity(image)
    return pdk.perturb(image, f"imagenet_c_{corruption_name}", level=severity - 1, seed=seed)


def _with_channels(image: Image) -> Image:
    if not isinstance(image, numpy.ndarray) or image.dtype != numpy.uint8:
        raise TypeError("the image has to be an array of numpy, dtype uint8")
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3):
        raise ValueError(f"the image has the shape {image.shape}, but has to be height x width x 3, x 1 or nothing more")
    if min(image.shape[:2]) < _SMALLEST:
        raise ValueError(f"the image is {image.shape[1]} x {image.shape[0]}, but has to have {_SMALLEST} pixels in each direction")
    return image if image.shape[2] == 3 else numpy.repeat(image, 3, axis=2)
