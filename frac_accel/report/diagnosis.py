"""The page of a diagnosis: the verdict, its evidence, what was considered and what is left."""

from ..budget import WORDS
from ..model.parameters import parameter_fields
from .diagnosis_figures import discrepancy
from .page import Page
from .quantity import cells, percent, rounded, written
from .rivals import rivals
from .signals import sentence

# Share of what is left from which a part of the error budget is shown.
_SHOWN = 0.001
# Share of what is left that a part must have for it to be no noise alone.
_NO_NOISE = 0.1
_VERDICTS = {"consistent": "Consistent", "explained": "Explained",
             "partly_explained": "Partly explained", "unexplained": "Unexplained",
             "undecided": "Undecided", "insufficient_data": "Insufficient data"}


def diagnosis_page(found, provenance=None):
    """Page of a diagnosis, whatever its verdict.

    Parameters
    ----------
    found : Diagnosis
    provenance : dict, optional
        As for `Page`.
    """
    seen = found.evidence
    axis = f", axis {seen.axis}" if seen else ""
    page = Page(f"Diagnosis{axis}: {_VERDICTS[found.verdict].lower()}", provenance)
    _verdict(page.section("Verdict"), found)
    if seen is None:
        _data(page.section("Data"), found)
        return page
    if found.budget:
        _budget(page.section("Error budget"), found)
    discrepancy(page.section("What the simulation gets wrong"), found)
    if found.findings:
        _causes(page.section("Causes"), found)
    if found.suspects:
        _suspects(page.section("Not told apart"), found)
    rivals(page.section("What else was considered"), found)
    _model(page.section("Extended model" if found.findings else "Model in use"), found)
    _left(page.section("What is left"), found)
    _data(page.section("Data"), found)
    return page


def _verdict(section, found):
    section.notice(f"{_VERDICTS[found.verdict]}: {found.reason}.")
    if found.evidence is None:
        section.text("Nothing was fitted, and nothing is said about the sensor. Record what is "
                     "missing, and diagnose again.")
        return
    before, after = found.baseline, found.extended
    section.text(
        f"On held-out data the model in use is wrong by {before['rmse']:.4g} output units (RMS), "
        f"{percent(before['nrmse'])} of the output; {found.noise_words}.")
    section.items(_short(finding) for finding in found.findings)
    if found.findings:
        section.text(
            f"With {'this cause' if len(found.findings) == 1 else 'these causes'} the model is "
            f"wrong by {after['rmse']:.4g} ({percent(after['nrmse'])} of the output) on the same "
            f"data. {_unexplained(found)}")
    for suspect in found.suspects:
        section.text(f"Suspected, not named: {_listed(suspect['causes'])}: {suspect['reason']}.")


def _budget(section, found):
    shares = {(entry["of"], entry["part"]): entry for entry in found.budget}
    models = {"baseline": "model in use"}
    if found.is_extended:
        models["extended"] = "extended model"
    rows = []
    for part, words in WORDS.items():
        entries = [shares.get((of, part)) for of in models]
        if any(entry and entry["share"] >= _SHOWN for entry in entries):
            rows.append([part, words, *(_share(entry) for entry in entries)])
    section.table(["part", "what it is", *models.values()], rows,
                  "Shares of the power that each model leaves, with 95 % intervals. Each is judged "
                  "on stretches that it was not fitted to, so that noise alone gives 0.")
    noise = found.established_noise
    section.text(f"Noise is established: {noise['rms']:.4g} output units (RMS), by {noise['by']}."
                 if noise["by"] else "Nothing in the record shows how large the noise is.")


def _share(entry):
    if entry is None:
        return "–"
    low, high = entry["ci95"]
    return f"{entry['share']:.1%} ({low:.1%} to {high:.1%})"


def _short(finding):
    """One cause in one line."""
    values = []
    for name, entry in finding.as_dict()["parameters"].items():
        values.append(f"{name} {written(entry['value'], entry['std'], entry['unit'])}")
    return (f"{finding.cause} ({', '.join(values)}). {finding.effect.explanation} Without it the "
            f"held-out error is {finding.gain.before:.4g}, with it {finding.gain.after:.4g}: "
            f"{finding.gain.reduction:.1%} less.")


def _unexplained(found):
    known = {entry["part"]: entry["share"] for entry in found.budget
             if entry["of"] == "extended" and entry["part"] != "noise" and entry["ci95"][0] > 0}
    part = max(known, key=known.get, default=None)
    if part and known[part] > _NO_NOISE:
        return (f"What is left is no noise alone: {percent(known[part])} of its power is {part} "
                f"({WORDS[part]}).")
    if not found.unexplained_fraction:
        return "What is left does not differ from noise."
    return (f"{percent(found.unexplained_fraction)} of the error's power above the noise stays "
            "unexplained.")


def _listed(causes):
    return " or ".join(causes)


