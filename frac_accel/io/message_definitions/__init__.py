"""Message definitions for bags: ``ros2msg`` text and type hash, without ROS at run time.

The types that frac_accel writes itself are built in.  Any other type is looked up in the ``share``
folders of a ROS installation: those of ``AMENT_PREFIX_PATH`` and that of the running Python's
environment (where the ROS wheels put theirs).
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import NamedTuple

from frac_accel.io.message_definitions._texts import TEXTS, TYPE_HASHES

_SEPARATOR = "\n" + "=" * 80 + "\nMSG: {}\n"
_TYPE_NAME = re.compile(r"^([a-zA-Z]\w*)/(?:msg/)?([a-zA-Z]\w*)$")
_FIELD = re.compile(r"^\s*([a-zA-Z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[a-zA-Z]\w*", re.MULTILINE)
_PRIMITIVES = frozenset(
    "bool byte char float32 float64 int8 uint8 int16 uint16 int32 uint32 int64 uint64 "
    "string wstring".split()
)


class MessageDefinition(NamedTuple):
    """What a bag stores about a type: full concatenated definition and REP-2016 type hash.

    Either is empty where it could not be found.
    """

    text: str
    type_hash: str


def find_definition(type_name: str) -> MessageDefinition:
    """Definition of a type such as ``sensor_msgs/msg/Imu``; empty where it is unknown.

    A text is only given when it is complete: a definition without that of a nested type would
    be rejected by readers, one that is missing altogether is not.
    """
    match = _TYPE_NAME.match(type_name)
    if match is None:
        return MessageDefinition("", "")
    name = "/".join(match.groups())
    parts: dict[str, str] = {}
    complete = _collect(name, parts)
    text = parts.pop(name, "") + "".join(
        _SEPARATOR.format(nested) + body for nested, body in parts.items()
    )
    return MessageDefinition(text if complete else "", _type_hash(name))


def _collect(name: str, parts: dict[str, str]) -> bool:
    """Add the text of a type and, depth first, of all types that it contains."""
    text = TEXTS.get(name) or _read_share(name, ".msg")
    if text is None:
        return False
    parts[name] = text
    package = name.split("/")[0]
    nested = set()
    for field_type in _FIELD.findall(re.sub(r"#.*", "", text)):
        if field_type not in _PRIMITIVES:
            nested.add(_short_name(field_type, package))
    return all(_collect(one, parts) for one in sorted(nested) if one not in parts)


def _short_name(field_type: str, package: str) -> str:
    match = _TYPE_NAME.match(field_type)
    return "/".join(match.groups()) if match else f"{package}/{field_type}"


def _type_hash(name: str) -> str:
    if name in TYPE_HASHES:
        return TYPE_HASHES[name]
    full_name = name.replace("/", "/msg/")
    try:
        hashes = json.loads(_read_share(name, ".json") or "{}").get("type_hashes", [])
        return next((h["hash_string"] for h in hashes if h["type_name"] == full_name), "")
    except (ValueError, KeyError, TypeError, AttributeError):
        return ""


def _read_share(name: str, suffix: str) -> str | None:
    package, message = name.split("/")
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        try:
            path = Path(prefix) / "share" / package / "msg" / (message + suffix)
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            continue
    return None
