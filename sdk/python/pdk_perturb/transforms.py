"""Perturbations as transforms of datasets, whose draws follow from what they draw from, seed, epoch and sample alone, whatever the
number of workers.

    from pdk_perturb.transforms import Indexed, OneOf, Transform

    transform = Transform(OneOf("fog_filter", "gaussian_noise", "motion_blur"), level=(0, 4), p=0.5, seed=1)
    dataset = Indexed(ImageFolder(root, transform=Compose([transform, ToTensor()])))
    for epoch in range(3):
        dataset.set_epoch(epoch)
        for images, targets in DataLoader(dataset, num_workers=4):
            ...

A transform is called as those of torchvision, `transform(image)`, with an array, a PIL image or a tensor, which it returns as such,
or as those of albumentations, `transform(image=image, mask=mask)["image"]`. The sample is the index that `Indexed` hands out, else
the one that is given (`transform(image, sample=17)`), else the image's own content.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing.sharedctypes
import threading
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy

import pdk_perturb as pdk

if TYPE_CHECKING:
    from pdk_perturb import Chain

__all__ = ["Indexed", "OneOf", "Transform"]

# What `Indexed` is getting in this thread: the number of the sample and the epoch.
_current = threading.local()


class OneOf:
    """Alternatives, one of which is drawn for each sample; `None` among them leaves the image as it is.

    With `weights` some are drawn more often than others.
    """

    def __init__(self, *alternatives: Chain | None, weights: Sequence[float] | None = None) -> None:
        if not alternatives:
            raise ValueError("OneOf needs alternatives to choose from")
        weights = [1.0] * len(alternatives) if weights is None else [float(weight) for weight in weights]
        if len(weights) != len(alternatives) or min(weights) < 0 or sum(weights) <= 0:
            raise ValueError("`weights` has to have a number from 0 for each alternative, and not all may be 0")
        self.alternatives = alternatives
        self.weights = weights

    def __repr__(self):
        weights = "" if len(set(self.weights)) == 1 else f", weights={self.weights}"
        return f"OneOf({', '.join(map(repr, self.alternatives))}{weights})"

    def _place(self, share):
        """The place of the alternative at a share from 0 to 1 of all weights."""
        left = share * sum(self.weights)
        for place, weight in enumerate(self.weights):
            left -= weight
            if left < 0:
                return place
        return len(self.weights) - 1


class Transform:
    """Perturbs images of a dataset.

    `perturbation` is what `pdk.perturb` takes, or `OneOf` such. `level` is an intensity for all of them, or lowest and highest of
    those that one is drawn from for each sample. `p` is the share of samples that are perturbed. Two transforms draw independently,
    unless both seed and perturbations are the same.

    Labels and boxes are handed through as they are: perturbations that move pixels (shear_image, translate_image, scale_image,
    rotate_image, reflection_filter) do not move them.
    """

    def __init__(
        self,
        perturbation: Chain | OneOf,
        *,
        level: float | tuple[float, float] | None = None,
        p: float = 1.0,
        seed: int = 0,
    ) -> None:
        if not 0.0 <= p <= 1.0:
            raise ValueError(f"`p` is {p}, but has to be a number from 0 to 1")
        self.perturbation = perturbation
        self.level = level
        self.p = p
        self.seed = seed
        self._levels = None if level is None else _ends(level)
        self._oneof = perturbation if isinstance(perturbation, OneOf) else OneOf(perturbation)
        # They are checked here, whatever the end is.
        self._chains = [None if each is None else pdk.written(each) for each in self._oneof.alternatives]
        for chain in filter(None, self._chains):
            for end in self._levels or ():
                pdk.written(chain, level=end)
        self._epoch = _Epoch()

    def __repr__(self):
        return f"Transform({self.perturbation!r}, level={self.level}, p={self.p}, seed={self.seed})"

    def set_epoch(self, epoch: int) -> None:
        """Says which epoch it is, also to workers that run already. `Indexed.set_epoch` counts more where there is one."""
        self._epoch.set(epoch)

    def __call__(self, *arguments: Any, sample: int | None = None, **targets: Any) -> Any:
        if arguments:
            if len(arguments) > 1 or targets:
                raise TypeError("call it with one image, transform(image), or by keyword, transform(image=image, mask=mask)")
            return self._perturbed(arguments[0], sample)
        if "image" not in targets:
            raise TypeError("there is no image: call transform(image) or transform(image=image)")
        return {**targets, "image": self._perturbed(targets["image"], sample)}

    def _perturbed(self, image, sample):
        array, back = _as_array(image)
        epoch = self._epoch.get()
        if sample is None and (current := getattr(_current, "sample", None)) is not None:
            sample, epoch = current
        if sample is None:
            sample = pdk.identity(array)
        which, whether, level, seed = _draws(self._chains, self.seed, epoch, sample)
        chain = self._chains[self._oneof._place(which)]
        if chain is None or whether >= self.p:
            return image
        if self._levels is None:
            return back(pdk.perturb(array, chain, seed=seed))
        low, high = self._levels
        return back(pdk.perturb(array, chain, seed=seed, level=low + (high - low) * level))


class Indexed:
    """A dataset whose transforms know which sample they are at. Nothing else about it changes.

    `set_epoch` reaches workers that run already, persistent ones among them.
    """

    def __init__(self, dataset: Any) -> None:
        self.dataset = dataset
        self._epoch = _Epoch()

    def set_epoch(self, epoch: int) -> None:
        """Says which epoch it is, before its first sample is asked for."""
        self._epoch.set(epoch)

    def __getitem__(self, index: int) -> Any:
        before = getattr(_current, "sample", None)
        _current.sample = (int(index), self._epoch.get())
        try:
            return self.dataset[index]
        finally:
            _current.sample = before

    def __len__(self) -> int:
        return len(self.dataset)

    def __getattr__(self, name):
        # Such as the classes of a dataset. Names with an underscore are asked for while it is read from another process.
        if name.startswith("_") or name == "dataset":
            raise AttributeError(name)
        return getattr(self.dataset, name)


class _Epoch:
    """A number that workers of a data loader see, forked or started anew."""

    def __init__(self):
        self._value = multiprocessing.sharedctypes.RawValue("q", 0)

    def set(self, epoch):
        self._value.value = epoch

    def get(self):
        return self._value.value


def _ends(level):
    """The lowest and the highest intensity, which are the same where there is one."""
    ends = (level,) if isinstance(level, Real) else tuple(level) if isinstance(level, (tuple, list, numpy.ndarray)) else ()
    if len(ends) not in (1, 2) or not all(isinstance(end, Real) for end in ends) or ends[0] > ends[-1]:
        raise ValueError(f"`level` is {level}, but has to be one intensity, or the lowest and the highest")
    return float(ends[0]), float(ends[-1])


def _draws(chains, seed, epoch, sample):
    """Three shares from 0 to 1, and a seed for the perturbation. Transforms with other perturbations have other draws."""
    key = f"pdk transform, version 2: {json.dumps(chains)} {int(seed)} {int(epoch)} {int(sample)}".encode()
    drawn = hashlib.blake2b(key, digest_size=32).digest()
    numbers = [int.from_bytes(drawn[place : place + 8], "little") for place in range(0, 32, 8)]
    return (*(number / 2**64 for number in numbers[:3]), numbers[3] >> 11)


def _as_array(image):
    """An image as an array of height x width x 3 bytes, and what makes of such an array an image like it."""
    if isinstance(image, numpy.ndarray):
        return image, lambda array: array
    if type(image).__module__.partition(".")[0] in ("torch", "torchvision"):
        return _from_torch(image)
    if hasattr(image, "convert"):
        return _from_pillow(image)
    raise TypeError(f"a {type(image).__name__} is not an image: give an array, a PIL image or a tensor of torch")


def _from_pillow(image):
    """A picture in colours or greys, with transparency or without, which stays as it is."""
    from PIL import Image

    if image.mode not in ("RGB", "RGBA", "L", "LA"):
        raise ValueError(f"a picture of mode {image.mode} cannot be perturbed; give one of mode RGB, as `image.convert('RGB')` makes it")

    def back(array):
        made = Image.fromarray(array).convert(image.mode.removesuffix("A"))
        if image.mode.endswith("A"):
            made.putalpha(image.getchannel("A"))
        return made

    return numpy.asarray(image.convert("RGB")), back


def _from_torch(image):
    """A tensor of 3 x height x width, bytes or numbers from 0 to 1."""
    import torch

    if image.dim() != 3 or image.shape[0] != 3:
        raise ValueError(f"a tensor of {tuple(image.shape)} is not an image: it has to be 3 x height x width")
    whole = image.dtype == torch.uint8
    values = image if whole else (image * 255).round().clamp(0, 255).to(torch.uint8)

    def back(array):
        made = torch.from_numpy(array).permute(2, 0, 1).contiguous().to(image.device)
        return made if whole else made.to(image.dtype) / 255

    return values.detach().cpu().permute(1, 2, 0).numpy(), back
