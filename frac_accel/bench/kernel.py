"""The kernel of the correction alone, and with serialised messages around it."""

import numpy as np
from scipy.signal import butter, sosfilt

from ..io import cdr
from ..io.samples import Samples
from ..model import SensorModel
from ..streaming import Corrector
from ..streaming.live_messages import SampleMessages
from .figures import Figure
from .passage import model_document
from .uncertainty import shortest_us

_RATE_HZ = 10_000.0
_PEER = "scipy.signal.sosfilt of order 10, called for each sample"


def run(rounds):
    """Figures by block length: with noise and parameter uncertainty, three axes."""
    model = SensorModel.from_dict(model_document(_RATE_HZ))
    own_filter = Corrector(model, _RATE_HZ).design.axes[0].filter
    figures = [Figure("kernel", "taps and poles of the inverse",
                      len(own_filter.taps) + len(own_filter.poles), "")]
    by_block = {}
    for block, count in ((1, 2000), (32, 8192), (8192, 8 * 8192)):
        by_block[block] = min(_message_us(model, block, count) for _ in range(3 * rounds))
        figures.append(Figure("kernel", f"Imu in, corrected Imu out, {block} at a time: time per "
                              "message", by_block[block], "us"))
    for block, count in ((1, 2000), (32, 8192)):
        watched, bare = (min(times) for times in zip(*(
            [_message_us(model, block, count, kind) for kind in (Corrector, _Unwatched)]
            for _ in range(3 * rounds))))
        figures.append(Figure("kernel", f"with monitors and a range learnt from the record over "
                              f"neither, {block} at a time", watched / bare, "", most=1.1))
    sections = butter(10, 0.5, output="sos")
    state, sample = np.zeros((len(sections), 3, 2)), np.ones((3, 1))
    peer_us = shortest_us(lambda: [sosfilt(sections, sample, zi=state) for _ in range(1000)], 1000,
                          3 * rounds)
    figures.append(Figure("kernel", "one filter step for each sample, over ours 32 at a time",
                          peer_us / by_block[32], "", peer=_PEER))
    return figures


class _Unwatched(Corrector):
    """Without what looks for faults of the sensor."""

    _is_watched = False

    def __init__(self, model, rate_hz):
        super().__init__(model, rate_hz, plausible_range=(-1e6, 1e6))


def _message_us(model, block, count, kind=Corrector):
    """Processor time per message [us] through everything but the middleware."""
    stamps = np.round(np.arange(count) * 1e9 / _RATE_HZ).astype(np.int64)
    values = np.random.default_rng(0).normal(size=(count, 3))
    messages = cdr.encode_samples(cdr.IMU, Samples.of(stamps, values, np.full((count, 3), 1e-4)))
    through = SampleMessages(kind(model, _RATE_HZ), cdr.IMU, None)

    def all_of_them():
        for start in range(0, count, block):
            part = messages[start:start + block]
            through.process(part, [0] * len(part))

    return shortest_us(all_of_them, count, 1)
