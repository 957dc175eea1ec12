"""Files of matrices: ``.npz``, ``.npy`` and Matrix Market, none of which is larger in memory than it may be."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.files import array_of, contents, first_line, unpacked

LARGEST = 1_000_000_000
"""Bytes that matrices may have in a file, and in memory: 11,000 rows if they are full, millions if they are sparse."""

ARRAYS = ("M", "K", "C", "base", "names")


def read_archive(path: Path) -> dict[str, Any]:
    """Arrays M, K and, where they are, C, base and names of a ``.npz`` file.

    Raises
    ------
    ParameterError
        If it can't be read, lacks M or K, or an array is of another kind.
    """
    try:
        found = unpacked(contents(path, LARGEST), LARGEST)
    except ValueError as error:
        raise ParameterError(f"{path} {_told(error, '.npz')}") from None
    for name in ("M", "K"):
        if name not in found:
            raise ParameterError(f"{path} holds no array {name}; it has {', '.join(found) or 'none'}")
    if "names" in found and (found["names"].ndim != 1 or found["names"].dtype.kind != "U"):
        raise ParameterError(f"{path}: names is no list of texts, one for each row of M")
    return {name: found[name] for name in ARRAYS if name in found}


def read_matrix(path: Path) -> Any:
    """Matrix of a ``.npy`` or a Matrix Market file.

    Raises
    ------
    ParameterError
        If it can't be read, is not real, or has more entries than bytes for them.
    """
    try:
        content = contents(path, LARGEST)
        if path.suffix == ".npy":
            return array_of(content)
        return _matrix_market(content)
    except ValueError as error:
        raise ParameterError(f"{path} {_told(error, 'a matrix')}") from None


def _matrix_market(content: bytes) -> Any:
    """Matrix of the text of Boisvert, Pozo and Remington, NISTIR 5935 (1996), real and square.

    Scipy's reader writes beyond its arrays where a file holds other entries than it claims, so it reads the head only.
    """
    from scipy.io import mminfo
    from scipy.sparse import coo_array

    try:
        rows, columns, count, form, field, symmetry = mminfo(io.BytesIO(content))
        if field not in ("real", "integer", "double") or symmetry not in ("general", "symmetric"):
            raise ValueError(f"it is {field} and {symmetry}; allowed: real or integer, general or symmetric")
        body = _body(content)
        memory = 8 * rows * columns if form == "array" else 24 * (count + rows)
        if not 0 < rows == columns or count < 0 or memory > LARGEST or count > len(body):
            raise ValueError(f"it claims {rows} x {columns} with {count} entries in {len(content)} bytes")
        table = np.loadtxt(io.BytesIO(body), comments="%", ndmin=2) if body.strip() else np.zeros((0, 3))
    except ValueError:
        raise
    except Exception as error:  # whatever the library says of damaged bytes
        raise ValueError(first_line(error)) from None
    if form == "array":
        return _full(table, rows, symmetry == "symmetric")
    places = table[:, :2].astype(np.int64) - 1
    if table.shape != (count, 3) or np.any(table[:, :2] != places + 1) or np.any((places < 0) | (places >= rows)):
        raise ValueError(f"it holds other entries than the {count} of {rows} rows that it claims")
    row, column = places.T
    values = table[:, 2]
    if symmetry == "symmetric":
        mirrored = row != column
        row, column = np.append(row, column[mirrored]), np.append(column, row[mirrored])
        values = np.append(values, values[mirrored])
    return coo_array((values, (row, column)), shape=(rows, rows))


def _body(content: bytes) -> bytes:
    """What follows the line of sizes, the first one that is no comment."""
    start = 0
    while start < len(content):
        end = content.find(b"\n", start) + 1 or len(content)
        line, start = content[start:end].strip(), end
        if line and not line.startswith(b"%"):
            break
    return content[start:]


def _full(table: Any, rows: int, symmetric: bool) -> Any:
    """Full matrix of its columns one below the other, of a symmetric one from the diagonal down."""
    wanted = rows * (rows + 1) // 2 if symmetric else rows * rows
    if table.shape != (wanted, 1):
        raise ValueError(f"it holds other entries than the {wanted} that it claims")
    if not symmetric:
        return table[:, 0].reshape(rows, rows).T
    matrix = np.zeros((rows, rows))
    column, row = np.triu_indices(rows)
    matrix[row, column] = matrix[column, row] = table[:, 0]
    return matrix


def _told(error: ValueError, form: str) -> str:
    text = first_line(error)
    return text if text.startswith("can't be read") else f"can't be read as {form}: {text}"
