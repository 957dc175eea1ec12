"""The file of a machine: TOML with units in, a class of machines out, whose defaults are what the file states.

A file with links is a mechanism; any other one is a structure of modes or matrices.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.files import contents, toml_of
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import suggestion

LARGEST = 1_000_000_000
"""Bytes that a file beside a machine's may have."""

TEMPLATES: Mapping[str, tuple[str, str]] = {
    "mass": ("chaosgym.machines.modal_machine", "mass.toml"),
    "modes": ("chaosgym.machines.modal_machine", "template.toml"),
    "four-bar": ("chaosgym.machines.mechanism", "four-bar.toml"),
    "slider-crank": ("chaosgym.machines.mechanism", "slider-crank.toml"),
    "compressor": ("chaosgym.machines.mechanism", "compressor.toml"),
}
"""Files to start from: package and name."""

_classes: dict[str, type[Machine]] = {}


def _reader_of(values: Mapping[str, Any]) -> ModuleType:
    """Module that reads a file of such tables."""
    if "link" in values or "ground" in values:
        from chaosgym.machines.mechanism import file as mechanism

        return mechanism
    from chaosgym.machines.modal_machine import file as modes

    return modes


def machine_class(path: str | Path) -> type[Machine]:
    """Class of the machines that a file describes; calling it without arguments gives the one that is stated.

    Raises
    ------
    ParameterError
        If the file can't be read, a key is unknown, a unit missing, or a value not allowed; one line that says where.
    """
    try:
        text, values = toml_of(path)
    except ValueError as error:
        raise ParameterError(f"{path} {error}") from None
    reader, folder = _reader_of(values), Path(path).parent
    try:
        data = reader.tables_of(values, folder)
        digest = hashlib.sha256(text.encode())
        for beside in reader.files_of(values, folder):
            digest.update(_bytes(beside))
        key = f"{path} {digest.hexdigest()}"
        if key not in _classes:
            kind = reader.built(str(path), digest.hexdigest()[:16], data, folder)
            kind.__reduce__ = _reduced
            _classes[key] = kind
        return _classes[key]
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def files_of(path: str | Path) -> list[Path]:
    """File of a machine, and those that it names.

    Raises
    ------
    ParameterError
        As ``machine_class``.
    """
    machine_class(path)
    _, values = toml_of(path)
    return [Path(path), *_reader_of(values).files_of(values, Path(path).parent)]


def _reduced(machine: Any) -> Any:
    """How a machine is pickled: by the name of its file, whose class has no name of its own."""
    kind = type(machine)
    values = {each.name: getattr(machine, each.name) for each in fields(machine)}
    # what is the file's own comes back with it
    own = {name: value for name, value in values.items() if value is not getattr(kind, name, None)}
    return _restored, (machine.name, {**own, "definition": machine.definition}, machine.initial_state)


def _restored(path: str, values: Mapping[str, Any], initial_state: tuple[float, ...]) -> Machine:
    kind: Any = machine_class(path)
    if kind.definition != values["definition"]:
        raise ParameterError(f"{path} has changed: it is not the machine that was kept")
    machine: Machine = kind(**values)
    return machine.from_state(initial_state)


def read_machine(path: str | Path) -> Machine:
    """Machine that a file describes, at the speed and clearance that it states.

    Raises
    ------
    ParameterError
        As ``machine_class``.

    Examples
    --------
    >>> machine = chaosgym.read_machine("docs/machines/shaw-holmes-1983.toml")
    >>> machine.joint, machine.stops
    ('mass', 'one')
    """
    kind: Any = machine_class(path)
    machine: Machine = kind()
    return machine


def template(kind: str = "modes") -> str:
    """Commented file of an example, ready to edit; one of ``TEMPLATES``.

    Raises
    ------
    ParameterError
        If there is none of that name.
    """
    if kind not in TEMPLATES:
        raise ParameterError(f"there is no template {kind!r}{suggestion(kind, TEMPLATES)}")
    package, name = TEMPLATES[kind]
    return (resources.files(package) / name).read_text(encoding="utf-8")


def schema_text() -> str:
    """JSON schema of such files, as text."""
    from chaosgym.machines.mechanism.keys import KEYS as LINKS
    from chaosgym.machines.modal_machine.keys import KEYS as MODES

    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "chaosgym machine"}
    return json.dumps({**head, "anyOf": [MODES.schema(), LINKS.schema()]}, indent=1) + "\n"


def _bytes(path: Path) -> bytes:
    try:
        return contents(path, LARGEST)
    except ValueError as error:
        raise ParameterError(f"{path} {error}") from None
