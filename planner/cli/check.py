"""planner check."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.options import AsJson, Quiet

__all__ = ["check"]


def check(
    folder: Annotated[Path, typer.Argument(help="Folder that planner grade wrote.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Verify a plan's folder anew from its files alone and print a certificate.

    Exit code 1 when something does not hold.

    Example: [bold]planner check finger-graded[/bold]
    """
    from planner.cli.output import finding, print_document, print_table, progress, say
    from planner.grading.certificate import certify

    with progress(not quiet and not as_json) as stage:
        certificate = certify(folder, progress=stage)
    if as_json:
        print_document(certificate.document())
    elif not quiet:
        print_table(
            ["check", "value", "limit", "holds"],
            [
                [name, f"{c.value:.3g}", f"{c.limit:.3g}", "yes" if c.ok else "NO"]
                for name, c in certificate.checks.items()
            ],
            title=f"{folder}: {certificate.part} on {certificate.printer}, "
            f"{certificate.shells} shells, {certificate.triangles} triangles",
            right=["value", "limit"],
        )
        for problem in certificate.problems:
            finding(problem)
        say("the folder is sound" if certificate.ok else "the folder is NOT sound")
    return 0 if certificate.ok else 1
