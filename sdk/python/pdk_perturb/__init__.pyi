from pathlib import Path
from typing import Any

from pdk_perturb._pdk import Applied as Applied
from pdk_perturb._pdk import Chain as Chain
from pdk_perturb._pdk import Error as Error
from pdk_perturb._pdk import Image as Image
from pdk_perturb._pdk import Perturbation as Perturbation
from pdk_perturb._pdk import __version__ as __version__
from pdk_perturb._pdk import identity as identity
from pdk_perturb._pdk import perturb as perturb
from pdk_perturb._pdk import search as search
from pdk_perturb._pdk import written as written
from pdk_perturb._settings import RunSettings as RunSettings
from pdk_perturb._settings import SessionSettings as SessionSettings
from pdk_perturb.gradient import Gradient as Gradient
from pdk_perturb.programs import driver as driver
from pdk_perturb.programs import simulator as simulator
from pdk_perturb.records import Record as Record
from pdk_perturb.runs import Session as Session
from pdk_perturb.runs import run as run

def executable() -> Path:
    """The command `pdk` of this package, for `subprocess`."""

def catalog(kind: str | None = "perturbation") -> list[dict[str, Any]]:
    """What components say of themselves, a dictionary each: what `pdk list KIND --json` writes.

    `kind` is perturbation, simulator, driver, dataset, saliency, mask or search; None for all. `description` has the name, the
    parameters and what they mean, `file` where it comes from.
    """

def names(default: bool = False) -> list[str]:
    """The names of all perturbations; with `default` those of the default set only, which `pdk preview` shows."""
