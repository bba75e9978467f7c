"""Writes pdk_perturb/perturbations.pyi from what the components of pdk say of themselves.

    python3 sdk/python/stubs.py target/release/pdk            # writes it anew
    python3 sdk/python/stubs.py target/release/pdk --check    # ends with 1 where it is stale
"""

import argparse
import json
import os
import runpy
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

FILE = Path(__file__).parent / "pdk_perturb" / "perturbations.pyi"

HEAD = '''\
# Written by stubs.py from what the perturbations say of themselves; changes here are lost.
"""One function for each perturbation of pdk, with its parameters: they return what `pdk.perturb` and others take."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

#: A perturbation with its intensity, parameters and modifiers.
Applied: TypeAlias = dict[str, Any]
#: Any number from 0 to 4, or a course over time.
Level: TypeAlias = float | Mapping[str, Any]
#: A number, or one for each of the five levels.
ByLevel: TypeAlias = float | Sequence[float]

MODIFIERS: tuple[str, ...]
'''

# What every perturbation takes besides, with its type; the documentation says what it means.
MODIFIERS = runpy.run_path(str(FILE.with_name("_settings.py")))["MODIFIERS"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pdk", help="the executable")
    parser.add_argument("--check", action="store_true", help="write nothing, and end with 1 where the file is stale")
    options = parser.parse_args()
    text = declarations(described(options.pdk))
    if not options.check:
        FILE.write_text(text)
    elif FILE.read_text() != text:
        sys.exit(f"{FILE} is stale: run `python3 {sys.argv[0]} {options.pdk}`")


def described(executable):
    """The descriptions of pdk's own perturbations."""
    command = [executable, "list", "perturbation", "--json"]
    with tempfile.TemporaryDirectory() as nothing:
        alone = {**os.environ, "XDG_DATA_HOME": nothing, "PDK_PLUGIN_PATH": ""}
        listed = subprocess.run(command, env=alone, stdout=subprocess.PIPE, check=True)
    return [entry["description"] for entry in json.loads(listed.stdout)]


def declarations(descriptions):
    return HEAD + "".join(declaration(each) for each in sorted(descriptions, key=lambda each: each["name"]))


def declaration(description):
    lines = [f"    {each['name']}: {annotation(each)} | None = None,\n" for each in description["parameters"]]
    lines += [f"    {name}: {kind} | None = None,\n" for name, kind in MODIFIERS.items()]
    signature = f"\ndef {description['name']}(\n    level: Level = 2.0,\n    *,\n{''.join(lines)}) -> Applied:\n"
    return signature + documentation(description)


def annotation(parameter):
    kind = parameter["type"]
    if kind == "choice":
        return f"Literal[{', '.join(json.dumps(option) for option in parameter['options'])}]"
    if kind in ("number", "integer") and parameter.get("levels"):
        return "ByLevel"
    return {
        "number": "float",
        "integer": "int",
        "boolean": "bool",
        "text": "str",
        "path": "str | PathLike[str]",
        "json": "Any",
    }[kind]


def documentation(description):
    paragraphs = [description["doc"] + "."]
    for parameter in description["parameters"]:
        paragraphs.append(f"{parameter['name']}: {parameter['doc']}{details(parameter)}.")
    if source := description.get("source"):
        paragraphs.append(f"Source: {source}.")
    if not description.get("default", True):
        paragraphs.append("Not part of the default set.")
    wrapped = []
    for number, paragraph in enumerate(paragraphs):
        paragraph = paragraph.replace("\\", "\\\\").replace('"""', "'''")
        hanging = "        " if number else "    "
        lines = textwrap.wrap(paragraph, 116, initial_indent="    ", subsequent_indent=hanging, break_on_hyphens=False)
        wrapped.append("\n".join(lines))
    first, rest = wrapped[0].strip(), wrapped[1:]
    if not rest:
        return f'    """{first}"""\n'
    return f'    """{first}\n\n' + "\n".join(rest) + '\n    """\n'


def details(parameter):
    """Unit, range and default of a parameter, in brackets."""
    parts = []
    if unit := parameter.get("unit"):
        parts.append(unit)
    low, high = parameter.get("min"), parameter.get("max")
    # Without a limit it is the smallest or largest number that there is.
    if low is not None and abs(low) < 1e15:
        parts.append(f"{low:g} to {high:g}" if abs(high) < 1e15 else f"at least {low:g}")
    if levels := parameter.get("levels"):
        parts.append("by level " + ", ".join(f"{value:g}" for value in levels))
    elif parameter.get("default") not in (None, ""):
        parts.append(f"default {json.dumps(parameter['default'])}")
    return f" ({'; '.join(parts)})" if parts else ""


if __name__ == "__main__":
    main()
