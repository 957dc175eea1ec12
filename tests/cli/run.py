"""Commands of the command line in this process: what a program of its own would print, without a second of start."""

import importlib
import io
import json
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest


def run(*arguments, stdin="", module="chaosgym"):
    """Run a command of a package: (exit code, standard output, standard error)."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", [module, *map(str, arguments)])
        patch.setattr(sys, "stdin", io.StringIO(stdin))
        try:
            importlib.import_module(f"{module}.cli").main()
        except SystemExit as end:
            code = end.code
    return code, out.getvalue(), err.getvalue()


def run_json(*arguments, module="chaosgym"):
    """Run with --json and return the object, which must be all of standard output."""
    code, out, err = run(*arguments, "--json", module=module)
    assert code == 0, err
    return json.loads(out)
