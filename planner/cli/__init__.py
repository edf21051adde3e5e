"""The command line: the commands, and `main`, which turns errors into exit codes.

Exit codes: 0 done; 1 done, but with a finding; 2 wrong usage or bad input, nothing written;
130 interrupted (Ctrl-C), 143 told to end (SIGTERM), nothing left behind (by a design the best
so far); 70 an internal error.
"""

import contextlib
import ctypes
import gc
import io
import math
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer

from planner import __version__
from planner.cli import gap as _gap
from planner.cli import materials as _materials
from planner.cli import plans as _plans
from planner.cli import printers as _printers
from planner.cli import simulate as _simulate
from planner.cli.output import Kept, command, complain, say
from planner.errors import ArgumentError, PlannerError

__all__ = ["app", "main", "run"]


INTERRUPTED = 130
TERMINATED = 143
INTERNAL_ERROR = 70
BAD_INPUT = 2

_OBJECTS = 50_000
"""That are made until Python searches for garbage: by default 700."""

_NOT_EVERYWHERE = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4"
"""Instruction sets for which numpy has functions of its own, by its names before 2.4 and since."""

_FIRST_PROCESSOR = 8192
"""Characters in which Linux describes it."""

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # mallopt(3)
_KEPT_BYTES, _KEPT_ARRAY_BYTES = 1 << 30, 32 << 20  # the most that glibc takes


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with the code of contracts: 0, 1, 2, 70, 130 or 143."""
    round_alike()
    _keep_memory()
    signal.signal(signal.SIGTERM, _terminate)
    _end_in_time()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A name that the terminal cannot show is shown escaped, not a reason to stop.
            stream.reconfigure(errors="backslashreplace")
    try:
        code = run(arguments)
    except KeyboardInterrupt:  # before the command begins, or after it is done
        code = TERMINATED if _told_to_end else INTERRUPTED
    if code == BAD_INPUT:
        gc.collect()  # of what an error's frames held libraries would complain
    gc.freeze()  # the system takes all back: nothing is searched through on the way out
    sys.exit(code)


def round_alike() -> None:
    """Let numpy and its BLAS round alike on all x86-64 processors that have AVX2.

    Where there is AVX-512, numpy's logarithms and powers end in another digit, its sorting leaves
    ties in another order, and BLAS adds in another one. Neither may be imported yet.
    """
    os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", _NOT_EVERYWHERE)
    # That this processor has none of them, or numpy no such functions.
    warnings.filterwarnings("ignore", "During parsing environment variable", ImportWarning)
    with contextlib.suppress(OSError), Path("/proc/cpuinfo").open(encoding="utf-8") as said:
        if " avx2 " in said.read(_FIRST_PROCESSOR):
            os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")


def _keep_memory() -> None:
    """Let Python and the C library keep what they have for what is asked next.

    Imports make many objects, and no cycles of garbage to search for again and again. An array that
    is given back to the system comes again as pages that it has to clear.
    """
    gc.set_threshold(_OBJECTS)
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another C library than glibc
        allot = ctypes.CDLL(None).mallopt
        allot(_TRIM_THRESHOLD, _KEPT_BYTES)
        allot(_MMAP_THRESHOLD, _KEPT_ARRAY_BYTES)


def run(arguments: Sequence[str] | None = None, commands: typer.Typer | None = None) -> int:
    """Run the command line, or other commands than planner's, and return the exit code."""
    try:
        code = _dispatch(list(sys.argv[1:] if arguments is None else arguments), commands or app)
        if sys.stdout is not None:
            sys.stdout.flush()
        if code != INTERRUPTED or isinstance(code, Kept):
            return int(code)
    except PlannerError as error:
        complain(_with_options(str(error), commands or app))
        return BAD_INPUT
    except KeyboardInterrupt:
        pass
    except BrokenPipeError:
        # The reader went away (as with `| head`): no one is left to tell, and nothing is wrong.
        _discard_stdout()
        return 0
    except OSError as error:
        _discard_stdout()
        complain(f"{error.filename or 'standard output'}: {error.strerror or error}")
        return BAD_INPUT
    except MemoryError as error:
        from planner.formats.files import free_memory_bytes

        free = free_memory_bytes()
        left = f", {free / 1e9:.3g} GB are free now" if free < math.inf else ""
        said = f" ({str(error).rstrip('.')})" if str(error) else ""
        complain(f"not enough memory{said}{left}; take a smaller input, or coarser steps")
        return BAD_INPUT
    except Exception as error:
        from planner.numerics import interrupted

        if not interrupted(error):
            import traceback

            complain("".join(traceback.format_exception(error)).rstrip())
            complain("this is a bug in planner: please report the lines above and the command")
            return INTERNAL_ERROR
    complain("interrupted; nothing was left behind")
    return TERMINATED if _told_to_end else INTERRUPTED


