"""Compilation of kernels: once on a computer, however many processes need them.

The first call of a kernel in a process loads its machine code from the disk, or compiles it, which takes seconds, and
keeps it there. A lock lets one process compile while others that need a kernel not there yet wait and then load it;
what is there already is loaded without the lock. A message says what takes so long, and a bar how much is left.

A kernel can be compiled by another process beside this one, into a folder of its own, whose files are moved to the
others under the lock (``compile_beside``).

What keeps it short: Python calls few kernels, with short chains of calls; arrays are copied in loops, since an
assignment compiles 60 functions; constants that are handed on are integers of numpy, since numba compiles anew for each
plain one.

The machine code has a checksum beside it: a damaged file is compiled anew. Machine code, numba's index of it and
checksums change under the lock alone. So a reader without the lock that finds them in disagreement can have met a
change half done, and looks again with the lock.
"""

import atexit
import hashlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numba
from filelock import FileLock, Timeout
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from tqdm import tqdm

from chaosgym.core.kernel import SideBySide
from chaosgym.core.kernel_cache import KERNEL_CACHE, WANTED_CACHE

logger = logging.getLogger("chaosgym")

PATIENCE = 2.0
"""Seconds after which a bar appears."""

_ready: set[tuple[Any, tuple[int, bool]]] = set()
"""Kernels with the number of their arguments, and whether the last is None: those that differ are compiled apart."""


def call(kernel: Any, *arguments: Any) -> Any:
    """Call a kernel; the first time, compile it or load it while no other process does."""
    key = (kernel, (len(arguments), arguments[-1] is None))
    if key not in _ready:
        prepare(kernel, *arguments)
        _ready.add(key)
    return kernel(*arguments)


_one_call_at_a_time = threading.Lock()
"""Some of numba's threading layers abort the process if two threads call parallel kernels at once."""

_forked = threading.Event()
"""Set in children of a fork: GNU OpenMP ends a child that uses it if its parent did."""

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked.set)


def call_side_by_side(kernel: SideBySide, machines: int, *arguments: Any) -> None:
    """Call a kernel over some of a number of machines: on all threads where there are several, and no fork."""
    if machines == 1 or _forked.is_set():
        call(kernel.serial, *arguments)
    else:
        with _one_call_at_a_time:
            call(kernel.parallel, *arguments)


def prepare(kernel: Any, *arguments: Any) -> None:
    """Compile or load a kernel for arguments of these types, unless NUMBA_DISABLE_JIT leaves kernels in Python."""
    if numba.config.DISABLE_JIT:
        return
    types = [numba.typeof(argument) for argument in arguments]
    missing = kernel.py_func.__code__.co_argcount - len(types)
    defaults = (kernel.py_func.__defaults__ or ())[-missing:] if missing else ()
    signature = (*types, *(numba.types.Omitted(default) for default in defaults))
    if _loaded(kernel, signature):
        return
    with FileLock(_lock_file()):
        _discard_damaged(kernel)
        if _loaded(kernel, signature):
            return
        functions = {kernel} | {one for one in _functions_of(kernel) if not is_cached(one)}
        logger.warning("compiling %s: %d functions, %s", name_of(kernel), len(functions), _how_often())
        _take_over(kernel, len(functions))
        try:
            with _shown(functions):
                kernel.compile(signature)
        except numba.core.errors.NumbaError:
            raise
        except Exception as error:  # whatever reading a damaged pickle raises
            logger.warning("machine code of %s can't be read (%s) and is made anew", name_of(kernel), error)
            _remove(_all_files(kernel))
            kernel.compile(signature)
        _keep_checksums(kernel)


class _Beside(NamedTuple):
    """A process that compiles a kernel into a folder of its own."""

    process: subprocess.Popen[bytes]
    folder: str

    @property
    def compiled(self) -> int:
        """Number of functions that it has compiled so far."""
        return len(list(Path(self.folder).rglob("*.nbi")))

    def end(self) -> None:
        """Stop it, if it still runs, close the pipe to it, and remove its folder."""
        with self.process:
            self.process.kill()
        shutil.rmtree(self.folder, ignore_errors=True)


