"""Ways to damage a text, a tree, bytes, a bag's records, and samples; each from a generator."""

import copy
import os
import struct
import zlib

import lz4.frame
import numpy as np
import zstandard

from frac_accel.io.bag.mcap_file import MAGIC

NASTY_NUMBERS = (0, 1, -1, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1,
                 2**63 - 1, 2**63, 2**64 - 1)
NASTY_FLOATS = (0.0, -0.0, 1e-320, 1e-300, 1e-30, 1e30, 1e99, 1e101, 1e154, 1e200, 1e308, -1e308,
                float("nan"), float("inf"), -float("inf"))
NASTY_VALUES = (None, True, "", "x", "1e3", "nan", ".inf", "0x10", [], {}, [1], {"a": 1}, [[[]]],
                [None], "y" * 5000, "\u0000", "é", 10**30, -10**30, 2**63, *NASTY_FLOATS, 1e-9,
                0.5, 1.0, 2.0, 1e3, 1e6, -1.0, [1.0, 0.0], [0.0], [1.0, -2.0], [1e300, 1e300],
                [1.0] * 500)
NASTY_LINES = ("a: &a [x, x]", "b: [*a, *a, *a]", "<<: {a: 1}", "? [1]", "!!python/name:os.system",
               "- - - - -", "%YAML 9", "---", "...", "\t", "key: !!timestamp x", "z: 0b_",
               "n: " + "1:" * 300 + "1", "h: 0x" + "f" * 5000, "[" * 200, "{" * 200, '"', "'",
               "d: 2024-99-99", "\x07", "\ufeff", "m: |")