_told_to_end: set[int] = set()
"""Signals that came; typer keeps of an interrupt no more than its code."""


def _terminate(number: int, frame: FrameType | None) -> None:
    """Clean up as after Ctrl-C when the system or another program ends this one."""
    signal.signal(number, signal.SIG_DFL)  # a second one does not wait for that
    _told_to_end.add(number)
    raise KeyboardInterrupt


_PATIENCE_S = 2.0
"""How long a command may clean up after SIGTERM. Promised are three seconds."""


def _end_in_time() -> None:
    """Have SIGTERM end the process in time, even where a compiled loop holds the main thread.

    Python hears of a signal when the loop returns. The system writes its number into a pipe at
    once, and a thread of its own waits there. A scratch file that is left is locked by no one then,
    and the next run to its target removes it.
    """
    if sys.platform == "win32":  # ends a process without asking it
        return
    heard, told = os.pipe()
    os.set_blocking(told, False)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)

    def watch() -> None:
        while signal.SIGTERM not in os.read(heard, 64):
            pass
        time.sleep(_PATIENCE_S)
        os._exit(TERMINATED)

    threading.Thread(target=watch, daemon=True).start()


_FIGURES = {"float_parsing": "a number and nothing else, as 0.2", "int_parsing": "a whole number"}

_command = cache(typer.main.get_command)
"""Commands as typer makes them of functions' types, which takes as long as many a command."""


def _dispatch(arguments: list[str], commands: typer.Typer) -> int:
    # The common base of usage errors has no public name in typer.
    usage_error: Any = next(b for b in typer.BadParameter.__mro__ if b.__name__ == "ClickException")
    try:
        result = _command(commands).main(
            args=arguments or ["--help"], prog_name="planner", standalone_mode=False
        )
    except usage_error as error:
        path = getattr(error.ctx, "command_path", "planner")
        said = error.format_message()
        # Of a figure that is none typer says neither what was given nor what may be.
        for found in getattr(error.__cause__, "errors", list)():
            if kind := _FIGURES.get(found["type"]):
                said = f"{error.param.opts[0]} {found['input']!r}: it must be {kind}"
        said += "".join(f"; write ./{p}" for p in Path().glob("-*") if p.name in arguments)
        raise ArgumentError(f"{said} (see {path} --help)") from error
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except SystemExit as error:
        # rich exits by itself where the reader of its output went away.
        raise BrokenPipeError from error
    return result if isinstance(result, int) else 0


def _with_options(message: str, commands: typer.Typer) -> str:
    """Show arguments, which a message names between backticks, as the options that give them."""
    options: dict[str, str] = {}
    groups: list[Any] = [_command(app), _command(commands)]
    for one in groups:  # which grows by the groups within
        groups += getattr(one, "commands", {}).values()
        named = ((p.name, p.opts) for p in one.params if p.opts)
        options |= {n: next((o for o in of if o.startswith("--")), of[0]) for n, of in named}
    # msgspec quotes fields of files alike: "missing required field `coordinate`".
    return re.sub(r"(?<!field )`(\w+)`", lambda named: options.get(named[1], named[0]), message)


def _discard_stdout() -> None:
    """Send what is still to be written nowhere, or it would fail again when Python ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


app = typer.Typer(
    name="planner",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        say(f"planner {__version__}")
        raise typer.Exit


@app.callback()
def _planner(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say the version.")
    ] = False,
) -> None:
    """Plan print jobs of graded stiffness for multi-material jetting printers.

    [bold]planner grade[/bold] turns a mesh and a wish for stiffness into files that print.
    """


_COMMANDS: tuple[Callable[..., int], ...] = (
    _plans.grade, _simulate.simulate, _simulate.design, _simulate.export, _materials.invert,
    _materials.materials, _materials.fit, _materials.characterise, _plans.view, _plans.check,
    _plans.diff, _plans.compare, _plans.slices, _printers.schema,
)  # fmt: skip
_SWITCHES = {_printers.schema: "", _materials.invert: "as_json", _materials.materials: "as_json"}
for _function in _COMMANDS:
    command(app, switches=_SWITCHES.get(_function, "as_json quiet"))(_function)
app.add_typer(_gap.app)
app.add_typer(_printers.app)
