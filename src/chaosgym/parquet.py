"""Tables of Parquet files from outside: how much they claim is known before any of their pages is read."""

import io
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from chaosgym.files import first_line

MOST_CELLS = 200_000_000
"""Values that a Parquet file may have: a small one may claim many."""


MOST_CHUNKS = 100_000
"""Pieces of columns, one a row group, that a Parquet file may have: each takes some 20 us to check."""


class _PagesUnread(Exception):
    """A reader that has understood a footer asks for pages."""


class _FooterAlone(io.RawIOBase):
    """Stands for a file of any size, none of whose pages is there."""

    def readable(self) -> bool:
        """It is asked before pages are."""
        return True

    def seekable(self) -> bool:
        """As ``readable``."""
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        """Every place is there."""
        return offset

    def tell(self) -> int:
        """Its size, when the reader asks for it."""
        return 1 << 62

    def read(self, size: int = -1) -> bytes:
        """Never bytes."""
        raise _PagesUnread


def _check_footer(metadata: Any) -> None:
    """Raise what the reader says of columns that are damaged: asked for their metadata, it would end the process.

    https://github.com/apache/arrow/issues/45283 has such an end; its exceptions pass through a read only.
    """
    import pyarrow.parquet as pq

    if (pieces := metadata.num_row_groups * metadata.num_columns) > MOST_CHUNKS:
        raise ValueError(f"it has {pieces} pieces of columns; allowed: up to {MOST_CHUNKS}; write longer row groups")
    reader = pq.ParquetFile(_FooterAlone(), metadata=metadata).reader
    for group in range(metadata.num_row_groups):
        for column in range(metadata.num_columns):
            with suppress(_PagesUnread):
                reader.read_row_group(group, column_indices=[column], use_threads=False)


def opened(source: Any) -> Any:
    """Open a Parquet file; texts are read as references into a list of them, since 1 kB may repeat 1 MB for ever.

    Parameters
    ----------
    source
        Path or stream.

    Raises
    ------
    OSError
        If its footer is damaged, or there is none.
    ValueError
        If it is cut into more than ``MOST_CHUNKS`` pieces; the message goes on after the name of the file.
    """
    import pyarrow.parquet as pq

    with pq.ParquetFile(source) as file:
        _check_footer(file.metadata)
        leaves = [file.schema.column(place) for place in range(file.metadata.num_columns)]
    texts = [leaf.path for leaf in leaves if leaf.physical_type == "BYTE_ARRAY"]
    return pq.ParquetFile(source, read_dictionary=texts, page_checksum_verification=True)


def cells_of(file: Any, columns: Sequence[str] | None = None) -> int:
    """Values that an opened file, or some columns of it, claims: those of lists, and eight bytes of a text for one."""
    groups = [file.metadata.row_group(place) for place in range(file.metadata.num_row_groups)]
    chunks = [group.column(place) for group in groups for place in range(group.num_columns)]
    if columns is not None:
        chunks = [chunk for chunk in chunks if chunk.path_in_schema.split(".list.")[0] in columns]
    return sum(max(chunk.num_values, chunk.total_uncompressed_size // 8) for chunk in chunks)


def _letters(array: Any) -> int:
    """Bytes of the texts of an array, each written out where it stands."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_dictionary(array.type):
        return pc.sum(pc.binary_length(array.dictionary).take(array.indices)).as_py() or 0
    if not pa.types.is_nested(array.type):
        return 0
    parts = array.flatten()
    return sum(map(_letters, parts if isinstance(parts, list) else [parts]))


def _check_cells(cells: int) -> None:
    if cells > MOST_CELLS:
        raise ValueError(f"it claims {cells} cells; allowed: up to {MOST_CELLS}")


def parquet_of(source: Any, columns: list[str] | None = None) -> Any:
    """Table of a Parquet file, or some columns of it.

    Parameters
    ----------
    source
        Path or stream.
    columns
        Names; all by default.

    Raises
    ------
    ValueError
        If it can't be read, or claims more cells than ``MOST_CELLS``; the message goes on after the name of the file.
    """
    import pyarrow as pa

    try:
        with opened(source) as file:
            _check_cells(cells_of(file, columns))
            table = file.read(columns)
            _check_cells(sum(_letters(chunk) for column in table.columns for chunk in column.chunks) // 8)
            schema = file.schema.to_arrow_schema()
        if columns is not None:
            schema = pa.schema([field for field in schema if field.name in columns], schema.metadata)
        return table.cast(schema)
    except OSError as error:
        raise ValueError(f"can't be read as Parquet: {error.strerror or first_line(error)}") from None
    except (pa.ArrowException, MemoryError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"can't be read as Parquet: {first_line(error)}") from None
