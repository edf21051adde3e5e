"""Text of any document that becomes a page, an SVG, a CSV or Markdown stays text.

Each string and each key of a document is replaced in turn, or all at once where that stays sound,
by markup and a formula. What comes of it is refused, or built of the same elements and attributes
as with plain words of that length in their place; and no cell of a table is a formula.
"""

import copy
import csv
import dataclasses
import html
import io
import json
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator, Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

import planner
from planner.errors import PlannerError
from planner.formats.tables import encode_csv, read_rows
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.diagnosis import Diagnosis, Traces, read_diagnosis
from planner.glance import as_words
from planner.grading.profile import stiffness_scale
from planner.materials.study import read_study
from planner.plan import Finding, Unreachable
from planner.report.gap_page import diagnosis_files
from planner.report.markdown import to_html

HOSTILE = '=HYPERLINK("http://x")<!--<script>x</script>"\'&](http://y)|\x01'
PLAIN = re.sub(r"[^-\w:/.]", "w", HOSTILE)  # lines break at the same places
FORMULA = re.compile(r"[=+\-@\t\r＝＋－＠]")
FIGURE = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?")

# ------------------------------------------------------------------------------------------------
# What a document is made of, and what an output is built of.


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the way to each string, and to each key, which ends in None."""
    if isinstance(value, str):
        yield at
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield (*at, key, None)
            yield from places(inner, (*at, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from places(inner, (*at, index))


def put(document: Any, way: tuple[Any, ...], text: str) -> Any:
    """Return a document with a text at a place."""
    made = inner = copy.deepcopy(document)
    last = -2 if way[-1] is None else -1
    for step in way[:last]:
        inner = inner[step]
    if way[-1] is None:
        held = {(text if key == way[-2] else key): value for key, value in inner.items()}
        inner.clear()
        inner.update(held)
    else:
        inner[way[-1]] = text
    return made


def sound_places(document: Any, read: Callable[[Any], object]) -> list[tuple[Any, ...]]:
    """Return the places where any text may stand, as far as reading tells; keys come last."""
    found = []
    for way in sorted(places(document), key=lambda way: (way[-1] is None, -len(way))):
        try:
            read(put(document, way, HOSTILE))
        except PlannerError:
            continue
        found.append(way)
    return found


def filled(document: Any, ways: list[tuple[Any, ...]], text: str) -> Any:
    """Return a document with different texts of one length at all these places."""
    for number, way in enumerate(ways):
        document = put(document, way, f"{text}{number:03d}")
    return document


class _Skeleton(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.built: list[Any] = []
        self.raw = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.raw = tag if tag in ("script", "style") else ""
        self.built.append((tag, [name for name, _ in attrs]))

    def handle_endtag(self, tag: str) -> None:
        self.raw = ""
        self.built.append(tag)

    def handle_data(self, data: str) -> None:
        if self.raw:  # here a browser knows of no escape
            self.built.append((data.count("<"), data.count("-->")))

    def handle_comment(self, data: str) -> None:
        self.built.append("a comment")

    def handle_decl(self, decl: str) -> None:
        self.built.append(decl)

    def unknown_decl(self, data: str) -> None:
        self.built.append("a declaration")

    handle_pi = unknown_decl


def built_of(name: str, data: bytes) -> Any:
    """Return what a browser, a spreadsheet or a renderer of Markdown makes elements of."""
    text = data.decode("utf-8")
    if name.endswith(".svg"):
        return [(one.tag, sorted(one.attrib)) for one in ElementTree.fromstring(text).iter()]
    if name.endswith(".csv"):
        rows = list(csv.reader(io.StringIO(text, newline="")))
        formulas = [
            cell for row in rows for cell in row
            if FORMULA.match(cell) and not FIGURE.fullmatch(cell)
        ]  # fmt: skip
        assert not formulas, formulas
        return list(map(len, rows))
    if name.endswith(".md"):
        assert not re.search(r"(?<!\\)<[A-Za-z/!?]|\]\(http://y", text)
        text = to_html(text)
    parser = _Skeleton()
    parser.feed(text)
    parser.close()
    return parser.built


Made = Mapping[str, bytes]


def made_by(make: Callable[[], Made]) -> dict[str, Any] | None:
    """Return what each output is built of; None of what is refused."""
    try:
        return {name: built_of(name, data) for name, data in make().items()}
    except PlannerError:
        return None


def test_the_measure_sees_what_it_is_for() -> None:
    """Without an escape each kind of output would be built otherwise."""
    for name, text in (
        ("x.html", "<p>{}</p>"), ("x.html", '<p title="{}">'), ("x.html", "<script>{}</script>"),
        ("x.html", "<p title='{}'>"),
    ):  # fmt: skip
        one, other = (built_of(name, text.format(words).encode()) for words in (HOSTILE, PLAIN))
        assert one != other
    with pytest.raises(ElementTree.ParseError):
        built_of("x.svg", f"<svg>{HOSTILE}</svg>".encode())
    for name in ("x.csv", "x.md"):
        with pytest.raises(AssertionError):
            built_of(name, HOSTILE.encode())


# ------------------------------------------------------------------------------------------------
# plan.json.


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan with all that a plan may hold: a finding, a remark, a target out of reach."""
    bar = trimesh.creation.box((30.0, 6.0, 4.0))
    plan = planner.grade(
        bar, from_="Tango", to="FLX9740", axis="x", name="bar", blend="dither", cell_mm=2
    )
    short = dataclasses.replace(
        plan,
        findings=(Finding("thin", "too thin", "TangoPlus", (1.0, 1.0, 1.0), None, 0.1),),
        warnings=("a remark",),
        unreachable=(Unreachable((0.0, 0.1), (0.1, 0.2), "TangoPlus", 0.3),),
        part=dataclasses.replace(plan.part, repairs=("turned",)),
    )
    return short.write(tmp_path_factory.mktemp("plans") / "bar")


