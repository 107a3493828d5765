"""The paper's experiment done properly.

A bench as in the paper's Figure 1, recorded to bags; models identified from noise that excites
enough, and judged on sines that they have not seen; classical against fractional with the same
number of parameters, orders swept as in the paper and optimised; and a map over true orders, noise
levels and bandwidths.
"""

import dataclasses

from ...identification.judge.residual_tests import p_words
from ...record import Record
from .answer import answer
from .bench import SENSORS, SWEPT, bags_of, diagnosed, judge_sensor, refusal
from .map import VERDICTS, cases, make_map, workers
from .sweep import damping_orders, table_4

__all__ = ["VERDICTS", "Study", "run_study"]


@dataclasses.dataclass(frozen=True)
class Study:
    """Result of `run_study`.

    Attributes
    ----------
    bags : list of Path
    bench : dict of str to BenchResult
    refusal : str
        What ``identify`` says to a sine of 300 Hz.
    diagnoses : dict of str to dict
        What ``diagnose`` says of each sensor's noise record, as in its result file.
    cells : list of Cell
        The map.
    answer : list of str
        Five sentences.
    """

    bags: list
    bench: dict
    refusal: str
    diagnoses: dict
    cells: list
    answer: list

    def words(self):
        """The study in a few lines."""
        lines = []
        for result in self.bench.values():
            lines.append(f"{result.words}: identify chooses {result.chosen}")
            for name, judged in result.judged.items():
                low, high = judged.rms_interval
                lines.append(
                    f"  {name:20} {result.fitted[name].parameters} parameters, held-out error "
                    f"{100 * judged.rms:.4f} % ({100 * low:.4f} to {100 * high:.4f} %), noise "
                    f"floor {100 * judged.floor:.4f} %, {p_words(judged.p_value)}")
        counts = {verdict: sum(cell.verdict == verdict for cell in self.cells)
                  for verdict in VERDICTS}
        for name, found in self.diagnoses.items():
            lines.append(f"diagnose, {name} sensor: {found['verdict']}" + "".join(
                f"; {finding['cause']}" for finding in found["findings"]))
        lines.append(f"map of {len(self.cells)} cells: " + ", ".join(
            f"{verdict} in {count}" for verdict, count in counts.items()))
        return lines + self.answer

    def as_dict(self):
        """Plain numbers and lists."""
        return {"bags": [path.name for path in self.bags],
                "bench": {name: result.as_dict() for name, result in self.bench.items()},
                "one_sine": self.refusal, "diagnoses": self.diagnoses,
                "map": [cell.as_dict() for cell in self.cells],
                "answer": self.answer}


def run_study(bags=None, progress=lambda words, share: None):
    """Do the study.

    Parameters
    ----------
    bags : str or Path, optional
        Folder of the bench's bags; default: those that come with the package.
    progress : callable
        Called with a few words and the share that is done.

    Returns
    -------
    Study

    Raises
    ------
    BagError
        If a bag is missing or cannot be read.
    """
    paths = bags_of(bags)
    # a bag that is of no use is told now, not after minutes
    for group in paths.values():
        for path in group:
            Record.load(path)
    # a cell of the map takes as long as about ten models with given orders
    swept = len(SWEPT) * (len(damping_orders()) + len(table_4()))
    total, done = 10 * len(cases()) + swept, 0

    def advance(words, steps):
        nonlocal done
        done += steps
        progress(words, min(done / total, 1.0))
    bench = {}
    with workers() as pool:
        named = {name: pool.submit(diagnosed, paths[name][0]) for name in SENSORS}
        for name in SENSORS:
            words = f"bench: {name} sensor"
            progress(words, done / total)
            bench[name] = judge_sensor(name, paths[name], lambda words=words: advance(words, 1))
        told = refusal(paths["one_sine"][0])
        cells = make_map(pool, lambda: advance("map of virtual records", 10))
        diagnoses = {name: future.result() for name, future in named.items()}
    return Study([path for group in paths.values() for path in group], bench, told, diagnoses,
                 cells, answer(bench, cells, told))
