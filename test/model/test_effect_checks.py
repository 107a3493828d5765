"""All causes keep their contract; a cause that breaks any part of it is told which."""

import ast
import dataclasses
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import frac_accel
from frac_accel import Effect, check_effect
from frac_accel.effect_checks import CHECKS
from frac_accel.errors import ModelError
from frac_accel.model.effects import effect_of, known_effects
from frac_accel.model.effects.base import CONDITIONER, CORE, OFFSET
from frac_accel.model.effects.fit_starts import finite
from frac_accel.model.parameters import parameter

ROOT = Path(__file__).parents[2]
BUILT_IN = {cause: effect for cause, effect in known_effects().items()
            if effect.__module__.startswith("frac_accel.model.effects.")}


@pytest.mark.parametrize("cause", BUILT_IN)
def test_built_in_cause_keeps_the_contract(cause):
    check_effect(BUILT_IN[cause])


class Toy(Effect):
    """What all broken ones below would share were they whole: a constant that is added."""

    cause = "toy"
    stage = OFFSET
    explanation = "A constant is added."
    experiment = "Hold it still."

    def simulate(self, values, circumstances):
        return values + self.size

    def invert(self, values, variance, circumstances):
        return values - self.size, variance


def toy(base=Toy, declared=None, **members):
    """A frozen dataclass with the parameter `size`, and with other members than those of Toy."""
    declared = declared or {"scale": 1.0, "null": 0.0}
    unit = declared.pop("unit", "1")
    cls = type("Broken", (base,), {
        "__doc__": "A toy.", "__annotations__": {"size": float},
        "size": parameter(unit, **declared), **members})
    return dataclasses.dataclass(frozen=True)(cls)


def test_a_whole_toy_passes():
    check_effect(toy())


def running_mean(self, values, circumstances):
    """Memory where there is none: a block's first sample has nothing before it."""
    return values + self.size * np.r_[0.0, values[:-1]]


class Counting(Toy):
    """Counts samples over all blocks, but starts anew where it should go on."""

    def simulate(self, values, circumstances):
        return values + self.size * np.arange(len(values)) / 400

    def invert(self, values, variance, circumstances):
        return values - self.size * np.arange(len(values)) / 400, variance


class Link(Effect):
    """A gain of the conditioner."""

    cause = "toy"
    stage = CONDITIONER
    explanation = "The conditioner has another gain."
    experiment = "Hold it still."

    def transfer_function(self, s):
        return np.full_like(s, 1 + self.size)


def half_law(q0, v0, state, q1, v1, duration, parameters):
    """A force that a step without duration, as the inverse takes it, does not know."""
    return parameters[0] * q1**3 * (duration > 0), state


BROKEN = {
    "declaration": {
        "no place": toy(stage=99),
        "capitals": toy(cause="Toy"),
        "no sentence": toy(explanation="a constant"),
        "no experiment": toy(experiment=""),
        "no unit": toy(declared={"unit": "", "null": 0.0}),
        "no null": toy(declared={"scale": 1.0}),
        "null beyond": toy(declared={"null": -1.0, "minimum": 0}),
        "null of no core": toy(declared={"null": "core"}),
        "scale of nothing": toy(declared={"null": 0.0, "scale": "colour"}),
        "scale below zero": toy(declared={"null": 0.0, "scale": -1.0}),
        "bounds exchanged": toy(declared={"null": 0.0, "minimum": 1, "maximum": -1}),
        "step zero": toy(declared={"null": 0.0, "step": 0.0}),
        "not frozen": type("Soft", (Toy,), {"__doc__": "A toy."}),
        "no effect": int,
        "bare field": dataclasses.dataclass(frozen=True)(type("Bare", (Toy,), {
            "__doc__": "A toy.", "__annotations__": {"size": float}})),
        "fits another": toy(fitted_parameters=classmethod(lambda cls, axis, excited: ["mass"])),
    },
    "documentation": {"no docstring": toy(__doc__=None)},
    "YAML": {
        "cause of another": toy(cause="offset"),
        "alters itself": toy(__post_init__=lambda self: object.__setattr__(
            self, "size", self.size / 2)),
        "refuses all": toy(__post_init__=lambda self: (_ for _ in ()).throw(ModelError("no"))),
    },
    "starts": {
        "beyond bounds": toy(declared={"minimum": 0, "null": 0.0}, starts=classmethod(
            lambda cls, view: [finite(cls(-1.0))])),
        "of another class": toy(starts=classmethod(
            lambda cls, view: [finite(effect_of("offset")(1.0))])),
        "no start": toy(starts=classmethod(lambda cls, view: [cls(1.0)])),
    },
    "finite output": {
        "overflows": toy(simulate=lambda self, values, there: values + np.exp(
            self.size * 1e3) - 1),
        "inverse divides by zero": toy(invert=lambda self, values, variance, there: (
            values - self.size, variance / np.zeros(len(values)))),
        "raises": toy(simulate=lambda self, values, there: values[:, 7]),
    },
    "null value": {
        "jumps": toy(simulate=lambda self, values, there: values + 0.01 + self.size,
                     invert=lambda self, values, variance, there: (
                         values - self.size - 0.01, variance)),
        "link at another value": toy(Link, transfer_function=lambda self, s: np.full_like(
            s, 0.99 + self.size)),
    },
    "blocks": {
        "forgets": toy(simulate=running_mean),
        "counts anew": toy(Counting),
        "changes what it is given": toy(simulate=lambda self, values, there: np.add(
            values, self.size, out=values)),
        "another number": toy(invert=lambda self, values, variance, there: (
            values[:1] - self.size, variance[:1])),
    },
    "inversion of samples": {
        "not at all": toy(invert=Effect.invert),
        "wrong sign": toy(invert=lambda self, values, variance, there: (
            values + self.size, variance)),
        "forgets the variance": toy(simulate=lambda self, values, there: np.round(
            values / abs(self.size)) * abs(self.size), invert=Effect.invert,
            declared={"scale": 0.5, "null": 0.0}),
    },
    "inversion of motion": {
        "a link that leaves nothing": toy(Link, transfer_function=lambda self, s: np.full_like(
            s, 1 - min(1.0, 10 * abs(self.size)))),
        "a force that the inverse does not feel": toy(
            Link, stage=CORE, transfer_function=Effect.transfer_function,
            add_force=lambda self, force: force.with_law(half_law, self.size)),
    },
}


