"""Simulate a sensor: reference -> what it would say.

The output bag holds the reference as it is and the simulated sensor on the sensor's topic, so that
it can be identified, corrected and validated like a measured one.
"""

from ._common import (
    add_bag,
    add_json,
    add_model,
    add_temperature,
    add_topics,
    open_bag,
    progress,
    read_temperature_at,
    write_json,
)

EXAMPLES = """
frac_accel simulate drive.mcap --model sensor.yaml -o simulated.mcap
frac_accel simulate drive.mcap --model sensor.yaml -o simulated.mcap --initial steady
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    add_model(parser)
    parser.add_argument("-o", "--output", required=True, metavar="OUT.mcap", help="bag to write")
    add_topics(parser, axis=False)
    add_temperature(parser)
    parser.add_argument("--initial", choices=["rest", "steady"], default="rest",
                        help="motion before the record: none, or the first sample's value for "
                             "ever, as gravity (default: %(default)s)")
    add_json(parser)


def run(arguments):
    """Do it."""
    import numpy as np

    from ..io.bag import BagWriter, cdr
    from ..model import SensorModel
    from ..record.record import UniformSamples
    from ..simulation import simulate
    model = SensorModel.load(arguments.model)
    reader = open_bag(arguments.bag)
    info = reader.topic(arguments.reference, cdr.ACCELERATION_TYPES)
    samples = [block for _, block in reader.samples([arguments.reference])]
    samples = cdr.Samples.concatenate(samples) if samples else None
    record = UniformSamples.of(samples, f"{arguments.bag}: topic {arguments.reference}")
    grid_ns = samples.stamps_ns[record.index[0]] + (
        np.arange(len(record.values)) * 1e9 / record.sampling_rate_hz)
    simulated = simulate(
        model, record.values, record.sampling_rate_hz, initial=arguments.initial,
        temperature_c=(read_temperature_at(reader, arguments.temperature)(grid_ns)
                       if model.needs_temperature else None))[record.slot]
    result = cdr.Samples.of(samples.stamps_ns[record.index], simulated,
                            np.full(simulated.shape, model.noise_std**2) if model.noise_std else
                            None, samples.frame_id)
    with BagWriter(arguments.output) as writer, progress(info.count) as bar:
        writer.copy_topic(info)
        writer.add_topic(arguments.sensor, cdr.IMU)
        messages = cdr.encode_samples(cdr.IMU, result)
        times = np.maximum.accumulate(result.stamps_ns)
        place = 0
        for block in reader.blocks([arguments.reference]):
            for data, log, publish in zip(block.messages, block.log_times_ns.tolist(),
                                          block.publish_times_ns.tolist()):
                writer.write(arguments.reference, data, log, publish)
                bar.update()
                while place < len(messages) and times[place] <= log:
                    writer.write(arguments.sensor, messages[place], log)
                    place += 1
        for message, time in zip(messages[place:], times[place:].tolist()):
            writer.write(arguments.sensor, message, time)
    left_out = len(samples.stamps_ns) - len(record.index)
    print(f"{arguments.output}: {len(messages)} samples at {record.sampling_rate_hz:.6g} Hz on "
          f"{arguments.sensor}" + (f", {left_out} unusable ones left out" if left_out else ""))
    write_json(arguments.json, {
        "output": str(arguments.output), "samples": len(messages), "left_out": left_out,
        "bridged": record.bridged, "sampling_rate_hz": record.sampling_rate_hz,
        "rms": dict(zip("xyz", simulated.std(axis=0).tolist()))})
