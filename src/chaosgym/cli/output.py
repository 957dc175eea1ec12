"""The answer of a command: a table for people, or one JSON object."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import click


def emit(result: Mapping[str, Any], as_json: bool, lines: Callable[[], list[str]]) -> None:
    """Print the result as JSON, or the lines for people."""
    if as_json:
        click.echo(json.dumps(result, allow_nan=False))
    else:
        for line in lines():
            click.echo(line)
