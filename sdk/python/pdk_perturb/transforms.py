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
or as those of albumentations, `transform(image=image, mask=mask)["image"]`, where `mask`, `masks`, `bboxes` and `keypoints` move with the
pixels. The sample is the index that `Indexed` hands out, else
the one that is given (`transform(image, sample=17)`), else the image's own content.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing.context
import multiprocessing.sharedctypes
import threading
from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal

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

    Of the keyword arguments, `mask`, each of `masks`, `bboxes` and `keypoints` move as the pixels do; others are handed through. `bboxes`
    are rows of four numbers as `boxes` says, and whatever stands behind them: "pascal_voc" (left, top, right, bottom), "coco" (left, top,
    width, height), "yolo" (middle, width, height, as shares) or "albumentations" (left, top, right, bottom, as shares). A box of which less
    than `min_visibility` is left in the image is left out, and what belongs to it in the lists that `label_fields` names. `keypoints` are
    rows of x and y, where the centre of the first pixel is 0, 0, and whatever stands behind; all stay, also those outside of the image.
    Masks have the value `outside` where they come from outside. A perturbation that cannot say where it moves things is an error, if there
    is something to move.
    """

    def __init__(
        self,
        perturbation: Chain | OneOf,
        *,
        level: float | tuple[float, float] | None = None,
        p: float = 1.0,
        seed: int = 0,
        boxes: Literal["pascal_voc", "coco", "yolo", "albumentations"] = "pascal_voc",
        label_fields: Sequence[str] = (),
        min_visibility: float = 0.1,
        outside: int = 0,
    ) -> None:
        if boxes not in _BOXES:
            raise ValueError(f"`boxes` is {boxes!r}, but has to be one of {', '.join(_BOXES)}")
        if not 0.0 <= p <= 1.0:
            raise ValueError(f"`p` is {p}, but has to be a number from 0 to 1")
        self.perturbation = perturbation
        self.level = level
        self.p = p
        self.seed = seed
        self.boxes = boxes
        self.label_fields = tuple(label_fields)
        self.min_visibility = min_visibility
        self.outside = outside
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
        """Says which epoch it is, also to workers that run already. `Indexed.set_epoch` counts more if there is one."""
        self._epoch.set(epoch)

    def __call__(self, *arguments: Any, sample: int | None = None, **targets: Any) -> Any:
        if arguments:
            if len(arguments) > 1 or targets:
                raise TypeError("call it with one image, transform(image), or by keyword, transform(image=image, mask=mask)")
            return self._perturbed(arguments[0], sample, {})[0]
        if "image" not in targets:
            raise TypeError("there is no image: call transform(image) or transform(image=image)")
        moved = {name: targets[name] for name in _MOVED if targets.get(name) is not None}
        moved |= {name: targets[name] for name in self.label_fields if "bboxes" in moved}
        image, moved = self._perturbed(targets["image"], sample, moved)
        return {**targets, "image": image, **moved}

    def _perturbed(self, image, sample, labels):
        array, back = _as_array(image)
        epoch = self._epoch.get()
        if sample is None and (current := getattr(_current, "sample", None)) is not None:
            sample, epoch = current
        if sample is None:
            sample = pdk.identity(array)
        which, whether, level, seed = _draws(self._chains, self.seed, epoch, sample)
        chain = self._chains[self._oneof._place(which)]
        if chain is None or whether >= self.p:
            return image, labels
        given = {"seed": seed}
        if self._levels is not None:
            low, high = self._levels
            given["level"] = low + (high - low) * level
        # Before the image, so that what cannot be moved costs nothing.
        labels = self._moved(labels, chain, array.shape[:2], given)
        return back(pdk.perturb(array, chain, **given)), labels

    def _moved(self, labels, chain, size, given):
        """The labels of an image of this size, moved as its pixels are."""
        given = {**given, "size": tuple(size)}
        moved = dict(labels)
        if "keypoints" in labels:
            rows = [list(row) for row in labels["keypoints"]]
            points = numpy.array([row[:2] for row in rows], dtype=float).reshape(-1, 2)
            points = pdk.move_points(points + 0.5, chain, **given) - 0.5
            rows = [[*point, *row[2:]] for point, row in zip(points.tolist(), rows)]
            moved["keypoints"] = _like(rows, labels["keypoints"])
        if "bboxes" in labels:
            rows = [list(row) for row in labels["bboxes"]]
            numbers = numpy.array([row[:4] for row in rows], dtype=float).reshape(-1, 4)
            to_edges, from_edges = _BOXES[self.boxes]
            edges, visible = pdk.move_boxes(to_edges(numbers, *size), chain, **given)
            whole = (edges[:, 2] > edges[:, 0]) & (edges[:, 3] > edges[:, 1])
            kept = numpy.flatnonzero(whole & (visible >= self.min_visibility))
            written = from_edges(edges, *size).tolist()
            moved["bboxes"] = _like([[*written[place], *rows[place][4:]] for place in kept], labels["bboxes"])
            for name in self.label_fields:
                if len(labels[name]) != len(rows):
                    raise ValueError(f"there are {len(labels[name])} `{name}` for {len(rows)} boxes; give one for each")
                moved[name] = _like([labels[name][place] for place in kept], labels[name])
        if "mask" in labels or "masks" in labels:
            sources = pdk.source_pixels(chain, **given)
            if "mask" in labels:
                moved["mask"] = _moved_mask(labels["mask"], sources, self.outside)
            if "masks" in labels:
                moved["masks"] = _moved_masks(labels["masks"], sources, self.outside)
        return moved


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
    """A number that workers of a data loader see, forked or started anew. A copy that is made for anything else has a number of its own."""

    def __init__(self, epoch=0):
        self._value = multiprocessing.sharedctypes.RawValue("q", epoch)

    def set(self, epoch):
        self._value.value = epoch

    def get(self):
        return self._value.value

    def __reduce__(self):
        # Shared memory only travels to a process that is being started.
        if multiprocessing.context.get_spawning_popen() is None:
            return _Epoch, (self.get(),)
        return _shared_epoch, (self._value,)


def _shared_epoch(value):
    epoch = _Epoch()
    epoch._value = value
    return epoch


def _as_edges(edges, height, width):
    return edges


def _shares(scale):
    """To and from numbers that are shares of width and height."""
    return (
        lambda boxes, height, width: scale[0](boxes * (width, height, width, height), height, width),
        lambda edges, height, width: scale[1](edges, height, width) / (width, height, width, height),
    )


_CORNER = (
    lambda boxes, height, width: numpy.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]),
    lambda edges, height, width: numpy.hstack([edges[:, :2], edges[:, 2:] - edges[:, :2]]),
)
_MIDDLE = (
    lambda boxes, height, width: numpy.hstack([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2]),
    lambda edges, height, width: numpy.hstack([(edges[:, :2] + edges[:, 2:]) / 2, edges[:, 2:] - edges[:, :2]]),
)
_EDGES = (_as_edges, _as_edges)
# How boxes are written: to left, top, right and bottom in pixels, and back.
_BOXES = {"pascal_voc": _EDGES, "coco": _CORNER, "yolo": _shares(_MIDDLE), "albumentations": _shares(_EDGES)}
# The arguments that move.
_MOVED = ("mask", "masks", "bboxes", "keypoints")


def _like(rows, given):
    """Rows in what the user gave them in: an array, a tensor, a list."""
    if isinstance(given, numpy.ndarray):
        made = numpy.asarray(rows, dtype=given.dtype if given.dtype.kind in "fO" or given.ndim == 1 else float)
        return made.reshape(-1, *given.shape[1:]) if given.ndim > 1 else made
    if type(given).__module__.partition(".")[0] in ("torch", "torchvision"):
        import torch

        if given.dim() > 1 and isinstance(rows[0] if rows else None, torch.Tensor):
            return torch.stack(rows)
        dtype = given.dtype if given.is_floating_point() or given.dim() == 1 else torch.float32
        return torch.as_tensor(rows, dtype=dtype, device=given.device).reshape(-1, *given.shape[1:])
    if rows and isinstance(given, (list, tuple)) and isinstance(given[0], tuple):
        rows = [tuple(row) for row in rows]
    return type(given)(rows) if isinstance(given, (list, tuple)) else rows


def _moved_masks(masks, sources, outside):
    """Masks in what the user gave them in, with the type of their values."""
    moved = [_moved_mask(mask, sources, outside) for mask in masks]
    if not moved:
        return masks
    if isinstance(masks, numpy.ndarray):
        return numpy.array(moved, dtype=masks.dtype)
    return _like(moved, masks)


def _moved_mask(mask, sources, outside):
    """A mask with the values of other pixels: height x width, with channels behind in an array and in front in a tensor."""
    size = sources.shape
    if isinstance(mask, numpy.ndarray):
        if mask.shape[:2] != size:
            raise ValueError(f"a mask of {mask.shape} does not fit an image of {size[0]} x {size[1]}")
        moved = mask.reshape(size[0] * size[1], *mask.shape[2:])[sources]
        moved[sources < 0] = outside
        return moved
    if type(mask).__module__.partition(".")[0] in ("torch", "torchvision"):
        import torch

        if tuple(mask.shape[-2:]) != size:
            raise ValueError(f"a mask of {tuple(mask.shape)} does not fit an image of {size[0]} x {size[1]}")
        places = torch.from_numpy(sources).to(mask.device)
        moved = mask.reshape(*mask.shape[:-2], -1)[..., places.clamp(min=0)]
        return torch.where(places < 0, torch.as_tensor(outside, dtype=mask.dtype, device=mask.device), moved)
    if hasattr(mask, "convert"):
        from PIL import Image

        moved = Image.fromarray(_moved_mask(numpy.asarray(mask), sources, outside))
        if mask.mode == "P":
            moved.putpalette(mask.getpalette())
        return moved
    raise TypeError(f"a {type(mask).__name__} is not a mask: give an array, a PIL image or a tensor of torch")


def _ends(level):
    """The lowest and the highest intensity, which are the same if there is one."""
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
    if not whole and not image.is_floating_point():
        raise ValueError(f"a tensor of {image.dtype} is not an image; give one of torch.uint8, or of floating-point numbers from 0 to 1")
    # Not a number is not within them either.
    if not whole and not bool(((image >= 0) & (image <= 1)).all()):
        raise ValueError(
            f"a tensor of {image.dtype} with values from {image.min().item():g} to {image.max().item():g} is not an image; divide it by 255 if its "
            "values are from 0 to 255, clamp it to 0 to 1 after interpolation, and normalise it after this transform"
        )
    values = image if whole else (image * 255).round().clamp(0, 255).to(torch.uint8)

    def back(array):
        made = torch.from_numpy(array).permute(2, 0, 1).contiguous().to(image.device)
        return made if whole else made.to(image.dtype) / 255

    return values.detach().cpu().permute(1, 2, 0).numpy(), back