_beside: dict[Any, _Beside | None] = {}
"""Kernels that were asked for by ``compile_beside``; None where no process compiles them any more, or ever did."""


def compile_beside(kernel: Any, first: Any, code: str) -> None:
    """Let another process compile ``kernel``, by running ``code``, while this one compiles ``first``.

    It does so only if neither is on the disk, there are two processors, and no process compiles already. ``prepare``
    waits for it. Whatever it lacks, because it fails or the code prepares other types, is compiled here.
    """
    if kernel in _beside:
        return
    _beside[kernel] = None
    alone = numba.config.NUMBA_DEFAULT_NUM_THREADS < 2 or not sys.executable
    if numba.config.DISABLE_JIT or alone or is_cached(kernel) or is_cached(first):
        return
    paths = os.pathsep.join(path for path in sys.path if path)
    try:
        with FileLock(_lock_file(), timeout=0):
            folder = tempfile.mkdtemp(prefix="chaosgym-beside-")
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "PYTHONPATH": paths}
            command = [sys.executable, "-c", f"from {__name__} import end_with_starter; end_with_starter(); {code}"]
            none, pipe = subprocess.DEVNULL, subprocess.PIPE
            process = subprocess.Popen(command, env=environment, stdin=pipe, stdout=none, stderr=none)
            _beside[kernel] = _Beside(process, folder)
    except (OSError, Timeout) as error:
        logger.debug("no second process compiles %s: %s", name_of(kernel), error)


def end_with_starter() -> None:
    """Let this process end, and its cache with it, when the one that started it does: its standard input ends then."""

    def watch() -> None:
        os.read(sys.stdin.fileno(), 1)
        shutil.rmtree(os.environ["NUMBA_CACHE_DIR"], ignore_errors=True)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _take_over(kernel: Any, functions: int) -> None:
    """Wait for the process that compiles a kernel, if there is one, and keep what it made and is not there yet."""
    beside, _beside[kernel] = _beside.get(kernel), None
    if beside is None:
        return
    try:
        with _bar(functions) as bar:
            while beside.process.poll() is None:
                bar.update(min(beside.compiled, functions) - bar.n)
                time.sleep(0.05)
        for index in Path(beside.folder).rglob("*.nbi"):
            kept = Path(KERNEL_CACHE).parent / index.parent.relative_to(beside.folder)
            kept.mkdir(parents=True, exist_ok=True)
            if not (kept / index.name).exists():
                for path in (*index.parent.glob(f"{index.stem}.*.nbc"), index):
                    shutil.move(path, kept / path.name)
    except OSError as error:
        logger.debug("machine code of %s from another process can't be kept: %s", name_of(kernel), error)
    finally:
        beside.end()


atexit.register(lambda: [beside.end() for beside in _beside.values() if beside is not None])

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_beside.clear)


class _NotCachedError(Exception):
    """A kernel is about to be compiled."""


class _Refusal(event.Listener):  # type: ignore[misc] # numba has no types
    """Keeps numba from compiling in this thread: it may only load."""

    def __init__(self) -> None:
        self._thread = threading.get_ident()

    def on_start(self, event: event.Event) -> None:
        """Refuse to compile."""
        if threading.get_ident() == self._thread:
            raise _NotCachedError

    def on_end(self, event: event.Event) -> None:
        """Nothing to do."""


def _loaded(kernel: Any, signature: tuple[Any, ...]) -> bool:
    """Load sound machine code of a kernel, which takes no lock; False where there is none for these arguments."""
    files = _files_of(kernel)
    if not files or not all(map(_is_sound, files)):
        return False
    try:
        with event.install_listener("numba:compile", _Refusal()), _without_registries():
            kernel.compile(signature)
    except Exception:  # not there, or whatever reading a damaged pickle raises: the lock's holder sees to it
        return False
    return True


@contextmanager
def _without_registries() -> Iterator[None]:
    """Spare numba what it imports to compile: machine code needs the counts of references alone."""
    context = cpu_target.target_context
    with global_compiler_lock:
        rtsys.initialize(context)
        context.refresh = lambda: None
        try:
            yield
        finally:
            del context.refresh