def _plan_outputs(folder: Path) -> Made:
    return {
        "plan.html": planner.plan_page(folder),
        "notebook.html": planner.read_plan(folder)._repr_html_().encode(),
    }


@pytest.mark.slow
def test_a_plans_strings_stay_text(sound: Path, tmp_path: Path) -> None:
    """Each on the plan's own page; then all of them on that of two plans, and over its layers."""
    folder = Path(shutil.copytree(sound, tmp_path / "bar"))
    document = json.loads((sound / "plan.json").read_text())

    def outputs(changed: object) -> dict[str, Any] | None:
        (folder / "plan.json").write_text(json.dumps(changed))
        return made_by(lambda: _plan_outputs(folder))

    own, ways = outputs(document), []
    for way in sorted(places(document), key=lambda way: (way[-1] is None, -len(way))):
        if way[:2] == ("regions", 1):
            continue  # as the first one
        hostile = outputs(put(document, way, HOSTILE))
        if hostile not in (None, own):
            assert hostile == outputs(put(document, way, PLAIN)), way
        if hostile is not None and way[:2] != ("gradient", "field"):
            ways.append(way)
    assert {("part", "sha256"), ("palette", "sha256"), ("regions", 0, "material")} <= set(ways)
    seen = []
    for number, text in enumerate((HOSTILE, PLAIN)):
        (folder / "plan.json").write_text(json.dumps(filled(document, ways, text)))
        layers = tmp_path / f"layers-{number}"
        planner.write_slices(folder, layers, pitch_mm=2.0)
        seen.append({name: built_of(name, data) for name, data in {
            "compare.html": planner.compare_page(folder, folder),
            "layers.csv": (layers / "layers.csv").read_bytes(),
        }.items()})  # fmt: skip
    assert seen[0] == seen[1]