def _causes(section, found):
    parameters, gains = [], []
    for finding in found.findings:
        for name, entry in finding.as_dict()["parameters"].items():
            parameters.append([finding.cause, name,
                               *cells(entry["value"], entry["std"], entry["unit"])])
        g = finding.gain
        gains.append([finding.cause, f"{g.before:.4g}", f"{g.after:.4g}", f"{g.reduction:.2%}",
                      f"{g.ci95[0]:.2%} to {g.ci95[1]:.2%}", f"{finding.confidence:.3f}"])
    for finding in found.findings:
        section.text(f"{finding.cause}. {finding.effect.explanation}")
        section.items([*map(sentence, finding.evidence),
                       f"To confirm it: {finding.effect.experiment}"])
        if finding.confusable_with:
            section.text(f"Could be mistaken for {_listed(finding.confusable_with)}.")
    section.table(["cause", "parameter", "value", "standard uncertainty",
                   "95 % interval (k = 2)", "unit"], parameters,
                  "Parameters. The uncertainties allow for a residual that is not white.")
    section.table(["cause", "error without it", "error with it", "reduction",
                   "95 % interval", "confidence"], gains,
                  "Gain of each cause: RMS error [output units] on the part of the record that "
                  "the fits have not seen, all other causes present in both. Intervals by a "
                  "bootstrap over blocks. Confidence is against the best set without the cause.")


def _suspects(section, found):
    section.text("These fit, but so do others, or too much stays unexplained to name them. The "
                 "extended model has those only that the verdict says it keeps.")
    section.table(["suspects", "margin", "experiment that tells"],
                  [[_listed(suspect["causes"]), f"{suspect['margin']:.3g}", suspect["experiment"]]
                   for suspect in found.suspects],
                  "Margin: by how many variances σ² of the noise the nearest rival fits worse; 0 "
                  "where too much is left unexplained for a margin to count.")


def _model(section, found):
    axis = found.evidence.axis
    before, after = found.evidence.in_use.axis(axis), found.model.axis(axis)
    own = {(f.cause, name): std for f in found.findings for name, std in f.std.items()}
    old = {effect.cause: effect for effect in before.effects}
    rows = _parameters(after.core.type, after.core, before.core, {})
    for effect in after.effects:
        rows += _parameters(effect.cause, effect, old.get(effect.cause), own)
    if not found.findings:
        rows = [[*row[:3], *row[5:]] for row in rows]
        headers = ["part", "parameter", "value", "unit"]
    else:
        headers = ["part", "parameter", "in use", "extended", "standard uncertainty", "unit"]
    section.table(headers, rows, "Parameters of the model of this axis. A part that acts on the "
                  "core replaces the core's own parameters."
                  if found.findings else "Parameters of the model of this axis.")


def _parameters(part, entity, old, stds):
    """Rows of the table of one core or effect; lists of coefficients are left out."""
    rows = []
    for field in parameter_fields(type(entity)):
        if field.metadata.get("list"):
            continue
        value = getattr(entity, field.name)
        shown, std = rounded(value, stds.get((part, field.name), 0.0))
        before = "–" if old is None else rounded(getattr(old, field.name), 0.0)[0]
        rows.append([part, field.name, before, shown,
                     std or "–", field.metadata["unit"].replace("^2", "²")])
    return rows


def _left(section, found):
    section.text(_unexplained(found) if found.findings or found.verdict == "consistent" else
                 "All of the error above the noise stays unexplained.")
    left = found.evidence.left
    for share, score, words in (
            (left.linear, left.linear_score, "still follows the motion as a linear system would"),
            (left.level, left.level_score, "comes and goes with the size of the motion")):
        section.text(f"Share of the residual's power that {words}: {percent(max(share, 0.0))} "
                     f"({score:.1f} standard deviations from what chance gives).")
    if left.share:
        section.text("Noise does neither. Six standard deviations count as significant.")


def _data(section, found):
    seen, data = found.evidence, found.integrity
    section.items(map(sentence, data.words))
    if not data.words:
        section.text("Stamps and values show nothing unusual: no samples are missing, repeated or "
                     "not finite, no limit is reached.")
    if seen is None:
        section.text(f"{data.samples} samples of the sensor.")
        return
    section.text(f"{seen.samples} samples at {seen.sampling_rate_hz:.6g} Hz "
                 f"({seen.samples / seen.sampling_rate_hz:.4g} s), of which {seen.valid} in both "
                 f"topics and {seen.used} used. Held-out errors are of {seen.held_out_share:.0%} "
                 "of the record, "
                 + ("its last part, by fits to what comes before." if seen.held_out_stretches <= 1
                    else f"{seen.held_out_stretches} stretches of it, by fits to the stretches "
                    "between."))
    sought = "was recorded and is accounted for" if seen.has_temperature else \
        "was not recorded: what depends on it cannot be found"
    section.text(f"The temperature {sought}.")
    if not seen.moves_across:
        section.text("The reference shows no motion across the axis: cross-axis sensitivity "
                     "cannot be found.")
