"""Perturbs camera images: arrays in, perturbed arrays out, with the bytes of `pdk perturb` on the command line.

    import pdk_perturb as pdk

    foggy = pdk.perturb(image, "fog_mapping@2", seed=7)

An image is an array of height x width x 3, dtype uint8, RGB. A perturbation is a text as on the command line
(`"fog_mapping@2,strength=0.3"`), a dictionary (`{"name": "fog_mapping", "level": 2}`), what a function of `pdk.perturbations`
returns, or a list of such, which are applied one after the other.

Whole experiments run from Python too, in processes of their own: `pdk.run` runs a pipeline, and a `pdk.Session` drives scenarios with a
driver in the closed loop of a simulator, both of which may be classes; a `pdk.Record` reads what was recorded.

If arrays are perturbed, components run in the interpreter's process. What one of them reports is a `pdk.Error`; one that crashes ends the interpreter, where
the command line would name it. `pdk check PLUGIN.so` finds such plugins.
"""

import json as _json
from pathlib import Path as _Path

from pdk_perturb import _pdk
from pdk_perturb._pdk import (
    Error,
    Perturbation,
    __version__,
    identity,
    move_boxes,
    move_points,
    perturb,
    search,
    source_pixels,
    written,
)
from pdk_perturb._settings import RunSettings, SessionSettings

# Set where a run fails that has recorded something.
Error.record = None

__all__ = [
    "Error",
    "Gradient",
    "Perturbation",
    "Record",
    "RunSettings",
    "Session",
    "SessionSettings",
    "catalog",
    "driver",
    "executable",
    "identity",
    "move_boxes",
    "move_points",
    "names",
    "perturb",
    "run",
    "search",
    "simulator",
    "source_pixels",
    "written",
]


def executable():
    """The command `pdk` of this package, for `subprocess`."""
    return _Path(__file__).parent / "installation" / "bin" / "pdk"


if not executable().is_file():
    raise ImportError(
        f"the package pdk-perturb is not complete: {executable()} is missing; install the wheel that `cargo run --release -p pdk-dist -- --wheel` makes"
    )
_pdk.install(executable())


def catalog(kind="perturbation"):
    """What components say of themselves, a dictionary each: what `pdk list KIND --json` writes.

    `kind` is perturbation, simulator, driver, dataset, saliency, mask or search; None for all. `description` has the name, the
    parameters and what they mean, `file` where it comes from.
    """
    entries = _json.loads(_pdk.catalog())
    return [entry for entry in entries if kind in (None, entry["description"]["kind"])]


def names(default=False):
    """The names of all perturbations; with `default` those of the default set only, which `pdk preview` shows."""
    described = [entry["description"] for entry in catalog()]
    return [each["name"] for each in described if each.get("default", True) or not default]


from pdk_perturb.gradient import Gradient  # noqa: E402
from pdk_perturb.programs import driver, simulator  # noqa: E402
from pdk_perturb.records import Record  # noqa: E402
from pdk_perturb.runs import Session, run  # noqa: E402
