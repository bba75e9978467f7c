"""The interface of PerturbationDrive: its scripts switch by changing the import.

    from pdk_perturb.perturbationdrive import ImagePerturbation, gaussian_noise

    controller = ImagePerturbation(funcs=["gaussian_noise", "snow_filter"])
    perturbed = controller.perturbation(image, "snow_filter", intensity=2)
    noisy = gaussian_noise(3, image)

Every perturbation of pdk is there under its name, as a function of intensity and image, and so is one of your own:
`ImagePerturbation(funcs=[my_function])`. Unlike there, images are never written to, random numbers come from a seed, and what moves is
drawn by its name and the number of calls with that name, at 20 frames a second. The functions draw the same at each call; give them
a `seed` of its own for each image where they are not to.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy

import pdk_perturb as pdk

if TYPE_CHECKING:
    from pdk_perturb import Image

__all__ = ["ImagePerturbation"]

#: How many perturbations are kept with what they have prepared; one that is made anew goes on where it was. Those that remember frames are
#: kept in any case.
_KEPT = 8


class ImagePerturbation:
    """Perturbs the frames of a drive by name: the next frame of a perturbation at each call, whatever the intensity.

    `funcs` are the names of perturbations, or functions of intensity and image; the default set where there are none. `attention_map`
    and `image_size` are there so that calls need no change: limit perturbations with `where` (see `pdk show NAME`); frames keep
    their size.
    """

    def __init__(
        self,
        funcs: Sequence[str | Callable[[float, Image], Image]] = (),
        attention_map: dict[str, Any] | None = None,
        image_size: tuple[int, int] = (240, 320),
        *,
        seed: int = 0,
        fps: float = 20.0,
    ) -> None:
        if attention_map:
            raise pdk.Error(
                "attention maps of PerturbationDrive are Keras models in this process; name an ONNX file instead, as in "
                "perturbation(image, 'fog_filter,where={\"top\":20,\"by\":\"hirescam,model=FILE.onnx\"}', 2)"
            )
        self.image_size = image_size
        self.seed = seed
        self.fps = fps
        self._functions: dict[str, Callable[[float, Image], Image]] = {each.__name__: each for each in funcs if callable(each)}
        self._funcs = [each.__name__ if callable(each) else each for each in funcs] or pdk.names(default=True)
        # How often each was called, and those that were called last.
        self._calls: Counter[str] = Counter()
        self._kept: OrderedDict[str, pdk.Perturbation] = OrderedDict()
        for name in self._funcs:
            if name not in self._functions:
                pdk.written(name)

    @property
    def funcs(self) -> list[str]:
        """The names of the perturbations, in order."""
        return list(self._funcs)

    def perturbation(self, image: Image, perturbation_name: str = "", intensity: float = 0) -> Image:
        """Perturbs the next frame. Without a name it comes back as it is; an intensity is any number from 0 to 4."""
        if not perturbation_name:
            return image
        if own := self._functions.get(perturbation_name):
            return own(intensity, image)
        sequence = self._kept.get(perturbation_name)
        if sequence is None:
            sequence = self._kept[perturbation_name] = pdk.Perturbation(perturbation_name, seed=self.seed, fps=self.fps)
            self._drop_oldest()
        self._kept.move_to_end(perturbation_name)
        number = self._calls[perturbation_name]
        perturbed = sequence(numpy.ascontiguousarray(image), frame=number, level=float(intensity))
        self._calls[perturbation_name] += 1
        return perturbed

    def _drop_oldest(self) -> None:
        forgetful = [name for name, sequence in self._kept.items() if not sequence.history]
        for name in forgetful[:-_KEPT]:
            del self._kept[name]


def __dir__() -> list[str]:
    return [*__all__, *pdk.names()]


def __getattr__(name: str) -> Callable[..., Image]:
    if name.startswith("_") or name not in pdk.names():
        raise AttributeError(f"there is no perturbation `{name}`; `pdk list perturbation` names them")

    def function(scale, image, *, seed=0):
        # The tool's own documents have the two in either order.
        if isinstance(scale, numpy.ndarray):
            scale, image = image, scale
        return pdk.perturb(image, name, level=scale, seed=seed)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"`{name}` at an intensity from 0 to 4. Every call is a frame of its own."
    globals()[name] = function
    return function
