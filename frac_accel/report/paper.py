"""The page on the seed paper: what can be reproduced, what its claims are worth, and the study."""

import numpy as np

from ..paper import STATUSES, domain_correct, models, published
from ..paper.curves import orders
from . import figures
from .page import Page
from .signals import sentence

# Of the many orders of Figures 10 and 11 so many are drawn.
_DRAWN = 8
_DECIBEL = "magnitude_db"


def paper_page(result, provenance=None):
    """Page of a `PaperResult`.

    Parameters
    ----------
    result : PaperResult
    provenance : dict, optional
        As for `Page`.
    """
    page = Page("Accelerometers with fractional orders: the seed paper reproduced and audited",
                provenance)
    _summary(page.section("Summary"), result)
    _substitution(page.section("Where 20.804 % comes from"), result)
    _tables(page.section("Tables 1 to 4 again"), result)
    _figures(page.section("Figures 3 and 8 to 17 again"), result)
    _claims(page.section("The claims, one by one"), result)
    if result.study is not None:
        from .paper_study import study_sections
        study_sections(page, result.study)
    return page


def _summary(section, result):
    section.text(
        "The paper (D. Pietruszczak, Laboratory investigations of dynamic properties of "
        "accelerometers with fractional orders for application in telematic equipment) identifies "
        "a transfer function G(z) of an accelerometer from a sine of 300 Hz, puts its coefficients "
        "into a differential equation of real orders, and concludes that the fractional model is "
        "far more accurate. This page computes its tables and figures again from what it prints, "
        "and tells of each claim what was computed, the verdict and the cause."
        + ("" if result.study is None else " The experiment that would answer the paper's question "
           "follows at the end, from recorded bags of a simulated bench."))
    claims = {claim.key: claim for claim in result.claims}
    constant = claims["constant_error"]
    section.notice(f"The constant error of 20.804 %: {constant.status}. {constant.cause}")
    if result.study is not None:
        section.text("When a fractional model helps, by the study below:")
        section.items(result.study.answer)
    count = {status: sum(claim.status == status for claim in result.claims) for status in STATUSES}
    section.table(["verdict", "claims", "meaning"],
                  [[status, str(count[status]), meaning] for status, meaning in STATUSES.items()],
                  f"Verdicts on {len(result.claims)} claims.")


def _substitution(section, result):
    section.text(
        "Equation (6), in z: G(z) = (0.79196 z² + 0.51435 z) / (z² − 0.6439 z + 0.048034), at "
        "10 kHz. Equation (5), in s, with the same numbers: (0.79196 s² + 0.51435 s) / "
        "(s² − 0.6439 s + 0.048034). Where s is a thousand per second, only the first term of each "
        "counts. Converted properly, z = (1 + sT/2) / (1 − sT/2), the coefficients in s are those "
        "of the table below, and the response stays that of G(z).")
    frequency = np.geomspace(0.1, 4900, 240)
    cores = {"G(z), equation (6)": models.identified(),
             "G(z)'s numbers in equation (5), as in the paper": models.substituted(),
             "G(z) converted to s": models.by_bilinear_transform(models.identified())}
    curves = {}
    for name, core in cores.items():
        response = core.transfer_function(2j * np.pi * frequency)
        curves[name] = (20 * np.log10(np.abs(response)), np.degrees(np.angle(response)))
    section.figure(figures.bode_curves(frequency, curves),
                   "Response of the three. The paper's fractional model is a constant of "
                   f"{20 * np.log10(published.G_NUMERATOR[0]):.3f} dB that has nothing to do with "
                   "G(z).")
    correct = domain_correct(result.claims)
    section.table(
        ["order of s", "denominator", "numerator", "paper: denominator", "paper: numerator"],
        [[f"{order:g}", f"{a:.6g}", f"{b:.6g}", f"{pa:.6g}", f"{pb:.6g}"]
         for order, a, b, pa, pb in zip(
             correct["orders"], correct["denominator_coefficients"],
             correct["numerator_coefficients"], published.G_DENOMINATOR, published.G_NUMERATOR)],
        "Coefficients in s that follow from G(z), beside those that the paper uses.")
    rows = zip(correct["frequency_hz"], correct["amplitude_error_percent"], correct["phase_deg"],
               correct["error_percent"], correct["scaled_error_percent"],
               result.tables["2"].column("fractional_error_percent").computed)
    section.table(
        ["frequency [Hz]", "amplitude error [%]", "phase [°]", "measure [%]",
         "measure, scaled [%]", "measure, substituted [%]"],
        [[f"{f:g}", f"{a:.2f}", f"{p:.2f}", f"{e:.2f}", f"{s:.2f}", f"{w:.4f}"]
         for f, a, p, e, s, w in rows],
        "The domain-correct model against the reference: the error that it really has. Measure: "
        "the paper's, the median relative error of sampled sines; scaled: with gain 1 at 300 Hz; "
        "substituted: of the model that the paper uses.")


