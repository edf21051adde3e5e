"""Write campaigns made of published measurements.

python -m benchmarks.withheld.real --data FOLDER -o DIR [NAME ...]
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.withheld.real.adhesive import adhesive_pulled, adhesive_sheared
from benchmarks.withheld.real.calendered_rubber import calendered_rubber
from benchmarks.withheld.real.coupons import Real
from benchmarks.withheld.real.silicones import silicones
from benchmarks.withheld.real.tape import tape
from benchmarks.withheld.real.thesis import thesis
from planner.errors import OutputError
from planner.gap.campaign_folder import read_campaign, write_campaign

__all__ = ["CAMPAIGNS", "main"]

CAMPAIGNS: Mapping[str, Callable[[Path], Real]] = {
    "silicones": silicones,
    "calendered-rubber": calendered_rubber,
    "adhesive-pulled": adhesive_pulled,
    "adhesive-sheared": adhesive_sheared,
    "tape": tape,
}
"""Those that need the data; the thesis' tables come with planner."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.withheld.real")
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*CAMPAIGNS, "thesis", []])
    parser.add_argument(
        "--data", type=Path, help="folder with marechal, oca_shear, hyperelastics_jl"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    options = parser.parse_args(arguments)
    names = options.names or [*CAMPAIGNS, "thesis"]
    options.output.mkdir(parents=True, exist_ok=True)
    missing = 0
    for name in names:
        try:
            made = _made(name, options.data)
            folder = write_campaign(made.campaign, options.output / name)
        except (OSError, OutputError, ValueError) as error:
            print(f"{name}: not made: {error}", file=sys.stderr)
            missing += 1
            continue
        specimens = len(read_campaign(folder).specimens)
        print(f"{folder}: {specimens} specimens; expected: {made.expected}", flush=True)
    return 1 if missing else 0


def _made(name: str, data: Path | None) -> Real:
    if name == "thesis":
        return thesis()
    if data is None or not data.is_dir():
        raise OSError(
            "the measurements are not here; give their folder with --data (README.md beside this "
            "script says where they come from)"
        )
    return CAMPAIGNS[name](data)


if __name__ == "__main__":
    sys.exit(main())
