"""The command ``explore``, started and ended."""

import json
import signal
import subprocess
import sys
from contextlib import contextmanager

SMALL = """
from chaosgym.explore import point, safe
point.DIAGRAM_POINTS, safe.MOST_STEPS, safe.CLEARANCES = 8, 6, 1
"""
"""Before a page of which the orbit diagram and the calm region are not looked at in full: they take half a minute."""


@contextmanager
def served(*arguments, stderr=None, with_process=False, before=""):
    """Address of a page that the command serves, and the number of its process; some Python may run before it."""
    program = f"{before}\nfrom chaosgym.cli import main\nmain()"
    command = [sys.executable, "-c", program, "explore", *arguments, "--port", "0", "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True) as server:
        assert server.stdout is not None
        try:
            address = json.loads(server.stdout.readline())["address"]
            yield (address, server.pid) if with_process else address
        finally:
            server.send_signal(signal.SIGINT)
        assert server.wait(60) == 130
