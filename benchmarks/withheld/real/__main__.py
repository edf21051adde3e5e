"""Write campaigns made of published measurements.

python -m benchmarks.withheld.real --data FOLDER -o DIR [NAME ...]
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.withheld.real.adhesive import adhesive_pulled, adhesive_sheared
from benchmarks.withheld.real.borg import BORG
from benchmarks.withheld.real.calendered_rubber import calendered_rubber
from benchmarks.withheld.real.silicones import silicones, silicones_substituted
from benchmarks.withheld.real.tape import tape
from benchmarks.withheld.real.thesis import thesis
from planner.errors import OutputError
from planner.gap.campaign import Campaign
from planner.gap.campaign_folder import read_campaign, write_campaign

__all__ = ["CAMPAIGNS", "main"]

CAMPAIGNS: Mapping[str, Callable[[Path], Campaign]] = {
    "silicones": silicones,
    "silicones-substituted": silicones_substituted,
    "calendered-rubber": calendered_rubber,
    "adhesive-pulled": adhesive_pulled,
    "adhesive-sheared": adhesive_sheared,
    "tape": tape,
    **BORG,
    "thesis": lambda _: thesis(),
}
"""By name; the thesis' tables come with planner, the others need the data."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.withheld.real")
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*CAMPAIGNS, []])
    parser.add_argument("--data", type=Path, help="folder with the sources' folders")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    missing = 0
    for name in options.names or CAMPAIGNS:
        try:
            folder = write_campaign(_made(name, options.data), options.output / name)
        except (OSError, OutputError, ValueError) as error:
            print(f"{name}: not made: {error}", file=sys.stderr)
            missing += 1
            continue
        print(f"{folder}: {len(read_campaign(folder).specimens)} specimens", flush=True)
    return 1 if missing else 0


def _made(name: str, data: Path | None) -> Campaign:
    if name != "thesis" and (data is None or not data.is_dir()):
        raise OSError(
            "the measurements are not here; give their folder with --data (README.md beside this "
            "script says where they come from)"
        )
    return CAMPAIGNS[name](data or Path())


if __name__ == "__main__":
    sys.exit(main())
