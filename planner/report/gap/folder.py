"""The folder of a diagnosis."""

from pathlib import Path

from planner.formats.folder import FolderKind, new_folder
from planner.gap.diagnosis import Diagnosis
from planner.gap.diagnosis_json import encode_diagnosis
from planner.report.gap.closure_figure import closure_figure
from planner.report.gap.curves_figure import curves_figure
from planner.report.gap.evidence_figure import evidence_figure
from planner.report.gap.page import page
from planner.report.gap.residual_figure import residual_figure
from planner.report.gap.tables import ranking_csv, where_csv

__all__ = ["DIAGNOSIS", "diagnosis_files", "write_diagnosis"]

DIAGNOSIS = FolderKind(
    "diagnosis.json",
    ("diagnosis.json", "report.html", "where.csv", "ranking.csv", "figures/*.svg"),
)
"""The folder that `write_diagnosis` writes."""


def diagnosis_files(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Return the content of each file by its path; the same diagnosis gives the same bytes."""
    drawn = {
        "residuals": residual_figure(diagnosis),
        "evidence": evidence_figure(diagnosis),
        "closure": closure_figure(diagnosis),
        "curves": curves_figure(diagnosis),
    }
    figures = {name: svg for name, svg in drawn.items() if svg is not None}
    return {
        "diagnosis.json": encode_diagnosis(diagnosis),
        "report.html": page(diagnosis, figures),
        "where.csv": where_csv(diagnosis),
        "ranking.csv": ranking_csv(diagnosis),
        **{f"figures/{name}.svg": svg for name, svg in figures.items()},
    }


def write_diagnosis(diagnosis: Diagnosis, folder: str | Path, *, force: bool = False) -> Path:
    """Write diagnosis.json, report.html, where.csv, ranking.csv and figures, all or nothing.

    Raises
    ------
    OutputError
        The folder may not be written; see `planner.formats.folder.check_target`.
    """
    files = diagnosis_files(diagnosis)
    with new_folder(folder, force=force, kind=DIAGNOSIS) as scratch:
        (scratch / "figures").mkdir()
        for name, content in files.items():
            (scratch / name).write_bytes(content)
    return Path(folder)
