"""`python3 -m pdk_perturb.serve driver|simulator FILE MODULE:CLASS ARGUMENTS`: what `pdk.driver` and `pdk.simulator` have started."""

import importlib
import importlib.util
import json
import sys
from pathlib import Path


def _load(file, module):
    """The module in a file, found as where its class was named: from the folder in which its package lies."""
    file = Path(file)
    parts = module.split(".")
    whole = file.with_suffix("") if file.stem != "__init__" else file.parent
    if list(whole.parts[-len(parts) :]) == parts:
        sys.path.insert(0, str(Path(*whole.parts[: -len(parts)])))
        return importlib.import_module(module)
    # A copy elsewhere, as other machines have it.
    sys.path.insert(0, str(file.parent))
    spec = importlib.util.spec_from_file_location(parts[-1], file)
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[parts[-1]] = loaded
    spec.loader.exec_module(loaded)
    return loaded


class _Driver:
    """A driver's object as the function that pdk_driver takes."""

    def __init__(self, driver):
        self._driver = driver
        self._scenario = None

    def __call__(self, frame, context):
        if context.scenario != self._scenario:
            self._scenario = context.scenario
            if hasattr(self._driver, "reset"):
                self._driver.reset()
        return self._driver.drive(frame, context)


def main(kind, file, place, arguments):
    module, name = place.split(":")
    found = _load(file, module)
    for part in name.split("."):
        found = getattr(found, part)
    arguments = json.loads(arguments)
    if kind == "driver":
        import pdk_driver

        pdk_driver.serve(_Driver(found(**arguments)))
    else:
        import pdk_simulator

        pdk_simulator.serve(lambda camera: found(camera, **arguments))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except ModuleNotFoundError as missing:
        if missing.name == "iceoryx2":
            sys.exit("the package iceoryx2 is missing; install it with `pip install 'pdk-perturb[driver]'`")
        raise