class _Count(event.Listener):  # type: ignore[misc] # numba has no types
    """Moves a bar on by each of some functions that is compiled."""

    def __init__(self, functions: set[Any], bar: Any) -> None:
        self._left, self._bar = set(functions), bar

    def on_start(self, event: event.Event) -> None:
        """Nothing to do."""

    def on_end(self, event: event.Event) -> None:
        """Count a function once: it may be compiled for several types, and others of numba's own are too."""
        function = event.data["dispatcher"]
        if function in self._left:
            self._left.remove(function)
            self._bar.update()


@contextmanager
def _shown(functions: set[Any]) -> Iterator[None]:
    """Bar of the functions that are compiled meanwhile, in a terminal, after two seconds."""
    with _bar(len(functions)) as bar, event.install_listener("numba:compile", _Count(functions, bar)):
        yield


def _bar(functions: int) -> Any:
    return tqdm(total=functions, desc="compiling", unit="function", delay=PATIENCE, disable=None, leave=False)


def _functions_of(kernel: Any) -> set[Any]:
    """A kernel and all kernels that it may call, but for those that are written out in their callers.

    Friction is among them also where no joint rubs, and it is not compiled.
    """
    found, ahead = {kernel}, [kernel]
    while ahead:
        function = ahead.pop().py_func
        names = set(function.__code__.co_names) & set(function.__globals__)
        called = {one for one in map(function.__globals__.get, names) if isinstance(one, Dispatcher)} - found
        found |= called
        ahead += called
    return {one for one in found if one.targetoptions.get("inline") != "always"}


def _how_often() -> str:
    if Path(KERNEL_CACHE).is_relative_to(WANTED_CACHE):
        return "once on this computer"
    return f"in every process, since {WANTED_CACHE} can't be written to; NUMBA_CACHE_DIR names another"


def is_cached(kernel: Any) -> bool:
    """True if machine code of a kernel lies on the disk, for arguments of some types."""
    return any(_files_of(kernel))


def name_of(kernel: Any) -> str:
    """Module and name of a kernel."""
    function = kernel.py_func
    return f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"


def _lock_file() -> str:
    os.makedirs(KERNEL_CACHE, exist_ok=True)
    return os.path.join(KERNEL_CACHE, "compiling.lock")


def _files_of(kernel: Any) -> list[Path]:
    """Index and machine code of a kernel on the disk."""
    return list(Path(kernel.stats.cache_path).glob(f"{name_of(kernel)}-*.nb[ci]"))


def _all_files(kernel: Any) -> list[Path]:
    """Those of every kernel that it may be linked with."""
    roots = {Path(KERNEL_CACHE), Path(kernel.stats.cache_path).parent}
    return [path for root in roots for path in root.rglob("*.nb[ci]")]


def _checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _checksum_file(path: Path) -> Path:
    return path.with_name(path.name + ".sha256")


def _keep_checksums(kernel: Any) -> None:
    for path in _all_files(kernel):
        _checksum_file(path).write_text(_checksum(path))


def _is_sound(path: Path) -> bool:
    """True unless a file differs from its checksum. An index may be newer than that: numba adds to it."""
    checksum = _checksum_file(path)
    try:
        if path.suffix == ".nbi" and path.stat().st_mtime > checksum.stat().st_mtime:
            return True
        return checksum.read_text() == _checksum(path)
    except FileNotFoundError:
        return True


def _discard_damaged(kernel: Any) -> None:
    """Remove damaged machine code of a kernel; where it must be compiled, also of those that it may be linked with."""
    files = _files_of(kernel)
    if not files or not all(map(_is_sound, files)):
        files = _all_files(kernel)
    damaged = [path for path in files if not _is_sound(path)]
    for path in damaged:
        logger.warning("%s is damaged and made anew", path)
    _remove(damaged)


def _remove(files: Iterable[Path]) -> None:
    for path in files:
        path.unlink(missing_ok=True)
        _checksum_file(path).unlink(missing_ok=True)


def _remove_temporary_cache() -> None:
    root = Path(KERNEL_CACHE).parent
    if root.name.startswith("chaosgym-kernels-") and root.parent == Path(tempfile.gettempdir()):
        shutil.rmtree(root, ignore_errors=True)


atexit.register(_remove_temporary_cache)
