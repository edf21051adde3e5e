"""The cases of behaviour: command lines run one after the other, and the inputs they need.

A text is a command line of planner, run in a new folder that has the samples below ``samples``;
anything else is a function of that folder, called in between.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import behaviour_inputs as made

__all__ = ["CASES", "Case"]

Step = str | Callable[[Path], None]
_ROUNDED = 6  # digits of numbers that come from linear algebra and optimisers


@dataclass(frozen=True)
class Case:
    """What is run, and to how many digits numbers count: exactly if None.

    Pages of plans count where a case says so: they change with the viewer, all at once.

    A case that searches has optimisers or roots at work that end elsewhere, by a last digit, where
    BLAS adds in another order; on a processor other than the manifest's its numbers do not count.
    """

    steps: tuple[Step, ...]
    digits: int | None = None
    searches: bool = False
    plugin: bool = False
    page: bool = False


def _exact(*steps: Step) -> Case:
    return Case(steps)


def _close(*steps: Step) -> Case:
    return Case(steps, _ROUNDED)


def _searched(*steps: Step) -> Case:
    return Case(steps, _ROUNDED, searches=True)


def _all(form: str, *values: str) -> tuple[str, ...]:
    return tuple(form.format(value) for value in values)


_ENDS = "--from Tango --to Vero"
_BLOCK = f"grade block.stl {_ENDS}"
_COMMANDS = ("grade", "view", "check", "diff", "slices", "simulate", "invert", "materials",
             "printers", "characterise", "fit", "gap", "gap design", "gap simulate", "gap diagnose",
             "gap correct", "gap bench")  # fmt: skip


def _fields(*texts: str, part: str = "block", more: str = "") -> tuple[str, ...]:
    """Return a plan a field; the folders are named in turn."""
    return tuple(
        f"grade {part}.stl {_ENDS} --pitch 1 {more} -o f{k} --field '{text}'"
        for k, text in enumerate(texts)
    )


# The slow ones come first, so that two processes end at about one time.

_GAP = {
    "gap-warm-lab": _searched(
        made.copy_samples("warm-lab", "lab"),
        "gap diagnose lab -o diagnosis --json",
        "gap correct diagnosis --palette lab/palette.toml --temperature-C 33 -o warm.toml",
        "gap correct diagnosis/diagnosis.json --palette lab/palette.toml --temperature-C 33 "
        "--rate-per-s 0.1 --width-mm 4 --thickness-mm 2 --recalibrate --json -o json.toml",
        "gap correct diagnosis --palette lab/palette.toml --temperature-C 33 -o warm.toml",
        "gap correct diagnosis --palette lab/palette.toml --temperature-C 40 -q --force "
        "-o warm.toml",
        "gap correct diagnosis --palette lab/palette.toml -o same.toml",
        "gap correct diagnosis -o other.toml --temperature-C 33",
        "gap correct diagnosis --palette lab/palette.toml --temperature-C 900 -o no.toml",
        "gap correct diagnosis --palette lab/palette.toml --soak-h -1 -o no.toml",
        "gap correct diagnosis --palette lab/palette.toml --orientation w -o no.toml",
        "gap correct diagnosis --palette lab/palette.toml --temperature-C 33 -o no/such/p.toml",
        "gap correct lab --palette lab/palette.toml -o no.toml",
        "gap correct absent.json -o no.toml",
        "gap diagnose lab -o diagnosis",
        "gap diagnose lab -o lab",
        "gap next diagnosis",
        "gap next lab --json",
        "materials --palette warm.toml --json",
    ),
    "gap-without": _searched("gap diagnose samples/warm-lab --without temperature"),
    "gap-altered": _searched(made.altered_lab, "gap diagnose lab -o diagnosis --seed 3"),
    "gap-camera": _searched(
        made.campaign,
        "gap simulate --design bars --camera -o made "
        "--effect interface-bleed:length=1.5,form=gaussian",
        "gap diagnose made -o diagnosis -q",
    ),
    "gap-two-effects": _searched(
        made.specimens("two"),
        "gap simulate --design two.csv --effect rate:rise=0.25 "
        "--effect moisture:softening=0.3 --seed 4 --json -o made",
        "gap diagnose made",
    ),
    "gap-none": _searched(
        made.specimens("rates"),
        "gap simulate --design rates.csv --scatter 0.02 -o made",
        "gap simulate --design rates.csv --scatter 0.02 -o made",
        "gap diagnose made -q -o diagnosis",
        "gap correct diagnosis --palette made/palette.toml -o none.toml",
    ),
    "gap-design": _close(
        "gap design --effects rate,moisture --budget 10 -o plan",
        "gap simulate --design plan --effect rate:rise=0.12,form=power-law -q -o made",
        "gap design --effects rate,moisture --budget 10 -o plan",
    ),
    "gap-design-csv": _close(
        "gap design --effects temperature --budget 6 --width-mm 4 --thickness-mm 2 "
        "--gauge-mm 20 --json -o plan.csv"
    ),
    "gap-design-alike": _close(
        "gap design --effects force-scale,cross-section --budget 6 -o plan.csv"
    ),
    "gap-design-refused": _exact(
        "gap design --effects rate,moisture,temperature --budget 4 -o plan",
        "gap design --effects rat --budget 12 -o plan",
        "gap design --effects '' --budget 12 -o plan",
        "gap design --effects rate --budget 0 -o plan",
        "gap design --effects rate --budget 12 --gauge-mm -3 -o plan",
        "gap design --effects rate,rate --budget 3 -o plan.csv",
        "gap design --effects rate --budget 12",
        "gap design --effects rate --budget 4 --palette nothing.toml -o plan",
        "gap design --effects rate --budget 4 -o no/such/plan.csv",
    ),
    "gap-simulate-refused": _exact(
        made.specimens("rates"),
        made.write("bare.csv", "specimen,material,gauge_mm\nA,FLX9760,25\n"),
        *_all(
            "gap simulate --design rates.csv --effect {} -o made",
            "rat:rise=0.1", "rate:rise=0.1,form=powerlaw", "rate:slope=0.1", "rate:rise",
            "rate:rise=9", "rate:rise=nan",
        ),
        "gap simulate --design rates.csv --scatter 1 -o made",
        "gap simulate --design rates.csv --seed -1 -o made",
        "gap simulate --design bare.csv -o made",
        "gap simulate --design absent.csv -o made",
        "gap simulate --design rates.csv -o no/such/folder",
    ),
    "gap-diagnose-refused": _exact(
        made.bad_laboratories,
        *_all(
            "gap diagnose bad-{}",
            "no-column", "no-rate", "material", "unit", "cell", "hot", "protocol", "toml", "key",
            "palette", "empty", "nobody",
        ),
        "gap diagnose nothing",
        "gap diagnose absent",
        "gap diagnose samples/warm-lab --without temprature",
        "gap diagnose samples/warm-lab --palette nothing.toml",
        "gap diagnose samples/warm-lab --seed -1",
    ),
}  # fmt: skip

_GRADE_AXIS = {
    "grade-finger": _exact(
        f"grade samples/finger.stl {_ENDS} --axis x",
        "check finger-graded --json",
        f"grade samples/finger.stl {_ENDS} --axis x",
        f"grade samples/finger.stl {_ENDS} --axis x --bands 4 --force -q",
    ),
    "grade-gripper-tilted": _exact(
        "grade samples/gripper.stl --from FLX9740 --to RGD8425 --axis 1,0,2 --bands 6"
    ),
    "view": Case(
        (
            made.meshes, f"{_BLOCK} -q", made.remove("block-graded/plan.html"),
            "view block-graded --no-open", "view block-graded/plan.json --no-open --json",
            "view blok-graded --no-open", f"{_BLOCK} -q -o without --no-page",
        ),
        page=True,
    ),
    "grade-dogbone": _exact("grade samples/dogbone-thesis.stl --from Tango --to FLX9795 --dry-run"),
    "grade-axis-default": _exact(made.meshes, _BLOCK, f"{_BLOCK} --json -o again"),
    "grade-axes": _exact(
        made.meshes,
        *(f"{_BLOCK} --axis={axis} -o a{k}" for k, axis in enumerate(
            ("x", "-x", "y", "-z", "1,0,2", "-1,1,0.5"))),
    ),
    "grade-profiles": _exact(
        made.meshes,
        made.profiles,
        *_all(f"{_BLOCK} --axis x --profile {{0}} -o {{0}}", "log", "linear", "smooth", "steps:4"),
        "grade block.stl --from FLX9740 --to FLX9795 --profile linear -o straight",
        "grade block.stl --profile moduli.csv -o moduli",
        "grade block.stl --profile jump.csv --axis -x -o jump",
        "grade block.stl --profile named.csv -o named",
        f"{_BLOCK} --profile moduli.csv -o both",
        "grade block.stl --from Vero --to Tango --profile linear --bands 5 -o down",
    ),
    "grade-bands": _exact(
        made.meshes,
        *(f"{_BLOCK} --bands {n} -o b{n}" for n in (1, 2, 7, 30)),
        f"{_BLOCK} --bands 5 --json --profile linear -o json",
    ),
    "grade-options": _exact(
        made.meshes,
        made.palette,
        f"{_BLOCK} --at-strain 0.3 -o strained",
        f"grade small.stl {_ENDS} --unit cm --bands 3 -o cm",
        f"grade small.stl {_ENDS} --unit inch --bands 3 --dry-run --json",
        "grade block.stl --from gum --to Heel --palette user.toml -o user",
        f"{_BLOCK} --palette samples.toml --dry-run",
        f"{_BLOCK} --palette connex3-tango-vero --printer connex3 --dry-run -q",
        "grade block.stl --from FLX9740 --to FLX9795 -q -o quiet",
        "grade two.stl --from FLX9740 --to FLX9795 -o two",
    ),
    "grade-formats": _exact(
        made.meshes,
        *_all("grade {} --from Tango --to FLX9760 --bands 2 --force -o out",
              "ascii.stl", "block.off", "block.ply", "block.obj"),
        "grade out/block.3mf --from Tango --to FLX9760",
    ),
    "grade-force": _exact(
        made.meshes,
        f"{_BLOCK} --bands 2 -o out",
        f"{_BLOCK} --bands 3 -o out",
        f"{_BLOCK} --bands 3 -o out --force",
        made.write("other/notes.txt", "mine\n"),
        f"{_BLOCK} --bands 3 -o other",
        f"{_BLOCK} --bands 3 -o other --force",
        f"{_BLOCK} --bands 2 --dry-run -o out",
    ),
    "grade-findings": _exact(
        made.meshes,
        made.profiles,
        "grade block.stl --profile far.csv -o far",
        "grade block.stl --profile far.csv --strict -o strict",
        "grade block.stl --profile far.csv --json -o json",
        f"grade plate.stl {_ENDS} -o plate",
        f"grade plate.stl {_ENDS} --strict -q -o plate-strict",
        f"grade ramp.stl {_ENDS} --axis y -o ramp",
        f"{_BLOCK} --axis z --bands 20 -o thin",
        f"{_BLOCK} --field 'distance: surface' --pitch 0.8 --bands 9 -o curved",
        f"{_BLOCK} --field 'distance: surface' --pitch 0.8 --bands 9 --strict -o curved-strict",
    ),
}  # fmt: skip

_GRADE_FIELD = {
    "field-radial": _exact(
        made.meshes,
        *_fields("radial: line=0 5 4 1 0 0", "radial: point=0 0 0, from=2, to=20", "radial:",
                 "radial: line=0 5 4 1 0 0, from=6, to=1"),
    ),
    "field-distance": _exact(
        made.meshes,
        *_fields("distance: surface, to=3", "distance: core.stl, to=6",
                 "distance: box=-1 -1 -1 1 11 9", "distance: plane=0 0 0 1 0 1"),
        f"grade washer.stl {_ENDS} --pitch 1 -o hole --field 'distance: hole=4 0 3'",
    ),
    "field-harmonic": _exact(
        made.meshes,
        *_fields("harmonic: from=x<3, to=x>=20", "harmonic: from=ball 0 5 4 3, to=core.stl"),
        f"grade washer.stl {_ENDS} --pitch 1 -o ring "
        "--field 'harmonic: from=box -11 -2 -1 -3 2 7, to=x>8'",
    ),
    "field-geodesic": _exact(
        made.meshes,
        *_fields("geodesic: start=ball 0 0 0 3", "geodesic: start=plane 20 0 0 1 0 0, to=15"),
        f"grade washer.stl {_ENDS} --pitch 1 -o ring --field 'geodesic: start=x<-7'",
    ),
    "field-expression": _exact(
        made.meshes,
        *_fields("expression: 0.5 + 0.3*sin(2*pi*x/20) + 0.2*cos(2*pi*z/12)",
                 "expression: clamp(hypot(y - 5, z - 4) / 6, 0, 1)", "expression: u ^ 2",
                 "expression: d / 4", more="--bands 4"),
    ),
    "field-table": _exact(
        made.meshes,
        made.tables,
        *_fields("table: grid.csv", "table: grid.vti, from=0, to=20",
                 "table: grid.npy, origin=-1 -1 -1, step=2 4 5", "table: two.csv, array=back",
                 more="--bands 4"),
    ),
    "field-points": _exact(
        made.meshes,
        made.tables,
        *_fields("points: points.csv", "points: points.vtu, array=strain", more="--bands 4"),
    ),
    "field-composed": _exact(
        made.meshes,
        *_fields("min(axis: x; radial: point=24 5 4, from=0, to=20)",
                 "max(axis: x; axis: z)",
                 "blend(axis: x; radial: point=0 5 4, from=0, to=20; 0.5)",
                 "clamp(axis: x; 0.2; 0.7)", "axis: 1 0 1", more="--bands 4"),
    ),
    "field-finger": _exact(
        f"grade samples/finger.stl {_ENDS} --pitch 1.6 --field 'radial: line=0 8 8 1 0 0' -o out",
        "check out",
    ),
    "field-refused": _exact(
        made.meshes,
        made.bad_fields,
        *_fields(
            "radil: point=0 0 0", "radial: point=0 0", "radial: pont=0 0 0", "radial: line=0 0 0",
            "radial: point=0 0 0, line=0 0 0 1 0 0", "radial: from=3, to=3", "radial: from=nan",
            "distance:", "distance: absent.stl", "distance: hole=50 50 50",
            "distance: box=50 50 50 60 60 60", "distance: plane=0 0 0 0 0 0",
            "harmonic: from=x<3", "harmonic: from=x<-3, to=x>20", "harmonic: from=x<30, to=x>-1",
            "harmonic: from=w<3, to=x>20", "geodesic:", "geodesic: start=ball 90 90 90 1",
            "expression: import os", "expression: x +", "expression: 1/0", "expression: q",
            "expression: __import__(1)", "expression: 0.5", "expression: sqrt(x - 50)",
            "table: absent.csv", "table: nan.csv", "table: nothing.csv", "table: uneven.csv",
            "table: columns.csv", "table: two.csv", "table: two.csv, array=c", "table: table.txt",
            "table: broken.vti", "table: nan.npy", "table: broken.npy, origin=0 0 0, step=9 9 9",
            "table: nan.npy, origin=0 0 0, step=9 9 9",
            "table: flat.npy, origin=0 0 0, step=9 9 9",
            "points: nothing.csv", "points: absent.vtu", "axis: w", "min(axis: x)",
            "blend(axis: x; axis: y)", "blend(axis: x; axis: y; 2)", "clamp(axis: x; 0.7; 0.2)",
            "min(axis: x; axis: y", "mni(axis: x; axis: y)", "", "x",
        ),
        f"{_BLOCK} --field 'axis: x' --axis x",
        f"{_BLOCK} --field 'radial:' --pitch 0",
        f"{_BLOCK} --field 'radial:' --pitch -1",
        f"{_BLOCK} --field 'radial:' --pitch 40 -o coarse",
        f"{_BLOCK} --field 'radial:' --pitch 0.0001 -o fine",
        f"{_BLOCK} --pitch 1 -o pitched",
    ),
}  # fmt: skip

_GRADE_BLEND = {
    "blend-dither": _exact(
        made.meshes,
        "grade block.stl --from FLX9750 --to FLX9785 --blend dither --cell 2 -o out",
        "check out",
        "grade block.stl --from FLX9750 --to FLX9785 --blend dither --cell 1.6 --axis 1,0,1 "
        "--json -o tilted",
        "grade block.stl --from FLX9750 --to FLX9785 --blend dither --cell 2 --pitch 1 "
        "--field 'radial: line=0 5 4 1 0 0' -o radial",
    ),
    "blend-bands": _exact(
        made.meshes,
        "grade block.stl --from Tango --to FLX9785 --blend bands:2 -o two",
        "check two",
        "grade block.stl --from Tango --to FLX9785 --blend bands:3 --axis=-x --json -o three",
        "grade block.stl --from Tango --to FLX9785 --blend bands:2 --pitch 1 "
        "--field 'distance: plane=0 0 0 1 0 1' -o plane",
        "grade block.stl --from Tango --to FLX9785 --blend bands:2 --pitch 1 "
        "--field 'radial: point=0 0 0' -o radial",
    ),
    "blend-mix": _exact(
        made.meshes,
        f"{_BLOCK} --blend mix --bands 6 -o six",
        "check six",
        f"{_BLOCK} --blend mix --json -o free",
        f"{_BLOCK} --blend mix --bands 4 --pitch 1 --field 'radial: line=0 5 4 1 0 0' -o radial",
    ),
    "blend-refused": _exact(
        made.meshes,
        *_all(f"{_BLOCK} --blend {{}}", "mixed", "bands", "bands:0", "bands:x", "dither:3"),
        f"{_BLOCK} --blend dither --bands 4",
        f"{_BLOCK} --blend bands:2 --bands 4",
        f"{_BLOCK} --blend dither --cell 0",
        f"{_BLOCK} --blend dither --cell 0.01",
        f"{_BLOCK} --blend dither --cell 90 -o large",
        f"{_BLOCK} --cell 1 -o cell",
    ),
}

_GRADE_REFUSED = {
    "refused-meshes": _exact(
        made.bad_meshes,
        *_all(f"grade {{0}}.stl {_ENDS} --bands 2 -o out-{{0}}",
              "open", "turned", "inside-out", "nan", "inf", "flat", "overlapping", "double",
              "huge", "metres", "tiny", "empty", "none", "text", "short", "folder", "absent"),
        f"grade metres.stl {_ENDS} --bands 2 --unit m -o metres",
        f"grade tiny.stl {_ENDS} --bands 2 --unit um -o um",
        f"grade part.step {_ENDS}",
        f"grade part.3mf {_ENDS}",
    ),
    "refused-options": _exact(
        made.meshes,
        made.write("file", "not a folder\n"),
        "grade block.stl",
        "grade block.stl --from Tango",
        "grade block.stl --to Tango",
        "grade block.stl --from Tango --to Tango",
        "grade block.stl --from Tnago --to Vero",
        "grade block.stl --from FLX97 --to Vero",
        "grade block.stl --from '' --to Vero",
        *_all(f"{_BLOCK} {{}}",
              "--bands 0", "--bands 9000", "--bands -3", "--bands many", "--bnads 3",
              "--at-strain 10", "--at-strain 0", "--at-strain nan", "--at-strain 0.95",
              "--profile lgo", "--profile steps", "--profile steps:0", "--profile steps:x",
              "--unit inches2", "--unit ''", "--printer conex3", "--palette nothing.toml",
              "--palette connex3-tango-verp", "-o no/such/place", "-o file", "-o file/below",
              "--axis w", "--axis 0,0,0", "--axis 1,2", "--axis nan,0,1", "--axis ''",
              "--json --quiet -o fine", "--strict --dry-run"),
        "grade",
        f"grade block.stl block.stl {_ENDS}",
    ),
    "refused-profiles": _exact(
        made.meshes,
        made.bad_profiles,
        *_all("grade block.stl --profile {}.csv",
              "empty", "heading", "columns", "word", "nan", "negative", "falling", "short",
              "misspelt", "ragged", "both", "binary", "absent"),
    ),
    "refused-palettes": _exact(
        made.bad_palettes,
        *_all("materials --palette {}.toml",
              "empty", "syntax", "schema", "unknown", "crossing", "same", "one", "density", "law",
              "missing", "colour", "unstable"),
        "materials --palette .",
        "invert -m 1 --palette crossing.toml",
        "simulate Gum --palette crossing.toml",
    ),
}  # fmt: skip

_PLANS = {
    "check": _exact(
        made.meshes,
        f"{_BLOCK} --bands 3 -q -o out",
        "check out",
        "check out --json",
        "check out -q",
        "check out/plan.json",
        made.damage_shell("out"),
        "check out",
        "check out --json",
        "check out -q",
        lambda folder: min((folder / "out" / "stl").iterdir()).unlink(),
        "check out",
        "check out --json",
        "check .",
        "check absent",
    ),
    "check-edited": _exact(
        made.meshes,
        f"{_BLOCK} --bands 3 -q -o out",
        made.edit("out/plan.json", '"FLX9750"', '"FLX9760"'),
        "check out",
        made.write("out/plan.json", "{}\n"),
        "check out",
        made.write("out/plan.json", "not json\n"),
        "check out --json",
        f"{_BLOCK} --bands 2 -q -o second",
        made.remove("second/block.3mf"),
        "check second",
        made.remove("second/HOWTO.md"),
        made.write("second/stl/more.stl", "extra\n"),
        "check second",
    ),
    "diff": _exact(
        made.meshes,
        f"{_BLOCK} --bands 3 -q -o a",
        f"{_BLOCK} --bands 3 -q -o b",
        f"{_BLOCK} --bands 4 -q -o c",
        "grade block.stl --from Tango --to FLX9795 --bands 3 --at-strain 0.2 -q -o d",
        f"grade ramp.stl {_ENDS} --bands 3 -q -o e",
        "diff a b",
        "diff a/plan.json b --json",
        "diff a c",
        "diff a c --json",
        "diff c d --json",
        "diff d a",
        "diff a e -q",
        "diff a e",
        "diff a e --tolerance 0.9",
        *_all("diff a b --tolerance={}", "-1", "nan", "inf", "much"),
        "diff a .",
        "diff absent a",
        "diff a",
    ),
    "slices": _exact(
        made.meshes,
        f"{_BLOCK} --bands 3 -q -o out",
        "slices out -o coarse --pitch 1",
        "slices out/plan.json -o indexed --pitch 0.5,1,2 --indexed --json",
        "slices out -o coarse --pitch 1",
        "slices out -o coarse --pitch 2 --force -q",
        "slices out -o own --pitch 0.2,0.2,2",
    ),
    "slices-blends": _exact(
        made.meshes,
        f"{_BLOCK} --blend mix --bands 4 -q -o mix",
        "slices mix -o mix-slices --pitch 1",
        "grade block.stl --from FLX9750 --to FLX9785 --blend dither --cell 2 -q -o dither",
        "slices dither -o dither-slices --pitch 0.5 --indexed",
        "grade washer.stl --from Tango --to Vero --pitch 1 --field 'distance: hole=4 0 3' -q "
        "-o field",
        "slices field -o field-slices --pitch 0.7",
    ),
    "slices-refused": _exact(
        made.meshes,
        f"{_BLOCK} --bands 2 -q -o out",
        "slices out",
        *_all("slices out -o s --pitch {}", "0", "-1", "a", "1,2", "1,2,3,4", "nan", "0.0001",
              "100"),
        "slices absent -o s",
        "slices . -o s",
        "slices out -o no/such/place",
        "slices out -o s --printer conex3 --pitch 1",
        "slices out -o out --pitch 1",
        "slices out -o out --pitch 1 --force",
        made.damage_shell("out"),
        "slices out -o s --pitch 1",
    ),
}  # fmt: skip

_SIMULATE = {
    "simulate-plan": _close(
        "grade samples/dogbone-thesis.stl --from Tango --to FLX9795 --bands 5 -q -o bar",
        "simulate bar --to-strain 0.1 -o pull.csv --field strain.csv --figure pull.svg "
        "--steps 10 --slices 60",
        "simulate bar/plan.json --to-strain 0.35 --steps 12 --slices 60",
        "simulate bar --between 36.5:65.9 --to-strain 0.2 --steps 5 --slices 40 --json",
        "simulate bar --to-strain 0.1 -o pull.csv --steps 5",
        "simulate bar --to-strain 0.05 -o pull.csv --force --steps 5 --slices 40 -q",
        "simulate bar --between 65:36 --steps 5",
        "simulate bar --between 500:600 --steps 5",
        "simulate bar --between here --steps 5",
    ),
    "simulate-profile": _close(
        made.bars,
        "simulate bar.csv --steps 8 --slices 40 --to-strain 0.1 -o bar.json",
        "simulate waist.csv --steps 8 --slices 40 --protocol cyclic --cycles 2 --to-strain 0.15 "
        "-o waist.csv.csv --field field.csv --figure waist.svg",
        "simulate bar.csv --steps 5 --slices 20 --width-mm 3 --thickness-mm 2 --level 0.5 "
        "--to-strain 0.05 --json",
        "simulate bar.csv --to-strain 3 --steps 20 --slices 20",
    ),
    "simulate-coupon": _close(
        made.palette,
        "simulate FLX9760 --steps 10",
        "simulate tango --protocol relaxation --hold-s 60 --steps 10 --rate 2 -o relax.csv "
        "--figure relax.svg",
        "simulate FLX9760 --protocol cyclic --cycles 3 --steps 4 --json --to-strain 0.2",
        "simulate Vero --to-strain 0.5 --steps 10 -o break.json",
        "simulate Heel --palette user.toml --steps 5 --gauge-mm 20 --width-mm 2 --thickness-mm 1",
        "simulate FLX9760 --to-strain 9 --steps 10",
    ),
    "simulate-refused": _exact(
        made.bars,
        *_all("simulate bad-{}.csv", "range", "order", "columns", "cell", "width", "empty"),
        "simulate absent.csv",
        "simulate Tnago",
        "simulate .",
        *_all("simulate FLX9760 {}",
              "--protocol cylic", "--cycles 0", "--steps 0", "--hold-s -1", "--to-strain 0",
              "--to-strain nan", "--rate 0", "--width-mm 0", "--gauge-mm -1", "--level 1",
              "--between 3:9", "-o out.txt", "-o no/such/out.csv", "--field field.txt",
              "--figure figure.png", "--palette nothing.toml", "--printer conex3", "--slices 0"),
        "simulate bar.csv --slices 0",
        "simulate",
    ),
}  # fmt: skip

_MATERIALS = {
    "invert": _close(
        made.palette,
        "invert -m 1.2",
        "invert --modulus 1.2 --at-strain 0.2 --json",
        "invert -m 0.5 -m 20 -m 300",
        "invert -m 0.001 -m 1 --json",
        "invert -m 9e9",
        "invert -m 2 --palette user.toml",
        "invert -m 0.362",
        "invert --coordinate 0.4 --coordinate 1.2 --at-strain 0.2",
        "invert --coordinate 0.5 --palette user.toml --json",
        "invert --coordinate 2",
        *_all("invert --modulus={}", "0", "-1", "nan", "inf", "soft"),
        "invert",
        "invert -m 1 --at-strain 5",
        "invert -m 1 --printer conex3",
    ),
    "materials": _close(
        made.palette,
        "materials",
        "materials --json",
        "materials --at-strain 0.3",
        "materials --palette user.toml",
        "materials --palette user.toml --json --at-strain 0.05",
        "materials --palette samples/warm-lab/palette.toml",
        "materials --at-strain 0",
        "materials --palette nothing.toml",
    ),
    "printers": _exact("printers", "printers --json", "printers --jsn"),
    "second-printer": Case(
        (
            made.meshes,
            "printers",
            "printers --json",
            "materials --printer duojet",
            "grade block.stl --from Soft --to Hard --printer duojet -o out",
            "check out",
            "slices out -o layers --pitch 1",
            "simulate out --to-strain 0.05 --steps 4 --slices 20",
            f"{_BLOCK} --printer duojt",
        ),
        _ROUNDED,
        plugin=True,
    ),
}

_TENSILE = {
    "characterise": _close(
        made.columns,
        "characterise samples/tensile",
        "characterise samples/tensile -o materials.csv --json --at-strain 0.05 --at-strain 0.2",
        "characterise samples/tensile -o materials.csv",
        "characterise samples/tensile -o materials.csv --force -q",
        "characterise samples/tensile/soft-1.txt samples/tensile/soft-2.txt --material rubber "
        "--width-mm 3 --thickness-mm 2 --gauge-mm 15",
        "characterise bare --columns stretch,stress_MPa,- -o bare.csv",
        "characterise apart --width-mm 3 --thickness-mm 2 --gauge-mm 15",
    ),
    "tensile-refused": _exact(
        made.bad_tensile,
        made.write("list.csv", "specimen,material\nA,B\n"),
        *_all("characterise {}.csv --width-mm 3 --thickness-mm 2 --gauge-mm 15",
              "empty", "words", "few", "unit", "cell", "unloaded", "swapped", "percent", "back",
              "one-column", "bytes", "absent"),
        "characterise few.csv",
        "characterise samples/tensile --specimens absent.csv",
        "characterise samples/tensile --specimens list.csv",
        "characterise samples/tensile --at-strain 0",
        "characterise samples/tensile -o no/such/place.csv",
        "characterise samples/tensile/soft-1.txt --width-mm 0",
        "characterise samples/tensile/soft-1.txt samples/tensile/soft-1.txt",
        "characterise samples/finger.stl",
        "characterise",
        "fit few.csv words.csv --width-mm 3 --thickness-mm 2 --gauge-mm 15",
        "fit samples/tensile --law ogdn",
        "fit samples/tensile --weighting none",
        "fit samples/tensile --starts 0",
        "fit samples/tensile --level 2",
        "fit samples/tensile --law neo-hookean --starts 2 --coordinate SYN-soft=much",
        "fit samples/tensile --law neo-hookean --starts 2 --coordinate nobody=0.5",
        "fit samples/tensile --law neo-hookean --starts 2 --density SYN-soft=-1",
        "fit absent",
        "fit samples/tensile --law neo-hookean --starts 2 -o no/such/place.toml",
    ),
    "fit-all": _searched(
        "fit samples/tensile --starts 4 -o lab.toml",
        "materials --palette lab.toml",
        "fit samples/tensile --starts 4 -o lab.toml",
    ),
    "fit-laws": _searched(
        *(f"fit samples/tensile --law {law} --starts 3 -o {law}.toml --json"
          for law in ("ogden", "yeoh", "martins", "neo-hookean")),
        "fit samples/tensile --law yeoh --starts 3 --weighting absolute --level 0.8 -q "
        "--name mine --density SYN-soft=1.1 -o absolute.toml",
    ),
    "fit-columns": _searched(
        made.columns,
        "fit bare --columns stretch,stress_MPa,- --law neo-hookean --starts 2 -o bare.toml "
        "--coordinate A=0.2 --coordinate B=0.9",
        "fit apart --width-mm 3 --thickness-mm 2 --gauge-mm 15 --law neo-hookean --starts 2",
        "fit bare --columns stretch,stress_MPa,- --law neo-hookean --starts 2 -o turned.toml "
        "--coordinate A=0.9 --coordinate B=0.2",
    ),
}  # fmt: skip

_HELP = {
    "help": _exact("--help", "-h", "", "--version", *(f"{c} --help" for c in _COMMANDS)),
    "usage": _exact(
        "grad", "gap diagnos lab", "gap", "polish part.stl", "--versoin", "grade --frm Tango",
        "check", "invert --modulos 1", "grade a.stl --from", "materials extra", "gap bench",
        "printers extra", "gap bench absent --truth absent.json",
    ),
}  # fmt: skip

CASES: dict[str, Case] = {
    **_GAP,
    **_GRADE_FIELD,
    **_GRADE_BLEND,
    **_GRADE_AXIS,
    **_PLANS,
    **_TENSILE,
    **_SIMULATE,
    **_GRADE_REFUSED,
    **_MATERIALS,
    **_HELP,
}
