from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy
from numpy.typing import NDArray

Image: TypeAlias = NDArray[numpy.uint8]
#: A perturbation: a text as on the command line, or a dictionary.
Applied: TypeAlias = str | Mapping[str, Any]
#: Perturbations that are applied one after the other.
Chain: TypeAlias = Applied | Sequence[Applied]

__version__: str

class Error(RuntimeError):
    """What went wrong, in one sentence."""

    #: failed, late, lost, nonsense, configuration or panic.
    kind: str
    #: Of a run that failed: the folder of what was recorded until then, where something was.
    record: Path | None

class Perturbation:
    """Perturbs the frames of a sequence, one after the other: what moves moves on, and what is drawn once a sequence stays.

    The output of a frame follows from it, its number, its time and the seed. One object serves one thread at a time.
    """

    def __init__(self, perturbation: Chain, *, seed: int = 0, fps: float = 20.0, **parameters: Any) -> None:
        """`fps` is the number of frames a second, from which their times follow."""

    def __call__(
        self,
        image: Image,
        *,
        frame: int | None = None,
        time: float | None = None,
        speed: float | None = None,
        level: float | Mapping[str, Any] | None = None,
        labels: tuple[list[str], NDArray[numpy.uint8]] | None = None,
        distances: NDArray[Any] | None = None,
        out: Image | None = None,
    ) -> Image:
        """Perturbs the next frame, or the one of number `frame` at `time` seconds.

        `level` is the intensity of all perturbations at this frame, in place of their own. `speed` is the vehicle's in metres a second, for
        networks that want it. `labels` and `distances` are what `where` goes by:
        names and the place of one for each pixel, and distances in metres. Writes to `out` where it is given.
        """

    def reset(self, seed: int | None = None) -> None:
        """Begins another sequence at frame 0, with another seed where one is given. What was prepared is kept."""

    @property
    def perturbations(self) -> list[str]:
        """The perturbations as they are written on the command line."""

    @property
    def seed(self) -> int:
        """The seed of the sequence."""

    @property
    def frame(self) -> int:
        """The number of the frame that comes next."""

    @property
    def fps(self) -> float:
        """Frames a second."""

    @property
    def history(self) -> int:
        """How many frames before a frame decide what becomes of it: 0 for most perturbations."""

def move_points(
    points: Any,
    perturbation: Chain,
    *,
    size: tuple[int, int],
    seed: int = 0,
    frame: int = 0,
    time: float = 0.0,
    **parameters: Any,
) -> NDArray[numpy.float64]:
    """Moves points as `perturb` with the same arguments moves the pixels of an image.

    `points` are rows of x and y in pixels from the upper left corner of the image: the centre of the first pixel is 0.5, 0.5. `size` is
    height and width. A result may lie outside of the image. A perturbation that does not say what it does to the places of things is an
    `Error`.
    """

def move_boxes(
    boxes: Any,
    perturbation: Chain,
    *,
    size: tuple[int, int],
    seed: int = 0,
    frame: int = 0,
    time: float = 0.0,
    **parameters: Any,
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
    """Moves boxes, rows of left, top, right and bottom, as `move_points` moves points.

    The results are the hulls of what were the boxes, cut off at the edges of the image, and the share of each hull that is in the image.
    """

def source_pixels(
    perturbation: Chain,
    *,
    size: tuple[int, int],
    seed: int = 0,
    frame: int = 0,
    time: float = 0.0,
    **parameters: Any,
) -> NDArray[numpy.int64]:
    """For each pixel of the perturbed image the place, row by row, of the pixel of the image that is seen there; -1 for what comes from
    outside. A mask is moved by `numpy.where(places < 0, 0, mask.ravel()[places])`.
    """

def perturb(
    image: Image,
    perturbation: Chain,
    *,
    seed: int | Sequence[int] | None = None,
    frame: int = 0,
    time: float = 0.0,
    labels: tuple[list[str], NDArray[numpy.uint8]] | None = None,
    distances: NDArray[Any] | None = None,
    out: Image | None = None,
    threads: int = 1,
    **parameters: Any,
) -> Image:
    """Perturbs an image: the bytes of `pdk perturb IMAGE --with PERTURBATION --seed SEED`.

    `image` has height x width x 3 values, RGB. It is read in place where its pixels lie one behind the other, windows of larger
    images included, and copied otherwise; it is never changed. The result is a new array, or `out`. Other threads of Python go on
    meanwhile.

    A batch has one dimension more in front. Its images have the seeds `seed`, `seed` + 1 and so on, or those of a list, and are
    spread over `threads`.

    `frame` and `time` say which moment of a sequence the image stands for. `labels` and `distances` are what `where` goes by: names and
    the place of one for each pixel, and distances in metres. Further keyword arguments are parameters and modifiers of the
    perturbation: `perturb(image, "fog_mapping", level=2, strength=0.3, probability=0.5)`.
    """

def search(plugins: Sequence[str | PathLike[str]] = (), drop_ins: Sequence[str | PathLike[str]] = ()) -> None:
    """Looks for components in these folders, besides pdk's own and the usual places, from now on: as `--plugins` and `--drop-ins`.

    `plugins` are folders with plugins and perturbations in Lua, or such files; `drop_ins` are folders with files that become components, such as clips.
    Names and parameters of components are read now: call it again after they have changed. A file whose content alone has changed is read
    again without that.
    """

def written(perturbation: Chain, **parameters: Any) -> list[str]:
    """Perturbations as they are written on the command line, one text for each."""

def identity(image: NDArray[numpy.uint8]) -> int:
    """A number from 0 to 2^53 - 1 that follows from an array's shape and values alone: a seed that is the image's own."""

def install(executable: str | PathLike[str]) -> None: ...
def catalog() -> str: ...
def searched() -> tuple[list[Path], list[Path]]: ...
def ledger(record: str | PathLike[str]) -> list[str]: ...
def verdict(cause: str) -> str: ...
def trace_steps(trace: str | PathLike[str], scenario: str, digest: str) -> dict[str, NDArray[Any]]: ...
def trace_events(trace: str | PathLike[str], scenario: str, digest: str) -> list[tuple[float, str]]: ...
def trace_frames(
    trace: str | PathLike[str], scenario: str, digest: str, topic: str
) -> tuple[NDArray[numpy.uint64], NDArray[numpy.uint8]]: ...
