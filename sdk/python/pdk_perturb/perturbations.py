"""One function for each perturbation, with its parameters: they return what `pdk.perturb` and others take.

    from pdk_perturb import perturb, perturbations

    foggy = perturb(image, perturbations.fog_mapping(level=2, strength=0.3), seed=7)
    both = perturb(image, [perturbations.fog_filter(1), perturbations.gaussian_noise(2, probability=0.5)])

Plugins, clips and Lua files that are found have a function each as well. `perturbations.pyi` declares those of pdk itself, for editors
and type checkers. What `parameters` does not allow is refused where the perturbation is used.
"""

import inspect as _inspect

import pdk_perturb as _pdk
from pdk_perturb._settings import MODIFIERS as _MODIFIERS

#: What every perturbation takes besides its level and its own parameters.
MODIFIERS = tuple(_MODIFIERS)


def __dir__():
    return ["MODIFIERS", *_pdk.names()]


def __getattr__(name):
    for entry in _pdk.catalog():
        if entry["description"]["name"] == name:
            function = globals()[name] = _function(entry["description"])
            return function
    raise AttributeError(f"there is no perturbation `{name}`; `pdk list perturbation` names them")


def _function(description):
    """The function of a perturbation, from what it says of itself."""
    name = description["name"]
    own = [parameter["name"] for parameter in description["parameters"]]
    allowed = [*own, *MODIFIERS]

    def perturbation(level=2.0, **parameters):
        for given in parameters:
            if given not in allowed:
                raise TypeError(f"{name}() has no parameter `{given}`; it has level, {', '.join(allowed)}")
        given = {key: value for key, value in parameters.items() if value is not None}
        return {"name": name, "level": level, **given}

    kind = _inspect.Parameter
    named = [kind(each, kind.KEYWORD_ONLY, default=None) for each in allowed]
    first = kind("level", kind.POSITIONAL_OR_KEYWORD, default=2.0)
    perturbation.__signature__ = _inspect.Signature([first, *named])
    perturbation.__name__ = perturbation.__qualname__ = name
    perturbation.__module__ = __name__
    lines = [description["doc"] + ".", "", "level: any number from 0 to 4, or a course over time"]
    lines += [f"{each['name']}: {each['doc']}" for each in description["parameters"]]
    perturbation.__doc__ = "\n".join(lines)
    return perturbation
