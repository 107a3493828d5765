"""One case: inputs in a folder, of which one is damaged, and the command that gets them."""

import json

import numpy as np
import yaml

from frac_accel.io.bag import Samples, write_bag
from frac_accel.paper import BAGS

from . import damage, seeds

# How often each command has its turn; those without an entry read no such input, with the reason.
SHARES = {"correct": 0.3, "simulate": 0.2, "validate": 0.2, "identify": 0.15, "diagnose": 0.1,
          "budget": 0.05}
# Those whose number leaves so much when it is divided by that.
BY_NUMBER = {"report": (0, 10), "paper": (17, 100)}
WITHOUT = {"bench": "it reads no file",
           "convert": "it reads as the others do, and test_formats damages the other formats",
           "layout": "it reads no file", "watch": "it reads topics",
           "completion": "it reads no file",
           "fleet": "its workers run the other commands; a bag that fails is a row, not an end"}
DAMAGES = {"bag octets": 0.2, "bag records": 0.25, "bag samples": 0.2, "metadata": 0.08,
           "model tree": 0.17, "model text": 0.07, "nothing": 0.03}


def make(number, folder):
    """Write the inputs of a case.

    Returns
    -------
    arguments : list of str
        Of the command.
    outputs : list of Path
        What it is to write.
    what : str
        Which damage it is.
    """
    rng = np.random.default_rng(number)
    for name, special in (("report", _report), ("paper", _paper)):
        rest, divisor = BY_NUMBER[name]
        if number % divisor == rest:
            return special(folder, rng)
    verb = _choice(SHARES, rng)
    what = _choice(DAMAGES, rng)
    if verb == "identify" and what.startswith("model"):
        what = "bag samples"
    bag = _bag(what, folder, rng)
    (folder / "m.yaml").write_bytes(model_file(what, rng))
    arguments, outputs = [verb, str(bag)], []
    if verb != "identify" and not (verb in ("diagnose", "budget") and rng.random() < 0.3
                                   and not what.startswith("model")):
        arguments += ["--model", str(folder / "m.yaml")]

    def add(option, name):
        outputs.append(folder / name)
        arguments.extend([option, str(outputs[-1])])

    if verb in ("correct", "simulate"):
        add("-o", "out.mcap" if rng.random() < 0.7 else "out")
    if verb == "identify":
        add("-o", "out.yaml")
        if rng.random() < 0.8:
            arguments += ["--structure", str(rng.choice(["arx", "oscillator", "fractional"]))]
    if verb == "diagnose" and rng.random() < 0.5:
        add("--extended-model", "extended.yaml")
    if verb in ("identify", "diagnose") and rng.random() < 0.1:
        add("--report", "r.html")
    if rng.random() < 0.5:
        add("--json", "r.json")
    if verb in ("identify", "validate", "diagnose") and rng.random() < 0.3:
        arguments += ["--axis", str(rng.choice(list("xyz")))]
    return arguments, outputs, f"{verb}, {what}"


def _report(folder, rng):
    results = seeds.results()
    data = results[rng.integers(len(results))]
    source, page = folder / "r.json", folder / "r.html"
    if rng.random() < 0.7:
        what = "result tree"
        content = json.dumps(damage.branch(data, rng)).encode()
    else:
        what = "result text"
        content = damage.text(json.dumps(data, indent=1), rng)
    source.write_bytes(content)
    return ["report", str(source), "-o", str(page)], [page], f"report, {what}"


def _paper(folder, rng):
    """Outputs that cannot be, or a bag that cannot be read: with bags that can, the study takes
    minutes."""
    outputs, arguments = [folder / "p.json"], ["paper", "--json", str(folder / "p.json")]
    if rng.random() < 0.3:
        outputs.append(folder / "p.html")
        arguments += ["--report", str(outputs[1])]
    if rng.random() < 0.5:
        what = _choice(dict.fromkeys(damage.PLACES, 1), rng)
        damage.place(outputs[rng.integers(len(outputs))], what, rng)
        return [*arguments, "--quick"], outputs, f"paper, output {what}"
    what = _choice(dict.fromkeys(damage.UNREADABLE, 1), rng)
    bags = sorted(BAGS.glob("paper_bench*.mcap"))
    hit = bags[rng.integers(len(bags))]
    for bag in bags:
        if bag != hit:
            (folder / bag.name).symlink_to(bag)
    damage.unreadable(folder / hit.name, hit.read_bytes(), what, rng)
    return [*arguments, "--bags", str(folder)], outputs, f"paper, bag {what}"


def _choice(shares, rng):
    weights = np.array(list(shares.values()))
    return str(rng.choice(list(shares), p=weights / weights.sum()))


def _bag(what, folder, rng):
    if what == "metadata":
        bag = folder / "bag"
        write_bag(bag, seeds.topics_of(rng))
        metadata = bag / "metadata.yaml"
        if rng.random() < 0.5:
            content = damage.text(metadata.read_text(), rng)
        else:
            content = seeds.text_of(damage.tree(yaml.safe_load(metadata.read_text()), rng)).encode()
        metadata.write_bytes(content)
        return bag
    bag = folder / "in.mcap"
    if what == "bag samples":
        topics = seeds.topics_of(rng)
        hit = [name for name, content in topics.items() if isinstance(content, Samples)]
        if rng.random() < 0.6:
            hit = [hit[rng.integers(len(hit))]]
        both = int(rng.integers(2**32))
        # the same damage to both topics goes deeper: they still belong together
        for name in hit:
            topics[name] = damage.samples(topics[name], np.random.default_rng(both))
        write_bag(bag, topics)
        return bag
    seeds.BAGS[rng.integers(len(seeds.BAGS))](bag, rng)
    if what == "bag octets":
        bag.write_bytes(damage.octets(bag.read_bytes(), rng))
    elif what == "bag records":
        bag.write_bytes(damage.records(bag.read_bytes(), rng))
    return bag


def model_file(what, rng):
    """Octets of a model's file, with this damage or a whole one."""
    model = seeds.PLAIN if not what.startswith("model") and rng.random() < 0.5 else (
        seeds.model_of(rng))
    if what == "model tree":
        try:
            return seeds.text_of(damage.tree(model, rng)).encode("utf-8", "surrogatepass")
        except yaml.YAMLError:
            return seeds.text_of(model).encode()
    if what == "model sizes":
        model = damage.sizes(model, rng)
    words = seeds.text_of(model)
    return damage.text(words, rng) if what == "model text" else words.encode()
