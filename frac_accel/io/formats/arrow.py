"""CSV and Parquet by pyarrow, which reads a million rows in a second.

One row for each message, with its topic beside it: so that topics of different rates need no empty
cells, and stamps stay whole numbers.
"""

from ...errors import BagError
from ..regular_file import open_regular
from .columns import Group, columns_of, is_number, require_plausible_size

_HEAD_BYTES = 64 * 1024


def read_csv(path):
    """Group of a table of text: comma, semicolon (then with decimal comma) or tab between cells.

    Lines that begin with ``#`` before the names are passed over, a second line without any number
    is taken as the units. What is no UTF-8 is taken as Windows' Western European (cp1252).
    """
    from pyarrow import csv
    with open_regular(path) as file:
        encoding, head = _decoded(file.read(_HEAD_BYTES))
    passed = next((i for i, line in enumerate(head) if line.strip() and line[0] != "#"), None)
    if passed is None:
        raise BagError(f"{path}: is empty")
    names, *following = head[passed:]
    delimiter = max(";\t,", key=names.count)
    if all(map(_is_number, names.split(delimiter))):
        raise BagError(f"{path}: its first line holds numbers, not names of columns: put a line "
                       "with names and units above it, such as time [s],x [m/s^2],y [m/s^2],"
                       "z [m/s^2]")
    row = following[0] if following else ""
    units = [cell.strip() for cell in row.split(delimiter)]
    has_units = any(units) and not any(map(_is_number, units))
    comma = delimiter == ";" and any("," in line for line in following)
    try:
        table = csv.read_csv(
            path, csv.ReadOptions(skip_rows=passed, skip_rows_after_names=int(has_units),
                                  encoding=encoding),
            csv.ParseOptions(delimiter=delimiter),
            csv.ConvertOptions(decimal_point="," if comma else ".", strings_can_be_null=True))
    except UnicodeDecodeError:
        raise BagError(f"{path}: is no text, neither in UTF-8 nor in cp1252") from None
    return [_group(table, units if has_units else ())]


def read_parquet(path):
    """Group of a Parquet file; a column's unit may also stand in its field's metadata."""
    from pyarrow import parquet
    about = parquet.read_metadata(path)
    require_plausible_size(path, 8 * about.num_rows * about.num_columns)
    table = parquet.read_table(path)
    units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
    return [_group(table, units)]


def write_csv(path, topics):
    """Write topics; an unknown variance is an empty cell."""
    from pyarrow import csv
    csv.write_csv(_table(topics), path)


def write_parquet(path, topics):
    """Write topics."""
    from pyarrow import parquet
    parquet.write_table(_table(topics), path)


def _group(table, units):
    units = [*units, *[""] * (table.num_columns - len(units))]
    return Group.of([(name.strip(), column.to_numpy(), unit) for name, column, unit
                         in zip(table.column_names, table.columns, units)])


def _table(topics):
    import pyarrow
    return pyarrow.concat_tables([pyarrow.table({
        "topic": [topic] * len(content.stamps_ns),
        "frame_id": [content.frame_id] * len(content.stamps_ns),
        **{name: pyarrow.array(values, from_pandas=True) for name, values in columns_of(content)},
    }) for topic, content in topics.items()], promote_options="default")


def _decoded(head):
    """Encoding of a text by its first bytes, and its first lines."""
    whole = head[:head.rfind(b"\n") + 1] or head
    try:
        return "utf8", whole.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return "cp1252", whole.decode("cp1252", "replace").splitlines()


def _is_number(text):
    return is_number(text.replace(",", "."))
