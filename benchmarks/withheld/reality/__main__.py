"""Make sealed campaigns.

python -m benchmarks.withheld.reality make --set development --tier other --count 20 --seed 1 -o DIR
python -m benchmarks.withheld.reality more DIR/CAMPAIGN --truth FILE --tests TESTS.json -o NEW

The second measures further specimens of a sealed campaign: TESTS.json is a list of tests, see
`more.FurtherTest`; NEW is the campaign with them.
"""

import argparse
import json
import shutil
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import get_args

from benchmarks.withheld.reality.campaign import make_campaign
from benchmarks.withheld.reality.effects import Set
from benchmarks.withheld.reality.fields import USUAL, Camera
from benchmarks.withheld.reality.more import further_of, read_test
from benchmarks.withheld.reality.noise import CAREFUL, Handling
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.sealing import seal, sha256
from benchmarks.withheld.reality.tiers import LABS, TIERS
from benchmarks.withheld.reality.writing import write_campaign

PALETTE = Path(__file__).parents[3] / "printers/connex3/palettes/connex3-tango-vero.toml"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; see the module."""
    options = _parser().parse_args(arguments)
    code: int = options.run(options)
    return code


def _more(options: argparse.Namespace) -> int:
    if options.output.exists():
        print(f"{options.output} is already there; remove it or choose another", file=sys.stderr)
        return 2
    try:
        palette = read_palette(options.palette.read_text(encoding="utf-8"))
        tests = [read_test(t) for t in json.loads(options.tests.read_text(encoding="utf-8"))]
        truth = json.loads(options.truth.read_text(encoding="utf-8"))
        campaign = further_of(palette, truth, options.campaign.name, tests, turn=options.turn)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    write_campaign(campaign, options.output)
    print(f"{len(tests)} further specimens in {options.output}")
    return 0


def _make(options: argparse.Namespace) -> int:
    folder: Path = options.output
    truth_file: Path = options.truth or folder.with_name(f"{folder.name}.truth.json")
    if folder.resolve() in truth_file.resolve().parents:
        print(f"{truth_file}: the truth must lie outside the campaigns' folder", file=sys.stderr)
        return 2
    for path in (folder, truth_file):
        if path.exists():
            print(f"{path} is already there; remove it or choose another", file=sys.stderr)
            return 2
    try:
        palette = read_palette(options.palette.read_text(encoding="utf-8"))
        groups = {"all": [t for t in TIERS if t not in LABS], "labs": list(LABS)}
        tiers = groups.get(options.tier, [options.tier])
        most = at_most(options.at_most)
        camera = Camera(options.facet_mm, options.spacing_mm, options.states_facet)
        handling = Handling(options.toe, options.percent)
        campaigns = [
            # Tiers of one set share no design and no noise
            make_campaign(
                palette, options.set, tier, options.specimens, options.seed, index, camera, handling
            )
            for number, tier in enumerate(tiers)
            for index in range(number * options.count, (number + 1) * options.count)
            if index < number * options.count + most.get(tier, options.count)
        ]
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    made_by = {
        name: getattr(options, name) for name in ("set", "tier", "count", "seed", "specimens")
    }
    if options.at_most:
        made_by["at_most"] = most
    if camera != USUAL:
        made_by["camera"] = asdict(camera)
    if handling != CAREFUL:
        made_by["handling"] = asdict(handling)
    sealed = seal(campaigns, made_by)
    print(f"{sha256(sealed)}  {truth_file.name}", flush=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    whole = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}-"))
    try:
        for campaign in campaigns:
            write_campaign(campaign, whole / campaign.name)
        truth_file.parent.mkdir(parents=True, exist_ok=True)
        truth_file.write_bytes(sealed)
        whole.chmod(0o755)
        whole.rename(folder)
    except BaseException:
        shutil.rmtree(whole, ignore_errors=True)
        raise
    print(f"{len(campaigns)} campaigns in {folder}")
    return 0


def at_most(texts: list[str]) -> dict[str, int]:
    """Read what `--at-most` says.

    Raises
    ------
    ValueError
        It is not a tier and a count.
    """
    most = {}
    for text in texts:
        tier, _, count = text.partition("=")
        if tier not in TIERS or not count.isdecimal():
            raise ValueError(f"--at-most {text}: give a tier and a count, as in none=9")
        most[tier] = int(count)
    return most


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.withheld.reality",
        description="Make measurement campaigns whose cause is known and sealed.",
    )
    commands = parser.add_subparsers(required=True, metavar="make|more")
    more = commands.add_parser("more", help="measure further specimens of a sealed campaign")
    more.add_argument("campaign", type=Path, help="folder of the campaign")
    more.add_argument("--truth", type=Path, required=True, help="what was sealed with it")
    more.add_argument("--tests", type=Path, required=True, help="the tests, a JSON list")
    more.add_argument("--turn", type=int, default=1, help="another one scatters otherwise")
    more.add_argument("--palette", type=Path, default=PALETTE, help="that it was made with")
    more.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    more.set_defaults(run=_more)
    make = commands.add_parser(
        "make", help="make campaigns and their sealed truth; prints the truth's sha256 first"
    )
    make.set_defaults(run=_make)
    make.add_argument("--set", choices=get_args(Set), required=True)
    meanings = "; ".join(f"{name}: {tier.meaning}" for name, tier in TIERS.items())
    meanings = meanings.replace("%", "%%")
    make.add_argument("--tier", choices=[*TIERS, "all", "labs"], required=True, help=meanings)
    make.add_argument("--count", type=int, required=True, help="campaigns (of each tier, for all)")
    make.add_argument("--seed", type=int, required=True, help="0 or above")
    make.add_argument("--specimens", type=int, default=30, help="of each campaign (default 30)")
    make.add_argument(
        "--at-most", action="append", default=[], metavar="TIER=N", help="the first N of a tier"
    )
    make.add_argument(
        "--facet-mm", type=float, default=USUAL.facet_mm, metavar="MM",
        help=f"length of the camera's facets (default {USUAL.facet_mm:g}); 0 sees points",
    )  # fmt: skip
    make.add_argument("--spacing-mm", type=float, metavar="MM",
                      help="from place to place (default 28 places a bar)")  # fmt: skip
    make.add_argument("--states-facet", action="store_true", help="write facet_mm into fields.csv")
    make.add_argument("--toe", type=float, default=0.0, metavar="SHARE",
                      help="deviation of where pulls begin, over their travel")  # fmt: skip
    make.add_argument("--percent", type=int, default=0, metavar="N",
                      help="specimens whose strain in per cent is written as travel")  # fmt: skip
    make.add_argument("--palette", type=Path, default=PALETTE, help="a palette file")
    make.add_argument("--truth", type=Path, help="default: DIR.truth.json beside DIR")
    make.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    return parser


if __name__ == "__main__":
    sys.exit(main())
