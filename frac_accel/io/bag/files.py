"""Which MCAP files make up a bag: a bare file, or a rosbag2 folder with its metadata.yaml.

Files of other formats are made MCAP first (`frac_accel.io.formats`).
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from frac_accel.errors import BagError
from frac_accel.io import safe_yaml
from frac_accel.io.regular_file import read_text

METADATA_NAME = "metadata.yaml"
# Thousands of files and topics; rosbag2 writes some 200 bytes for a file, 1 KB for a topic.
_MAX_METADATA_BYTES = 2 * 2**20


def bag_files(path: Path) -> tuple[list[Path], list[str]]:
    """MCAP files of a bag in recording order, and warnings about a damaged folder.

    A folder without a usable metadata.yaml (its recorder was killed) is read by file name.
    Names in the metadata are taken as names in the folder: nothing outside it is opened.
    """
    from frac_accel.io.formats import as_mcap
    if not path.exists():
        raise BagError(f"{path}: no such bag")
    path = as_mcap(path)
    if not path.is_dir():
        return [path], []
    metadata = path / METADATA_NAME
    found = sorted(path.glob("*.mcap"), key=_split_number)
    if not metadata.exists():
        if not found:
            raise BagError(f"{path}: folder has neither {METADATA_NAME} nor an .mcap file")
        return found, [f"{path}: has no {METADATA_NAME} (recording not closed?); read by file name"]
    information = _information(metadata)
    if information is None:
        if not found:
            raise BagError(f"{metadata}: is not the metadata of a rosbag2 folder")
        return found, [f"{metadata}: is damaged; files are read by name"]
    storage = information.get("storage_identifier")
    if storage != "mcap":
        raise BagError(f"{path}: storage is '{storage}', expected 'mcap' or 'sqlite3'")
    if information.get("compression_mode"):
        raise BagError(
            f"{path}: is compressed by rosbag2 (mode '{information['compression_mode']}'), but its "
            "files do not look so; convert it first (ros2 bag convert)"
        )
    files, warnings = [], []
    for name in information["relative_file_paths"]:
        file = path / PurePosixPath(name).name
        if file.is_file():
            files.append(file)
        else:
            warnings.append(f"{path}: file {file.name} named in {METADATA_NAME} is missing")
    if not files:
        raise BagError(f"{path}: none of the files named in {METADATA_NAME} is there")
    return files, warnings


def _information(metadata: Path) -> dict | None:
    try:
        document = safe_yaml.load(read_text(metadata, _MAX_METADATA_BYTES))
        information = document["rosbag2_bagfile_information"]
        names = information["relative_file_paths"]
        if isinstance(names, list) and names and all(isinstance(name, str) for name in names):
            return information
    except OSError as error:
        raise BagError(f"{metadata}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        pass
    return None


def _split_number(file: Path) -> tuple[str, int]:
    """Split files end in _0, _1, ... _10."""
    stem, _, number = file.stem.rpartition("_")
    return (stem, int(number)) if number.isdecimal() else (file.stem, -1)
