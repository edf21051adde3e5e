"""planner check."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli.options import AsJson, Quiet

if TYPE_CHECKING:
    from planner.grading.certificate import Certificate

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
        for message in certificate.reported:
            finding(f"reported by the plan: {message}")
        say(_verdict(certificate))
    return 0 if certificate.ok else 1


def _verdict(certificate: "Certificate") -> str:
    if certificate.ok:
        return "the folder is sound"
    failed = certificate.problems or not all(c.ok for c in certificate.checks.values())
    return "the folder is NOT sound" if failed else "the files are sound, with the findings above"