def octets(data, rng):
    """Bytes with a few of them changed, cut out, repeated or put in."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(0, len(data) + 1))
        kind = rng.integers(6)
        if kind == 0:
            data[at:at + 1] = rng.bytes(1)
        elif kind == 1:
            size = int(rng.choice([1, 2, 4, 8]))
            number = NASTY_NUMBERS[rng.integers(len(NASTY_NUMBERS))] & (256**size - 1)
            data[at:at + size] = number.to_bytes(size, "little" if rng.random() < 0.8 else "big")
        elif kind == 2:
            data[at:at + 8] = struct.pack("<d", NASTY_FLOATS[rng.integers(len(NASTY_FLOATS))])
        elif kind == 3:
            del data[at:at + int(rng.integers(1, 60))]
        elif kind == 4:
            data[at:at] = data[at:at + int(rng.integers(1, 60))]
        elif rng.random() < 0.3:
            del data[at:]
        elif at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


def text(words, rng):
    """A text damaged as bytes or line by line."""
    if rng.random() < 0.5:
        return octets(words.encode(), rng)
    lines = words.splitlines()
    for _ in range(rng.integers(1, 4)):
        at = int(rng.integers(0, len(lines) + 1))
        kind = rng.integers(5)
        if kind == 0:
            lines.insert(at, str(rng.choice(NASTY_LINES)))
        elif kind == 1 and lines:
            lines.insert(at, lines[rng.integers(len(lines))])
        elif kind == 2 and at < len(lines):
            del lines[at]
        elif kind == 3 and at < len(lines):
            lines[at] = " " * int(rng.integers(0, 4)) + lines[at]
        elif at < len(lines) and ":" in lines[at]:
            lines[at] = lines[at].split(":")[0] + ": " + str(rng.choice(NASTY_LINES))
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def tree(data, rng):
    """Nested dicts and lists with a few entries replaced, removed, doubled or renamed."""
    data = copy.deepcopy(data)
    for _ in range(rng.integers(1, 4)):
        places = list(_places(data))
        if not places:
            return data
        holder, key = places[rng.integers(len(places))]
        kind = rng.integers(6)
        old = holder[key]
        if kind < 3:
            holder[key] = copy.deepcopy(NASTY_VALUES[rng.integers(len(NASTY_VALUES))])
        elif kind == 3 and isinstance(old, (int, float)):
            with np.errstate(all="ignore"):
                holder[key] = float(old * 10 ** rng.uniform(-12, 12))
        elif kind == 4:
            del holder[key]
        else:
            other, place = places[rng.integers(len(places))]
            if not _holds(other[place], holder):
                holder[key] = copy.deepcopy(other[place])
    return data


def sizes(data, rng):
    """Nested dicts and lists in which some numbers are up to a hundred times as large or small."""
    data = copy.deepcopy(data)
    for holder, key in _places(data):
        if isinstance(holder[key], float) and rng.random() < 0.3:
            holder[key] *= 10 ** rng.uniform(-2, 2)
    return data


def branch(data, rng):
    """The same at places that are reached by a walk from the root: long lists are not hit more."""
    data = copy.deepcopy(data)
    for _ in range(rng.integers(1, 4)):
        holder = data
        while holder:
            keys = list(holder) if isinstance(holder, dict) else range(len(holder))
            key = keys[rng.integers(len(keys))]
            if not isinstance(holder[key], (dict, list)) or rng.random() < 0.2:
                changed = tree({"at": holder[key]}, rng)
                if "at" in changed:
                    holder[key] = changed["at"]
                else:
                    del holder[key]
                break
            holder = holder[key]
    return data


def _places(data):
    entries = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in list(entries):
        yield data, key
        if isinstance(value, (dict, list)):
            yield from _places(value)


def _holds(value, holder):
    return value is holder or (isinstance(value, (dict, list)) and any(
        other is holder for other, _ in _places(value)))


def records(data, rng):
    """An MCAP with some of its records changed, with true lengths and checksums."""
    parts = list(_records(data, len(MAGIC)))
    for _ in range(rng.integers(1, 4)):
        at = int(rng.integers(len(parts)))
        opcode, content = parts[at]
        kind = rng.integers(8)
        if kind == 0:
            del parts[at]
        elif kind == 1:
            parts.insert(int(rng.integers(len(parts))), (opcode, content))
        elif kind == 2:
            other = int(rng.integers(len(parts)))
            parts[at], parts[other] = parts[other], parts[at]
        elif kind == 3:
            parts[at] = (int(rng.integers(256)), content)
        elif opcode == 6 and kind > 4:
            parts[at] = (opcode, _in_chunk(content, rng))
        else:
            parts[at] = (opcode, octets(content, rng))
        if not parts:
            break
    return MAGIC + b"".join(struct.pack("<BQ", *(opcode, len(content))) + content
                            for opcode, content in parts) + MAGIC


def _records(data, at):
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if length > len(data) - at - 9:
            return
        yield opcode, data[at + 9:at + 9 + length]
        at += 9 + length


def _in_chunk(content, rng):
    """A chunk whose messages are damaged and whose checksum is right, or left out."""
    try:
        first, last, _, _, name_length = struct.unpack_from("<QQQII", content)
        name = content[32:32 + name_length]
        body = _unpacked(name, content[40 + name_length:])
    except (struct.error, zstandard.ZstdError, RuntimeError):
        return octets(content, rng)
    inner = list(_records(body, 0))
    for _ in range(rng.integers(1, 6)):
        if not inner:
            break
        at = int(rng.integers(len(inner)))
        opcode, old = inner[at]
        kind = rng.integers(6)
        if kind == 0:
            del inner[at]
        elif kind == 1:
            inner.insert(int(rng.integers(len(inner))), (opcode, old))
        elif kind == 2:
            # the same field of all messages of a channel, or of one
            place = int(rng.integers(max(len(old), 1)))
            value = octets(old[place:place + 8], rng)
            every = rng.random() < 0.5
            inner = [(code, part[:place] + value + part[place + len(value):])
                     if code == opcode and (every or number == at) else (code, part)
                     for number, (code, part) in enumerate(inner)]
        else:
            inner[at] = (opcode, octets(old, rng))
    body = b"".join(struct.pack("<BQ", code, len(part)) + part for code, part in inner)
    name = [name, b"lz4", b"zstd", b"", b"xyz"][rng.integers(5)] if rng.random() < 0.2 else name
    data = {b"zstd": zstandard.compress, b"lz4": lz4.frame.compress}.get(name, bytes)(body)
    crc = zlib.crc32(body) if rng.random() < 0.8 else 0
    return (struct.pack("<QQQII", first, last, len(body), crc, len(name)) + name
            + struct.pack("<Q", len(data)) + data)


def _unpacked(name, data):
    if name == b"zstd":
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=2**24)
    return lz4.frame.decompress(data) if name == b"lz4" else data


def samples(content, rng):
    """Samples with stamps, values or variances that no honest sensor has."""
    stamps, values, variance = (part.copy() for part in content[:3])
    for _ in range(rng.integers(1, 4)):
        count = len(stamps)
        if not count:
            break
        at = int(rng.integers(count))
        some = [at, slice(at, None), slice(at, at + 20), rng.random(count) < 0.1,
                slice(None)][rng.integers(5)]
        kind = rng.integers(9)
        axis = [slice(None), int(rng.integers(3))][rng.integers(2)]
        if kind == 0:
            seconds = float(rng.choice([1e-9, 1e-4, 1.0, 3600.0, 3e7, 1.6e9]))
            stamps[some] += int(seconds * 1e9) * (1 if rng.random() < 0.5 else -1)
        elif kind == 1:
            stamps[some] = stamps[at]
        elif kind == 2:
            stamps = stamps[np.argsort(rng.random(count))]
        elif kind == 3:
            values[some, axis] = NASTY_FLOATS[rng.integers(len(NASTY_FLOATS))]
        elif kind == 4:
            with np.errstate(all="ignore"):
                values[some, axis] *= 10 ** rng.uniform(-200, 200)
        elif kind == 5:
            values[some, axis] = 0.0 if rng.random() < 0.5 else values[at, axis]
        elif kind == 6:
            variance[some] = NASTY_FLOATS[rng.integers(len(NASTY_FLOATS))]
        elif kind == 7:
            keep = rng.random(count) < rng.uniform(0, 1)
            stamps, values, variance = stamps[keep], values[keep], variance[keep]
        else:
            stamps = stamps[0] + ((stamps - stamps[0]) * rng.choice([0, 1e-6, 1e-3, 1e3, 2.0])
                                  ).astype(np.int64)
    stamps = np.clip(stamps, 0, (2**31 - 1) * 10**9)
    return content._replace(stamps_ns=stamps, values=values, variance=variance)


PLACES = ("existing file", "folder", "link to nothing", "file in a file's place", "nothing")
UNREADABLE = ("missing", "empty", "cut off", "noise", "folder", "pipe", "link to itself")


def place(path, what, rng):
    """Put something where an output is to be."""
    if what == "existing file":
        path.write_bytes(rng.bytes(100))
    elif what == "folder":
        path.mkdir()
        (path / "of others").write_bytes(rng.bytes(100))
    elif what == "link to nothing":
        path.symlink_to("nowhere")
    elif what == "file in a file's place":
        path.symlink_to("place/nowhere")
        (path.parent / "place").write_bytes(b"a file")


def unreadable(path, content, what, rng):
    """Something that is no bag, made of one."""
    if what == "folder":
        path.mkdir()
    elif what == "pipe":
        os.mkfifo(path)
    elif what == "link to itself":
        path.symlink_to(path.name)
    elif what != "missing":
        path.write_bytes({"empty": b"", "cut off": content[:rng.integers(1, 200)],
                          "noise": rng.bytes(rng.integers(1, 3000))}[what])
