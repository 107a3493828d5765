"""A study of the bench's bags with few orders and a made-up map, for tests of pages and files."""

import numpy as np

from frac_accel.paper.study import Study
from frac_accel.paper.study.answer import answer
from frac_accel.paper.study.bench import SENSORS, bags_of, diagnosed, judge_sensor, refusal
from frac_accel.paper.study.candidates import CLASSICAL, FRACTIONAL, LOW_PASS, SLOPE
from frac_accel.paper.study.map import Cell, cases
from frac_accel.paper.study.virtual import Outcome

ORDERS = ([(0.94, 2.0), (1.0, 2.0), (1.06, 2.0), (2.0, 2.0)], [(1.0, 2.0), (1.04, 1.96)])


def sample_study(bags):
    """Study whose bench is judged and whose map is drawn at random."""
    paths = bags_of(bags)
    bench = {name: judge_sensor(name, paths[name], orders=ORDERS) for name in SENSORS}
    rng = np.random.default_rng(8)
    names = CLASSICAL, FRACTIONAL, LOW_PASS, SLOPE

    def drawn(case):
        errors = dict(zip(names, rng.lognormal(-4, 1, 4)))
        return Outcome(case, errors, errors, dict.fromkeys(names, 0.01), 0.01, case.order, 0.01)
    cells = [Cell(group[0], tuple(map(drawn, group))) for group in cases()]
    told = refusal(paths["one_sine"][0])
    return Study([path for group in paths.values() for path in group], bench, told,
                 {"lagging": diagnosed(paths["lagging"][0])}, cells, answer(bench, cells, told))
