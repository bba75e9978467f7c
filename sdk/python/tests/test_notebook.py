"""The notebook of the package goes from its first cell to its last."""

from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient", reason="nbclient is missing, which executes notebooks; `pip install nbclient ipykernel`")
nbformat = pytest.importorskip("nbformat")
NEEDED = ("ipykernel", "pandas", "matplotlib")
NOTEBOOK = Path(__file__).parents[1] / "examples/heat_map.ipynb"


def test_the_notebook_ends_in_a_heat_map(tmp_path):
    for module in NEEDED:
        pytest.importorskip(module, reason=f"{module} is missing, which the notebook needs")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert (tmp_path / "heat.png").stat().st_size > 10_000
    assert len((tmp_path / "runs/heat/scenarios.jsonl").read_text().splitlines()) == 3 * (1 + 5 * 3)
