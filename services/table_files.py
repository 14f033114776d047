"""Tables on disk, written piece by piece: CSV, Parquet and HDF5."""

# h5py and pyarrow have no complete type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

import csv
import math
import pathlib
from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol

import numpy as np

Kind = Literal["int", "float", "bool", "text"]
Kinds = dict[str, Kind]
Columns = dict[str, Any]
"""Rows by column: a list, or an array of numbers; None where there is nothing."""
CHUNK_ROWS = 4096


class TableFile(Protocol):
    """A table that grows."""

    path: pathlib.Path

    def write(self, columns: Columns) -> None:
        """Append rows."""
        ...

    def close(self) -> None:
        """End the file."""
        ...


class CsvTable:
    """Numbers with all their digits, so that they read back to the bit; what is missing is empty."""

    def __init__(self, path: pathlib.Path, kinds: Kinds, told: Mapping[str, str]) -> None:
        del told
        self.path, self._file = path, path.open("w", newline="", encoding="utf-8")
        self._kinds, self._rows = kinds, csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(kinds)

    def write(self, columns: Columns) -> None:
        """Append rows."""
        self._rows.writerows(zip(*(_cells(kind, columns[name]) for name, kind in self._kinds.items()), strict=True))

    def close(self) -> None:
        """End the file."""
        self._file.close()


def _cells(kind: Kind, values: Any) -> list[Any]:
    if kind == "float":
        numbers = values.tolist() if isinstance(values, np.ndarray) else values
        return ["" if number is None else repr(float(number)) for number in numbers]
    if isinstance(values, np.ndarray):
        return values.tolist()
    if kind == "bool":
        return ["" if value is None else int(value) for value in values]
    return values


class ParquetTable:
    """Columns with their types, compressed; what was run stands in the metadata of the schema."""

    def __init__(self, path: pathlib.Path, kinds: Kinds, told: Mapping[str, str]) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        types = {"int": pa.int64(), "float": pa.float64(), "bool": pa.bool_(), "text": pa.string()}
        metadata = {f"antiphase.{name}": value for name, value in told.items()}
        self._schema: Any = pa.schema([(name, types[kind]) for name, kind in kinds.items()], metadata=metadata)
        self._table: Callable[..., Any] = pa.table
        self.path = path
        self._writer: Any = parquet.ParquetWriter(str(path), self._schema, compression="zstd")

    def write(self, columns: Columns) -> None:
        """Append rows."""
        self._writer.write_table(self._table({name: columns[name] for name in self._schema.names}, schema=self._schema))

    def close(self) -> None:
        """End the file."""
        self._writer.close()


class Hdf5Table:
    """One dataset for each column, compressed; what was run stands in the attributes of the file.

    What is missing is NaN, an empty text, or -1 where it would be true or false.
    """

    def __init__(self, path: pathlib.Path, kinds: Kinds, told: Mapping[str, str]) -> None:
        import h5py

        types = {"int": np.int64, "float": np.float64, "bool": np.int8, "text": h5py.string_dtype()}
        self.path, self._kinds = path, kinds
        self._file: Any = h5py.File(str(path), "w")
        self._file.attrs.update({f"antiphase_{name}": value for name, value in told.items() if value})
        for name, kind in kinds.items():
            self._file.create_dataset(
                name, (0,), maxshape=(None,), dtype=types[kind], chunks=(CHUNK_ROWS,), compression="gzip", shuffle=True
            )

    def write(self, columns: Columns) -> None:
        """Append rows."""
        for name, kind in self._kinds.items():
            dataset, values = self._file[name], _stored(kind, columns[name])
            size = dataset.shape[0]
            dataset.resize((size + len(values),))
            dataset[size:] = values

    def close(self) -> None:
        """End the file."""
        self._file.close()


def _stored(kind: Kind, values: Any) -> Any:
    if kind == "bool":
        return [-1 if value is None else int(value) for value in values]
    if kind == "float" and not isinstance(values, np.ndarray):
        return [math.nan if value is None else value for value in values]
    return ["" if value is None else value for value in values] if kind == "text" else values


WRITERS: dict[str, tuple[str, Callable[[pathlib.Path, Kinds, Mapping[str, str]], TableFile]]] = {
    "parquet": (".parquet", ParquetTable),
    "csv": (".csv", CsvTable),
    "hdf5": (".h5", Hdf5Table),
}
"""Suffix and writer of each format."""