def test_every_check_can_fail():
    assert BROKEN.keys() == CHECKS.keys()


@pytest.mark.parametrize("check, kind", [(check, kind) for check, kinds in BROKEN.items()
                                         for kind in kinds])
def test_a_broken_cause_is_told_what_it_does_not_keep(check, kind):
    with pytest.raises(ModelError) as failure:
        check_effect(BROKEN[check][kind])
    line = str(failure.value)
    assert f": {check}: " in line and "\n" not in line
    assert line.startswith(("toy: ", "offset: ", "Toy: ", "int: "))


# -- a cause of one's own, as the documentation has it


def run(*command, **keywords):
    done = subprocess.run(command, capture_output=True, text=True, **keywords)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


PLUG_IN = """
import sys
import numpy as np
from frac_accel import Corrector, SensorModel, check_effect, simulate
model = SensorModel.load(sys.argv[1])
effect, = model.effects
assert type(effect).__module__ == "firmware_smoothing"
check_effect(type(effect))
motion = np.hanning(2000) * np.sin(2 * np.pi * 23 * np.arange(2000) / 1000)
output = simulate(model, motion, 1000.0, "x")
raw = np.zeros((2000, 3))
raw[:, 0] = output
corrected = Corrector(model, 1000.0).process(np.arange(2000) * 10**6, raw)
error = corrected.values[:, 0] - motion[corrected.index]
print(np.std(output - motion), np.std(error))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Environment in which the documentation's plug-in is installed, as a third party would."""
    pytest.importorskip("setuptools")  # which pip is told not to fetch
    folder = tmp_path_factory.mktemp("plugin")
    # pip builds within the folder
    shutil.copytree(ROOT / "docs" / "own_cause", folder / "source")
    run(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation",
        "--target", folder / "site", folder / "source")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder / "site"), str(ROOT)])}


def test_plug_in_of_the_documentation_as_a_third_party_installs_it(installed, tmp_path):
    model = tmp_path / "m.yaml"
    model.write_text("schema: frac_accel/sensor_model/1\n"
                     "core: {natural_frequency_hz: 200.0, damping_ratio: 0.5}\n"
                     "effects: [{cause: firmware_smoothing, share: 0.4}]\n")
    said = run(sys.executable, "-c", PLUG_IN, model, env=installed, cwd=tmp_path)
    before, after = map(float, said.split())
    assert after < 3e-3 < 0.1 < before
    said = run(sys.executable, "-m", "frac_accel.effect_checks", "firmware_smoothing",
               env=installed, cwd=tmp_path)
    assert said.splitlines()[-1] == "keeps the contract"


def test_walk_through_of_contributing(tmp_path):
    """The lines of CONTRIBUTING.md, in a copy of the tree."""
    for folder in ("frac_accel", "docs", "test"):
        # with what numba has compiled
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    shutil.copy(ROOT / "CONTRIBUTING.md", tmp_path)
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)
    assert len(blocks) == 3
    paths = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    said = run("bash", "-ec", "\n".join(blocks), cwd=tmp_path,
               env={**os.environ, "PATH": paths, "PYTHONPATH": str(tmp_path)})
    assert "keeps the contract" in said and "passed" in said and "failed" not in said


# -- nothing outside a cause's file names it

PACKAGE = Path(frac_accel.__file__).parent
CLASSES = {effect.__name__: cause for cause, effect in BUILT_IN.items()}
# Words that mean other things, too: parameters of an identified model, a part of StaticForce; and
# what no search takes for a cause.
ORDINARY = {"offset", "hysteresis", "empirical_link"}


def named_in(path):
    """Causes that a file names in a text, or whose classes it uses; docstrings may name any."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documented = {id(node.body[0].value) for node in ast.walk(tree)
                  if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
                  and node.body and isinstance(node.body[0], ast.Expr)}
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) in documented:
                continue
            for cause in BUILT_IN:
                if (node.value == cause or ("_" in cause and re.search(rf"\b{cause}\b", node.value))
                        ) and cause not in ORDINARY:
                    yield node.lineno, cause
        name = {ast.Name: "id", ast.Attribute: "attr", ast.alias: "name"}.get(type(node))
        if name and getattr(node, name) in CLASSES.keys() - own:
            yield node.lineno, CLASSES[getattr(node, name)]


# the paper's study has a sensor of its own, as any user has; a cause may declare its partners
@pytest.mark.parametrize("path", sorted(
    set(PACKAGE.rglob("*.py")) - set((PACKAGE / "paper").rglob("*.py"))
    - {PACKAGE / "model" / "effects" / f"{cause}.py" for cause in BUILT_IN}),
                         ids=lambda path: str(path.relative_to(PACKAGE)))
def test_nothing_outside_its_file_names_a_cause(path):
    assert list(named_in(path)) == []