def test_a_loaded_part_and_its_figures(sound: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(sound, tmp_path / "bar"))
    document = json.loads((sound / "plan.json").read_text())
    seen = []
    for text in (HOSTILE, PLAIN):
        (folder / "plan.json").write_text(json.dumps(put(document, ("part", "file"), text)))
        bent = planner.simulate(folder, fix="x=min", gravity="-z", cell_mm=3.0, steps=1)
        pulled = planner.simulate(folder, steps=2, slices=10)
        seen.append({name: built_of(name, data) for name, data in {
            "part.html": planner.part_page(dataclasses.replace(bent, notes=(text,))),
            "part.svg": planner.simulation_figure(bent), "part.csv": bent.csv(),
            "bar.svg": planner.simulation_figure(pulled), "bar.csv": pulled.csv(),
            "field.csv": pulled.field_csv(), "bent.html": bent._repr_html_().encode(),
            "pulled.html": pulled._repr_html_().encode(),
        }.items()})  # fmt: skip
    assert seen[0] == seen[1]


# ------------------------------------------------------------------------------------------------
# Palettes.


def _toml(value: object) -> str:
    """Write a value in TOML, tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return "inf" if value == float("inf") else json.dumps(value)


def test_a_palettes_strings_stay_text(samples: Path, tmp_path: Path) -> None:
    palette = tomllib.loads((samples / "warm-lab" / "palette.toml").read_text())
    palette["material"] = palette["material"][:3]
    palette["base_resins"] = ["Tango", "Vero"]
    for number, material in enumerate(palette["material"]):
        material["aliases"], material["source"] = [f"alias {number}"], "a lab"
    file = tmp_path / "palette.toml"

    def read(document: dict[str, Any]) -> planner.Palette:
        file.write_text("\n".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in document.items()))
        return planner.load_palette(file)

    read(palette)
    ways = sound_places(palette, read)
    assert {("name",), ("base_resins", 0), ("material", 0, "aliases", 0)} <= set(ways)
    assert ("material", 0, "colour") not in ways
    seen = []
    for text in (HOSTILE, PLAIN):
        known = read(filled(palette, ways, text))
        bar = trimesh.creation.box((30.0, 6.0, 4.0))
        soft, hard = known.materials[0].id, known.materials[-1].id
        plan = planner.grade(bar, from_=soft, to=hard, axis="x", palette=known)
        figure = planner.materials_figure(stiffness_scale(known, 0.1))
        seen.append({name: built_of(name, data) for name, data in {
            "materials.svg": figure, "materials.html": known._repr_html_().encode(),
            "plan.html": planner.plan_page(plan), "HOWTO.md": plan.howto().encode(),
        }.items()})  # fmt: skip
    assert seen[0] == seen[1]


# ------------------------------------------------------------------------------------------------
# Campaigns, lists of specimens, tensile files.


def _list(path: Path, columns: Mapping[str, str], rows: int, text: str) -> None:
    """Write a list whose cells of free text, and whose own column's heading, are `text`."""
    heads = [f"{text} by" if head == "own" else head for head in columns]
    cells = [
        [value.replace("TEXT", f"{text}{row}").replace("ROW", str(row))
         for value in columns.values()]
        for row in range(rows)
    ]  # fmt: skip
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([heads, *cells])