def _tables(section, result):
    for number, content in result.tables.items():
        rows = []
        first = published.TABLE_4_V1 if number == "4" else published.FREQUENCY_HZ
        for column in content.columns:
            for name, cells in (("paper", column.printed), ("computed", column.computed)):
                if cells:
                    rows.append([column.name.replace("_percent", " [%]").replace("_", " "), name,
                                 *(f"{cell:.4f}" if number != "4" else f"{cell:.6g}"
                                   for cell in cells)])
        heads = [f"{value:g} Hz" for value in first] if number != "4" else [""] * len(first)
        section.table(["", "", *heads], rows, f"The paper's Table {number}: {content.title}.")
        section.items(f"{column.name.replace('_percent', '').replace('_', ' ')}: {column.status}. "
                      f"{sentence(column.remark)}" for column in content.columns
                      if column.remark)


def _figures(section, result):
    section.text("The paper's figures are pictures; what its text tells of them is compared in the "
                 "captions and among the claims. Pairs that differ in scale only are drawn once: "
                 "drag to zoom.")
    for numbers in (("3",), ("8", "9"), ("10", "11"), ("12", "14", "15"), ("13",), ("16", "17")):
        figure = result.figures[numbers[0] if numbers != ("10", "11") else "11"]
        shown = figure.series
        if numbers == ("10", "11"):
            chosen = orders()[::_DRAWN] + (2.0,)
            shown = {f"v2 = {order:g}": figure.series[f"v2 = {order:g}"]
                     for order in sorted(set(chosen))}
        few = len(shown) <= len(figures.SERIES)
        if _DECIBEL in next(iter(shown.values())):
            drawn = figures.bode_curves(
                figure.x, {name: (parts[_DECIBEL], parts["phase_deg"])
                           for name, parts in shown.items()},
                figures.SERIES if few else figures.shades(len(shown)))
        else:
            drawn = figures.lines(1000 * figure.x,
                                  {name: parts["relative_error_percent"]
                                   for name, parts in shown.items()},
                                  "time [ms]", "relative error [%]", log="y")
        names = " and ".join(numbers) if len(numbers) < 3 else ", ".join(numbers)
        section.figure(drawn, f"The paper's Figure{'s' * (len(numbers) > 1)} {names}: "
                       f"{sentence(figure.title)} {sentence(figure.status)}"
                       + (f" {sentence(figure.remark)}" if figure.remark else ""))


def _claims(section, result):
    section.table(["claim", "where", "verdict"],
                  [[claim.key.replace("_", " "), claim.where, claim.status]
                   for claim in result.claims], "All claims; details follow in the same order.")
    for claim in result.claims:
        section.subheading(claim.key.replace("_", " ").capitalize())
        section.text(f"{sentence(claim.where)} {claim.claim}")
        section.items([f"{sentence(claim.status)} {claim.cause}", f"Computed: {claim.evidence}"])
