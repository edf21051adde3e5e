"""Diagnose the campaigns of published measurements and write a page on them.

python -m benchmarks.withheld.real.report --data FOLDER -o DIR [--page FILE] [--keep DIR] [NAME ...]
"""

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.withheld.real.__main__ import main as make_campaigns
from benchmarks.withheld.real.convex_fit import convex_errors
from benchmarks.withheld.real.expectations import EXPECTATIONS
from benchmarks.withheld.real.left_out_rate import left_out_rates
from benchmarks.withheld.real.page import Answered, page, tables
from benchmarks.withheld.written import put_into_page
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import diagnose
from planner.report.gap_page import diagnosis_files, write_diagnosis

__all__ = ["main"]

PAGE, FIGURES = "real-data.md", "real-data"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.withheld.real.report")
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*EXPECTATIONS, []])
    parser.add_argument("--data", type=Path, required=True, help="folder of the sources' files")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--page", type=Path, help="put the tables into this page (Markdown)")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave the reports' folders there")
    options = parser.parse_args(arguments)
    names = options.names or list(EXPECTATIONS)
    with tempfile.TemporaryDirectory() as scratch:
        campaigns = Path(scratch)
        if make_campaigns(["--data", str(options.data), "-o", str(campaigns), *names]):
            return 1
        answers = [_answered(name, campaigns, options.keep) for name in names]
    (options.output / FIGURES).mkdir(parents=True, exist_ok=True)
    for a in answers:
        files = diagnosis_files(a.diagnosis)
        for name in a.expectation.figures:
            path = options.output / FIGURES / f"{a.name}-{name}.svg"
            path.write_bytes(files[f"figures/{name}.svg"])
    (options.output / PAGE).write_text(page(answers), encoding="utf-8")
    if options.page is not None:
        put_into_page(options.page, tables(answers), "real")
    print(f"wrote {options.output / PAGE}")
    return 0


def _answered(name: str, campaigns: Path, keep: Path | None) -> Answered:
    expectation = EXPECTATIONS[name]
    campaign = read_campaign(campaigns / name)
    found = diagnose(campaign)
    if keep is not None:
        write_diagnosis(found, keep / name, force=True)
    met, why = expectation.judge(found)
    print(f"{name}: {found.verdict}; as expected: {met} ({why})", flush=True)
    convex = convex_errors(campaign)
    if not expectation.rates:
        return Answered(name, expectation, campaign.palette, found, convex)
    without = diagnose(campaign, without=("rate",))
    if keep is not None:
        write_diagnosis(without, keep / f"{name}-without-rate", force=True)
    left_out = tuple(left_out_rates(campaign, diagnose))
    return Answered(name, expectation, campaign.palette, found, convex, without, left_out)


if __name__ == "__main__":
    sys.exit(main())
