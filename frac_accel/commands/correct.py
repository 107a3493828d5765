"""Correct raw acceleration with a sensor model; the same kernel as the corrector node.

The output bag holds the corrected samples on /imu/data, and the raw and reference topics as they
are. Samples that cannot be corrected (the filter's warm-up, bad stamps or values) are counted.
"""

from pathlib import Path

from ..errors import BagError
from ..io.topics import CORRECTED_TOPIC
from ._common import (
    add_bag,
    add_filter,
    add_json,
    add_model,
    add_report,
    add_temperature,
    add_topics,
    filter_wishes,
    open_bag,
    printable,
    progress,
    require_report,
    write_json,
    write_page,
)

EXAMPLES = """
frac_accel correct drive.mcap --model sensor.yaml -o corrected.mcap
frac_accel correct drive.mcap --model sensor.yaml -o corrected.mcap --bandwidth 80 --max-delay 0.02
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    add_model(parser)
    parser.add_argument("-o", "--output", required=True, metavar="OUT.mcap", help="bag to write")
    add_topics(parser, axis=False)
    add_temperature(parser)
    parser.add_argument("--corrected", default=CORRECTED_TOPIC, metavar="TOPIC",
                        help="topic of the corrected samples (default: %(default)s)")
    add_filter(parser)
    add_report(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..io.bag import BagWriter, cdr
    from ..model import SensorModel
    from ..streaming import Corrector
    from ._corrected_topic import Sink, temperatures_of
    require_report(arguments.report)
    corrector = Corrector(SensorModel.load(arguments.model), **filter_wishes(arguments))
    reader = open_bag(arguments.bag)
    raw = reader.topic(arguments.sensor, cdr.ACCELERATION_TYPES)
    if not raw.count:
        raise BagError(f"{arguments.bag}: topic {arguments.sensor} has no messages")
    temperatures = temperatures_of(reader, arguments.temperature, corrector.model)
    copied = [raw.name] + [arguments.reference] * (arguments.reference in reader.topics)
    with BagWriter(arguments.output) as writer, \
            progress(sum(reader.topics[name].count for name in copied)) as bar:
        for name in copied:
            writer.copy_topic(reader.topics[name])
        writer.copy_topic(raw, arguments.corrected)
        sink = Sink(corrector, writer, raw.type_name, arguments.corrected, temperatures,
                     bool(arguments.report))
        for block in reader.blocks(copied):
            messages = block.messages
            writer.write_many(block.topic.name, list(zip(
                messages, block.log_times_ns.tolist(), block.publish_times_ns.tolist())))
            if block.topic.name == raw.name:
                sink.add(block, messages)
            bar.update(len(messages))
        sink.finish()
        counters = corrector.counters
        if not counters["given"]:
            raise BagError(f"{arguments.bag}: topic {arguments.sensor}: nothing could be corrected "
                           f"of {counters['samples']} samples: {fates(counters)}")
    warnings = [*reader.warnings, *_notes(corrector, arguments.bag, sink.late)]
    for warning in warnings:
        print(f"warning: {warning}")
    summary = corrector.design.summary()
    print(f"{arguments.output}: {counters['given']} of {counters['samples']} samples corrected at "
          f"{summary['sampling_rate_hz']:.6g} Hz" + (f"; {fates(counters)}" if fates(counters) else
                                                     ""))
    for axis, design in summary["axes"].items():
        low, high = design["band_hz"]
        print(f"  {axis}: {low:.4g} to {high:.4g} Hz, worst error "
              f"{design['worst_amplitude_error']:.2%} and {design['worst_phase_error_deg']:.3f} "
              f"deg, noise gain {design['noise_gain']:.3g}")
    if corrector.design.extrapolated_below_hz:
        print("  below {:.4g} Hz by extrapolation: the model was identified from {:.4g} to {:.4g} "
              "Hz".format(corrector.design.extrapolated_below_hz, *corrector.model.band_hz))
    from ..report.quantity import short
    print(f"  filter delay {short(summary['filter_delay_s'], 's')}; sensor's own delay "
          f"{short(summary['sensor_delay_s'], 's')}, taken out of the stamps")
    if arguments.report:
        # whoever wants no page need not wait for what draws it
        from ._correct_page import page
        write_page(page(sink.kept(), reader, corrector, arguments), arguments.report)
    write_json(arguments.json, {"output": str(arguments.output), "counters": counters,
                                "filters": summary, "warnings": warnings})


def _notes(corrector, bag, late):
    """What a user must know of a correction."""
    from ..record.ordering import late_words
    notes = [f"the variance is without the model's parameter uncertainty: {note}"
             for note in dict.fromkeys(corrector.design.notes) if note]
    if corrector.batch_size:
        notes.append(f"the samples come {corrector.batch_size:.4g} at a time with one stamp: their "
                     "instants are taken as uniform")
    if late:
        notes.append(late_words(late, "sensor"))
    source = corrector.model.metadata.get("provenance")
    if corrector.model.of_one_record and not (
            isinstance(source, dict) and source.get("bag") == printable(Path(bag).name)):
        notes.append(corrector.model.of_one_record)
    return notes


def fates(counters):
    """What happened to samples that were not simply corrected, in words."""
    words = {"warm_up": "at the start (the filter needs earlier samples)",
             "waiting": "at the end (the filter needs later samples)",
             "cut_off": "before a long gap", "duplicates": "with a repeated stamp",
             "stamps_back": "with a stamp that goes back", "early": "too many by their stamps",
             "not_finite": "not finite", "implausible": "that cannot be true",
             "without_rate": "too far apart to tell the rate",
             "distrusted": "with an axis that is dead, stuck, saturated or held",
             "filled": "missing and bridged",
             "clipped": "at the limits of the range",
             "without_temperature": "without a temperature (25 °C assumed)"}
    return ", ".join(f"{counters[name]} {text}" for name, text in words.items()
                     if counters.get(name))