def _campaign(folder: Path, text: str) -> Path:
    folder.mkdir()
    named = json.dumps(text)
    (folder / "campaign.toml").write_text(
        f'schema = 1\nname = {named}\nprinter = "connex3"\nnotes = {named}\n'
        'palette = "connex3-tango-vero"\n'
    )
    columns = {
        "specimen": "TEXT", "material": "FLX9760", "width_mm": "6", "thickness_mm": "2",
        "gauge_mm": "25", "rate_mm_s": "1", "batch": "TEXT", "own": "TEXT",
    }  # fmt: skip
    _list(folder / "specimens.csv", columns, 2, text)
    with (folder / "curves.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["specimen", "time_s", "displacement_mm", "force_N"])
        writer.writerows([f"{text}{s}", k / 4, k / 4, 0.3 * k] for s in range(2) for k in range(20))
    return folder


def test_a_campaign_reads_back_what_it_was_written_with(tmp_path: Path) -> None:
    seen = []
    for name, text in (("hostile", HOSTILE), ("plain", PLAIN)):
        campaign = read_campaign(_campaign(tmp_path / name, text))
        assert [s.id for s in campaign.specimens] == [f"{text}0", f"{text}1"]
        written = write_campaign(campaign, tmp_path / f"{name}-written")
        again = read_campaign(written)
        for one, other in zip(campaign.specimens, again.specimens, strict=True):
            assert (one.id, one.batch, one.covariates) == (other.id, other.batch, other.covariates)
        assert (again.name, again.notes) == (campaign.name, campaign.notes) == (text, text)
        twice = write_campaign(again, tmp_path / f"{name}-twice")
        files = {p.name: p.read_bytes() for p in written.glob("*.csv")}
        assert files == {p.name: p.read_bytes() for p in twice.glob("*.csv")}
        seen.append({name: built_of(name, data) for name, data in files.items()})
    assert seen[0] == seen[1]


def test_tensile_tests_stay_text(tmp_path: Path) -> None:
    seen = []
    for name, text in (("hostile", HOSTILE), ("plain", PLAIN)):
        folder = tmp_path / name
        folder.mkdir()
        columns = {
            "specimen": "TEXT", "material": text, "file": "ROW.csv", "width_mm": "6",
            "thickness_mm": "2", "gauge_mm": "25", "rate_mm_s": "1", "own": "TEXT",
        }  # fmt: skip
        _list(folder / "specimens.csv", columns, 2, text)
        for row in range(2):
            with (folder / f"{row}.csv").open("w", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream)
                writer.writerows([["operator", text], ["displacement_mm", "force_N", text]])
                writer.writerows([k / 4, 0.3 * k, text] for k in range(30))
        study = read_study([folder])
        found = planner.characterise(study)
        seen.append({name: built_of(name, data) for name, data in {
            "materials.csv": found.csv(), "tests.svg": planner.characterisation_figure(found),
        }.items()})  # fmt: skip
    assert seen[0] == seen[1]


@pytest.mark.parametrize(
    "text",
    ["=1+1", "+x", "-x", "@x", "'=x", "''-5", "'-5", "-5", "a\r=x", "＝x", "'s", 'a"=b', "="],
)
def test_what_planner_writes_into_a_table_it_reads_back(tmp_path: Path, text: str) -> None:
    data = encode_csv([["name", "value"], [text, -1.5], ["b", None]])
    (tmp_path / "x.csv").write_bytes(data)
    headings, _, rows = read_rows(tmp_path / "x.csv")
    assert headings == ["name", "value"]
    assert [cells for _, cells in rows] == [[text, "-1.5"], ["b", ""]]
    built_of("x.csv", data)


# ------------------------------------------------------------------------------------------------
# diagnosis.json, and the traces that its figures are drawn of.


DIAGNOSIS: dict[str, Any] = {
    "schema": 1, "version": "0", "campaign": "lab", "palette": {"name": "lab", "sha256": "ab"},
    "specimens": 3, "tests": 2, "tested": {"orientation": ["x"]}, "verdict": "rate",
    "summary": ["along the rate"], "class": [["rate"], ["skin"]],
    "ranking": [{"effects": ["rate"], "probability": 0.9, "with_unknown": 0.3},
                {"effects": ["skin"], "probability": 0.1}],
    "not_testable": ["softening"], "not_testable_because": {"softening": "nothing unloaded"},
    "where": [{"axis": "rate_mm_s", "share": 0.8, "p": 1e-5, "detail": "at 5 mm/s"},
              {"axis": "operator", "share": 0.1, "p": 1e-3, "detail": "Ann"}],
    "gap": {"before": 0.2, "after": 0.03, "floor": 0.02, "closed": 0.9, "held_out": "one",
            "closed_interval": None, "recalibration_only": 0.1},
    "effect": {"rate": {"form": "prony", "parameters": {"share": 0.1}, "units": {"share": "s"},
                        "interval": {"share": [0.05, 0.2]}, "specimens": ["A"]}},
    "remainder": {"significant": True,
                  "where": [{"axis": "batch", "share": 0.1, "p": 0.01, "detail": "in B"}]},
    "data_quality": [{"specimen": "B", "kind": "units", "problem": "too large"}],
    "unit_of": [{"quantity": "force", "unit": "lbf", "specimens": ["B"]}],
    "next_experiments": [
        {"change": {"rate_mm_s": "5"}, "splits": [["rate", "skin"]], "expected_gain_nats": 1.2,
         "detail": "pull it", "row": {"profile": "profiles/bar.csv", "batch": "C", "own": "x"},
         "design": {"x_mm": [0.0, 1.0], "coordinate": [0.2, 0.4]}},
        {"change": {"rate_mm_s": "9"}, "splits": [["rate", "skin"]], "expected_gain_nats": 1.0},
    ],
    "detectable": [{"id": "skin", "parameter": "depth", "size": 0.1, "unit": "mm"}],
    "recalibration": {"FLX9760": {"log_factor": 0.1, "sd": 0.1}}, "limitations": ["few"],
}  # fmt: skip


def _traces(text: str) -> Traces:
    travel, ids = np.linspace(0.0, 10.0, 11), tuple(f"{text}{k}" for k in range(3))
    force = np.stack([2.0 * travel, 2.1 * travel, 3.0 * travel])
    return Traces(
        label=(f"{text} soft", f"{text} hard"), rows=[[0], [1, 2]],
        travel_mm=np.stack([travel, travel]), time_s=np.stack([travel, travel]),
        before_N=1.2 * force[:2], after_N=force[:2], measured_N=force,
        residual_before=np.array([0.1, 0.2, -0.1]), residual_after=np.array([0.0, 0.1, 0.0]),
        peaks_N=force.max(axis=1, keepdims=True),
        columns={
            "specimen": ids, "material": ids, "rate_mm_s": (5.0, 0.5, 5.0), "operator": ids,
            "gauge_mm": (20.0, 20.0, 20.0),
        },
    )  # fmt: skip


def test_a_diagnosis_strings_stay_text(tmp_path: Path) -> None:
    def read(document: object) -> Diagnosis:
        (tmp_path / "diagnosis.json").write_text(json.dumps(document))
        return read_diagnosis(tmp_path)

    def outputs(document: object, text: str = "S") -> dict[str, Any] | None:
        def made() -> Made:
            found = dataclasses.replace(read(document), traces=_traces(text))
            files = {n: d for n, d in diagnosis_files(found).items() if not n.endswith(".json")}
            return {**files, "notebook.html": found._repr_html_().encode()}

        return made_by(made)

    own, shown = outputs(DIAGNOSIS), 0
    assert own is not None
    assert {"report.html", "where.csv", "next-specimens.csv", "profiles/bar.csv"} < set(own)
    for way in places(DIAGNOSIS):
        hostile = outputs(put(DIAGNOSIS, way, HOSTILE))
        if hostile not in (None, own):
            assert hostile == outputs(put(DIAGNOSIS, way, PLAIN)), way
        shown += hostile is not None
    assert shown > 40
    assert outputs(DIAGNOSIS, HOSTILE) == outputs(DIAGNOSIS, PLAIN) is not None


# ------------------------------------------------------------------------------------------------
# Markdown.


@pytest.mark.parametrize("text", ["a | b", "<b>x</b>", "[x](y)", "x<1", "<!-- x", "plain"])
def test_words_of_markdown_are_shown_as_they_are(text: str) -> None:
    shown = re.sub(r"</?(p|td)>", "", to_html(as_words(text)))
    assert html.unescape(shown) == text.replace("](y)", "](y)")
    row = to_html(f"| {as_words(text)} | end |\n| --- | --- |")
    assert row.count("<th ") == 2
