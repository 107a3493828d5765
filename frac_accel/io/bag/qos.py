"""Offered quality of service as rosbag2 stores it: YAML text with one entry per publisher."""

from __future__ import annotations

from typing import NamedTuple

import yaml

from frac_accel.io import safe_yaml

_RELIABILITY = {1: "reliable", 2: "best_effort"}
_DURABILITY = {1: "transient_local", 2: "volatile"}
_HISTORY = {1: "keep_last", 2: "keep_all"}
_MAX_BYTES = 16 * 1024  # of the YAML; about 300 per publisher
MAX_DEPTH = 1_000_000
# rmw's "infinite" duration, int64 max in nanoseconds.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


class Qos(NamedTuple):
    """The part of a QoS profile that a recording is replayed with."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10


def parse_qos(text: str) -> tuple[Qos, ...]:
    """Profiles from ``offered_qos_profiles``, old (numbers) or new (words); () if malformed."""
    try:
        entries = safe_yaml.load(text[:_MAX_BYTES]) if isinstance(text, str) else text
        return tuple(
            Qos(
                _word(entry.get("reliability"), _RELIABILITY, "reliable"),
                _word(entry.get("durability"), _DURABILITY, "volatile"),
                _word(entry.get("history"), _HISTORY, "keep_last"),
                min(max(int(entry.get("depth", 10)), 1), MAX_DEPTH),
            )
            for entry in entries or ()
        )
    except (AttributeError, TypeError, ValueError, OverflowError):
        return ()


def _word(value: object, numbers: dict[int, str], default: str) -> str:
    value = numbers.get(value) if isinstance(value, int) else value
    return value if value in numbers.values() else default


def qos_entries(profiles: tuple[Qos, ...]) -> list[dict]:
    """Profiles as the entries of rosbag2's metadata version 9."""
    return [
        {
            "history": qos.history,
            "depth": qos.depth,
            "reliability": qos.reliability,
            "durability": qos.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for qos in profiles
    ]


def qos_text(profiles: tuple[Qos, ...]) -> str:
    """Profiles as the channel metadata ``offered_qos_profiles``."""
    return yaml.safe_dump(qos_entries(profiles), sort_keys=False) if profiles else ""
