"""NSGA-II of pymoo on the problems of `tests/benches/search/fronts.rs`: the hypervolumes of its last populations, which go to
`tests/benches/search/pymoo.json`.

    python -m venv /tmp/pymoo && /tmp/pymoo/bin/pip install pymoo==0.6.2
    /tmp/pymoo/bin/python tests/benches/pymoo_reference.py
"""

import json
import pathlib
import statistics

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.operators.repair.rounding import RoundingRepair
from pymoo.operators.sampling.rnd import IntegerRandomSampling
from pymoo.optimize import minimize
from pymoo.problems import get_problem

POPULATION, GENERATIONS, SEEDS = 75, 200, 100


class Between(Problem):
    """The squared distances from two points of whole numbers, neither of which is at a bound."""

    def __init__(self):
        super().__init__(n_var=8, n_obj=2, xl=0, xu=100, vtype=int)

    def _evaluate(self, x, out, *args, **kwargs):
        i = np.arange(8)
        first, second = 20 + 3 * i, 85 - 5 * i
        out["F"] = np.column_stack([(((x - aim) / 100.0) ** 2).sum(axis=1) for aim in (first, second)])


def algorithm(name):
    if name == "integer":
        return NSGA2(
            pop_size=POPULATION,
            sampling=IntegerRandomSampling(),
            crossover=SBX(eta=15, prob=0.9, vtype=float, repair=RoundingRepair()),
            mutation=PM(eta=20, vtype=float, repair=RoundingRepair()),
        )
    return NSGA2(pop_size=POPULATION)


problems = {
    "zdt1": (get_problem("zdt1"), [1.1, 1.1]),
    "zdt2": (get_problem("zdt2"), [1.1, 1.1]),
    "zdt3": (get_problem("zdt3"), [1.1, 1.1]),
    "dtlz2": (get_problem("dtlz2", n_var=12, n_obj=3), [1.1, 1.1, 1.1]),
    "integer": (Between(), [6.0, 6.0]),
}
written = {}
for name, (problem, reference) in problems.items():
    hypervolume = HV(ref_point=np.array(reference))
    runs = (minimize(problem, algorithm(name), ("n_gen", GENERATIONS), seed=seed) for seed in range(SEEDS))
    written[name] = [round(float(hypervolume(run.F)), 6) for run in runs]
    print(name, min(written[name]), statistics.median(written[name]), max(written[name]))
lines = ",\n".join(f'  "{name}": {json.dumps(volumes)}' for name, volumes in written.items())
pathlib.Path(__file__).with_name("search").joinpath("pymoo.json").write_text(f"{{\n{lines}\n}}\n")
