r"""Motion of a car's body as a drive gives it: three axes, x forward, y to the left, z up.

The road is that of ISO 8608 with its slope of -2: the displacement's spectrum over the spatial
frequency n is :math:`G_d(n) = G_d(n_0) (n / n_0)^{-2}`, :math:`n_0 = 0.1` 1/m. A wheel at speed v
then feels a vertical velocity of flat spectrum, :math:`(2 \pi n_0)^2 G_d(n_0)\, v` [m²/s² per Hz,
one-sided], whatever the speed's course: white noise times the root of v. A quarter car passes it
on to the body (M. Mitschke, H. Wallentowitz, Dynamik der Kraftfahrzeuge, 2014). Standstill,
potholes, the engine's orders, braking, cornering and gravity are added. Nothing lies above
`band_hz`, and only braking, cornering and gravity below it.
"""

import dataclasses

import numpy as np
import scipy.fft
import scipy.signal

from .excitation import Grid, smooth_step

GRID_RATE_HZ = 6400.0  # at least: 160 points a period at 40 Hz
TAIL_S = 0.6           # after the record, for clocks that run ahead of it
GRAVITY = 9.80665      # m/s²
# G_d(n0) [m³], the geometric means of ISO 8608:2016, table C.1.
ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}
SPATIAL_FREQUENCY = 0.1  # n0 [1/m]


@dataclasses.dataclass(frozen=True)
class QuarterCar:
    """Masses [kg], springs [N/m] and damper [N s/m] of one corner of a passenger car."""

    body: float = 350.0
    wheel: float = 42.0
    spring: float = 21e3
    tyre: float = 190e3
    damper: float = 1600.0

    def acceleration(self, s):
        """Body's acceleration over the road's vertical velocity, at complex s [rad/s]."""
        suspension = self.damper * s + self.spring
        wheel = self.wheel * s ** 2 + suspension + self.tyre
        body = self.body * s ** 2 + suspension
        return s * suspension * self.tyre / (wheel * body - suspension ** 2)


@dataclasses.dataclass(frozen=True)
class Drive:
    """What a drive is like.

    Attributes
    ----------
    road_class : str
        Of `ROUGHNESS`.
    speed : float
        Usual speed [m/s].
    stops : int
        How often the car stands, engine running, for up to a fifth of the record each.
    potholes_per_km : float
    engine : float
        Engine's vibration [m/s², peak of its strongest order].
    manoeuvres : float
        RMS of braking and cornering [m/s²].
    gravity : bool
    car : QuarterCar
    """

    road_class: str = "B"
    speed: float = 15.0
    stops: int = 1
    potholes_per_km: float = 10.0
    engine: float = 0.1
    manoeuvres: float = 0.8
    gravity: bool = False
    car: QuarterCar = QuarterCar()


def draw_drive(rng):
    """Random drive."""
    return Drive(road_class=str(rng.choice(list(ROUGHNESS), p=[0.25, 0.35, 0.3, 0.1])),
                 speed=float(rng.uniform(6, 35)), stops=int(rng.integers(0, 3)),
                 potholes_per_km=float(rng.choice([0.0, 5.0, 20.0])),
                 engine=float(10 ** rng.uniform(-1.7, -0.5)),
                 manoeuvres=float(rng.uniform(0.2, 1.2)), gravity=bool(rng.integers(2)),
                 car=QuarterCar(damper=float(rng.uniform(1100, 2500)),
                                spring=float(rng.uniform(16e3, 28e3))))


def drive_on_road(rng, rate_hz, duration_s, drive, band_hz=(0.5, 40.0), lead_s=3.0):
    """Motion of the body on a drive.

    Parameters
    ----------
    rng : numpy.random.Generator
    rate_hz : float
        The record's [Hz].
    drive : Drive
    band_hz : tuple of float
        Ends of what road and engine excite [Hz].
    lead_s : float
        Motion before the record.

    Returns
    -------
    Excitation
        x forward, y to the left, z up [m/s²]; with gravity as an accelerometer at rest shows it.
    """
    oversampling = 2 * int(np.ceil(GRID_RATE_HZ / rate_hz / 2))
    grid = Grid(rate_hz, duration_s, lead_s, oversampling, least=2,
                tail_samples=int(np.ceil(TAIL_S * rate_hz)))
    t = grid.t
    speed = _speed(rng, t, duration_s, drive)
    density = (2 * np.pi * SPATIAL_FREQUENCY) ** 2 * ROUGHNESS[drive.road_class]
    # One-sided density G of white noise on a grid of rate r: variance G r / 2.
    white = np.sqrt(density * grid.grid_rate_hz / 2) * np.sqrt(speed)
    bump = _potholes(rng, t, speed, drive)

    def body(velocity):
        return _filtered(velocity, grid.grid_rate_hz, band_hz, drive.car.acceleration)

    vertical = body(white * rng.normal(size=grid.points) + bump)
    # Pitch and roll bring some of it to the other axes, with a road of their own.
    lateral = 0.5 * body(white * rng.normal(size=grid.points)) + 0.15 * vertical
    forward = 0.4 * body(white * rng.normal(size=grid.points) + 0.5 * bump) - 0.1 * vertical
    road = np.stack([forward, lateral, vertical])
    road += _engine(rng, t, speed, drive, band_hz)
    road[:2] += _manoeuvres(rng, t, speed, drive)
    if drive.gravity:
        road[2] += GRAVITY
    return grid.ramped(road, 1.0)


