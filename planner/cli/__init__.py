"""The command line: one command a file, and `main`, which turns errors into exit codes.

Exit codes: 0 done; 1 done, but with a finding; 2 wrong usage or bad input, nothing written;
130 interrupted; 70 an internal error.
"""

import sys
from collections.abc import Sequence
from typing import Any

__all__ = ["main"]

INTERRUPTED = 130
INTERNAL_ERROR = 70
BAD_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with the code of contracts: 0, 1, 2, 70 or 130."""
    sys.exit(run(arguments))


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    import typer

    from planner.cli.app import app
    from planner.cli.output import complain
    from planner.errors import PlannerError

    # The common base of usage errors has no public name in typer.
    bases = typer.BadParameter.__mro__
    usage_error: Any = next(base for base in bases if base.__name__ == "ClickException")
    command = typer.main.get_command(app)
    try:
        result = command.main(
            args=None if arguments is None else list(arguments),
            prog_name="planner",
            standalone_mode=False,
        )
    except PlannerError as error:
        complain(str(error))
        return BAD_INPUT
    except usage_error as error:
        complain(f"{error.format_message()} (see planner --help)")
        return BAD_INPUT
    except (KeyboardInterrupt, typer.Abort):
        result = INTERRUPTED
    except BrokenPipeError:
        # The reader of our output went away (as with `| head`): no one is left to tell.
        sys.stderr.close()
        return 0
    except Exception as error:
        import traceback

        complain("".join(traceback.format_exception(error)).rstrip())
        complain("this is a bug in planner: please report the lines above and the command")
        return INTERNAL_ERROR
    if result == INTERRUPTED:  # typer turns an interrupt into this code itself
        complain("interrupted; nothing was left behind")
    return result if isinstance(result, int) else 0