def turned(excitation, order):
    """The same with its axes in another order; with "zxy" the sensor's x is the car's z."""
    acceleration = excitation.acceleration[["xyz".index(axis) for axis in order]]
    return dataclasses.replace(excitation, acceleration=np.ascontiguousarray(acceleration))


def _speed(rng, t, duration_s, drive):
    """Speed [m/s] along the drive: it wanders by a third, and is 0 where the car stands."""
    knots = np.arange(t[0] - 20, t[-1] + 40, 10.0)
    course = np.interp(t, knots, rng.uniform(0.65, 1.35, len(knots)))
    standing = np.zeros(len(t))
    for _ in range(drive.stops):
        length = duration_s * rng.uniform(0.05, 0.2)
        start = rng.uniform(0, duration_s - length)
        slowing = min(6.0, length / 3)
        standing = np.maximum(standing, smooth_step((t - start) / slowing)
                              * smooth_step((start + length - t) / slowing))
    return drive.speed * course * (1 - standing)


def _potholes(rng, t, speed, drive):
    """Vertical velocity of the road in holes of 0.3 to 1 m length and 1 to 5 cm depth."""
    velocity = np.zeros(len(t))
    travelled_km = np.sum(speed) * (t[1] - t[0]) / 1000
    for _ in range(rng.poisson(drive.potholes_per_km * travelled_km)):
        at = rng.integers(len(t))
        if speed[at] < 2:
            continue
        length_s = rng.uniform(0.3, 1.0) / speed[at]
        half = int(length_s / 2 / (t[1] - t[0]))
        near = slice(max(at - half, 0), at + half + 1)
        phase = 2 * np.pi * (t[near] - t[at]) / length_s
        # depth (1 + cos) / 2, down and up again
        velocity[near] += rng.uniform(0.01, 0.05) * np.pi / length_s * np.sin(phase)
    return velocity


def _engine(rng, t, speed, drive, band_hz):
    """Engine's orders 1, 2 and 4 of a four-cylinder in automatic gear, as far as in the band."""
    step = t[1] - t[0]
    # idling at 750 to 900 a minute, up to three times that within a gear
    idle_hz = rng.uniform(750, 900) / 60
    gear = 1 + 2 * np.mod(speed, 12.0) / 12.0 * (speed > 0.5)
    smooth = int(0.8 / step)
    kernel = np.hanning(smooth) / np.hanning(smooth).sum()
    pace_hz = scipy.signal.fftconvolve(np.pad(idle_hz * gear, smooth, mode="edge"), kernel,
                                       mode="same")[smooth:-smooth]
    turns = np.cumsum(pace_hz) * step
    waves = np.zeros((3, len(t)))
    for order, strength in ((1, 0.3), (2, 1.0), (4, 0.4)):
        inside = smooth_step((band_hz[1] - order * pace_hz) / 2)
        for axis, coupling in enumerate((0.6, 0.8, 1.0)):
            waves[axis] += (drive.engine * strength * coupling * inside
                            * np.sin(2 * np.pi * (order * turns + rng.random())))
    return waves


def _manoeuvres(rng, t, speed, drive):
    """Braking and cornering, 0.02 to 0.4 Hz, only where the car moves; shape (2, points)."""
    low = _filtered(rng.normal(size=(2, len(t))), 1 / (t[1] - t[0]), (0.02, 0.4),
                    lambda s: np.ones_like(s))
    low /= low.std(axis=1, keepdims=True)
    return drive.manoeuvres * low * np.minimum(speed / 3, 1)


def _filtered(values, rate_hz, band_hz, response):
    """Through a response and a band with smooth ends, by the discrete Fourier transform."""
    size = scipy.fft.next_fast_len(values.shape[-1], real=True)
    frequency = np.fft.rfftfreq(size, 1 / rate_hz)
    band = (smooth_step((frequency - 0.7 * band_hz[0]) / (0.3 * band_hz[0]))
            * smooth_step((band_hz[1] - frequency) / (0.1 * band_hz[1])))
    passed = np.zeros(len(frequency), complex)
    passed[band > 0] = band[band > 0] * response(2j * np.pi * frequency[band > 0])
    return scipy.fft.irfft(scipy.fft.rfft(values, size) * passed, size)[..., :values.shape[-1]]



