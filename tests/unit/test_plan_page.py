"""plan.html: the same bytes from a plan and from its folder, small, safe, and offline."""

import base64
import hashlib
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh

import planner
from planner.cli import run
from planner.formats.outputs import seal
from planner.plan import Finding
from planner.report.display import ScreenGrid, colours_told_apart, shown
from planner.report.markdown import to_html
from planner.report.plan_figure import plan_table

MOST_BESIDE_GEOMETRY = 1_000_000  # bytes


@pytest.fixture(scope="module")
def graded(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dogbone in two materials that lie among each other, with its page."""
    plan = planner.grade(
        samples / "dogbone.stl", from_="FLX9750", to="FLX9760", blend="dither", cell_mm=2.0
    )
    folder = tmp_path_factory.mktemp("page") / "plan"
    return plan.write(folder, page=planner.plan_page(plan))


@pytest.fixture
def folder(graded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(graded, tmp_path / "plan"))


def data_of(page: str, name: str) -> str:
    found = re.search(rf'<script type="[^"]*" id="{name}">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.slow
def test_the_same_bytes_from_the_plan_and_from_its_folder(graded: Path) -> None:
    code = f"import planner, sys; sys.stdout.buffer.write(planner.plan_page({str(graded)!r}))"
    elsewhere = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert elsewhere.stdout == (graded / "plan.html").read_bytes()
    assert planner.plan_page(graded / "plan.json") == elsewhere.stdout


def test_it_is_small_beside_its_geometry_and_loads_nothing(graded: Path) -> None:
    page = (graded / "plan.html").read_text(encoding="utf-8")
    geometry = data_of(page, "geometry")
    assert len(page.encode()) - len(geometry) < MOST_BESIDE_GEOMETRY
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; script-src 'sha256-")
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    for script in scripts:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy[1]
    assert len(scripts) == 2
    assert "Permission is hereby granted" in scripts[0]  # three.js' licence
    outside = page.replace(scripts[0], "").replace(scripts[1], "")
    assert not re.search(r"""\b(?:src|href)\s*=\s*["']?[^"'#]""", outside)
    assert not re.search(r"url\(|@import", outside)


def test_the_geometry_is_the_shells(graded: Path) -> None:
    page = (graded / "plan.html").read_text(encoding="utf-8")
    data = json.loads(data_of(page, "data"))
    packed = base64.b64decode(data_of(page, "geometry"))
    plan, at = planner.read_plan(graded), 0
    for shell, region in zip(data["shells"], plan.regions, strict=True):
        kind = "<u4" if shell["wide"] else "<u2"
        points = np.frombuffer(packed, "<u2", 3 * shell["points"], at).reshape(-1, 3)
        at += -(-points.nbytes // 4) * 4
        faces = np.frombuffer(packed, kind, 3 * shell["faces"], at).reshape(-1, 3)
        at += -(-faces.nbytes // 4) * 4
        corners = (np.array(data["origin"]) + data["step"] * points)[faces]
        volume = np.linalg.det(corners).sum() / 6.0
        assert shell["name"] == region.material
        # Faces of cells lie along the axes: each is off by half a step at most.
        a, b, c = corners.transpose(1, 0, 2)
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        assert volume == pytest.approx(region.volume_mm3, abs=0.5 * data["step"] * area)
    assert at == len(packed)


class Elements(HTMLParser):
    """The names of all elements, and whether each that begins ends in its turn."""

    def __init__(self) -> None:
        super().__init__()
        self.names: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.names.append(tag)
        if tag not in {"meta", "input", "line", "rect", "path", "circle"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in {"line", "rect", "path", "circle"}:
            assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: object) -> None:
        self.names.append(tag)


def test_the_figure_of_cells_says_that_it_draws_means(graded: Path) -> None:
    text = (graded / "plan.html").read_text(encoding="utf-8")
    assert "Thick: the mean of each stretch, within which the shares of cells follow" in text


def test_names_are_words_and_no_markup(samples: Path, tmp_path: Path) -> None:
    part = tmp_path / "<script>alert(1)<!--.stl"
    part.write_bytes((samples / "dogbone.stl").read_bytes())
    plan = planner.grade(part, from_="Tango", to="FLX9795", bands=2)
    found = Finding("gap", "</script><b>here", place_mm=(1.0, 2.0, 3.0))
    plan = replace(plan, findings=(found,))
    page = planner.plan_page(plan).decode()
    elements = Elements()
    elements.feed(page)
    assert elements.open == []
    assert elements.names.count("script") == 4
    assert page.count("<!--") == 0
    assert "&lt;script&gt;alert(1)&lt;!--.stl" in page
    assert "&lt;/script&gt;&lt;b&gt;here" in page


def test_grade_writes_it_and_leaves_it_out(samples: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["grade", str(samples / "dogbone.stl"), "--from", "Tango", "--to", "FLX9760"]
    assert run([*command, "-q", "-o", "with"]) == 0
    assert run([*command, "-q", "-o", "without", "--no-page"]) == 0
    names = [{p.name for p in Path(name).iterdir()} for name in ("with", "without")]
    assert names[0] - names[1] == {"plan.html"}
    assert planner.check("with").ok
    assert planner.check("without").ok
    assert planner.diff("with", "without") == ()
    assert run([*command, "-q", "-o", "with", "--force"]) == 0  # the page is planner's own file


def test_view_makes_the_page_of_an_old_plan_once(folder: Path, capsys) -> None:
    page = folder / "plan.html"
    made = page.read_bytes()
    page.unlink()
    assert run(["view", str(folder / "plan.json"), "--no-open"]) == 0
    assert capsys.readouterr().out == f"{page}\n"
    assert page.read_bytes() == made
    page.write_bytes(made + b"<!-- kept -->")
    assert run(["view", str(folder), "--no-open", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == {"schema": 1, "page": str(page), "opened": False}
    assert page.read_bytes().endswith(b"<!-- kept -->")
    older = made.replace(b'content="planner ', b'content="planner 0.', 1)
    page.write_bytes(older)
    with pytest.raises(planner.PlannerError, match="changed since"):
        planner.view(folder)
    page.write_bytes(seal(re.sub(rb'(?<="sha256" content=")[0-9a-f]+', 64 * b"0", older)))
    planner.view(folder)
    assert page.read_bytes() == made  # another version made that one


def test_view_opens_the_page(folder: Path, monkeypatch, capsys) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: not opened.append(url))
    assert run(["view", str(folder)]) == 0
    assert opened == [(folder / "plan.html").resolve().as_uri()]
    monkeypatch.setattr("webbrowser.open", lambda url: False)
    assert run(["view", str(folder)]) == 0
    assert "no browser could be started" in capsys.readouterr().err


def test_view_says_what_is_wrong(folder: Path, tmp_path: Path, capsys) -> None:
    (folder / "plan.html").unlink()
    shell = next((folder / "stl").iterdir())
    whole = shell.read_bytes()
    shell.write_bytes(whole[:-1] + b"!")
    for wrong, words in (
        (folder, "its content is not what the plan was written with"),
        (tmp_path / "pla", "did you mean plan?"),
        (folder / "stl", "no plan.json in this folder"),
    ):
        assert run(["view", str(wrong), "--no-open"]) == 2
        assert words in capsys.readouterr().err
    shell.unlink()
    assert run(["view", str(folder), "--no-open"]) == 2
    assert "cannot be read" in capsys.readouterr().err
    assert not (folder / "plan.html").exists()


# Display: fewer triangles, closed all the same.


def ball(steps: int, centre: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of radius 1 as a grid of longitudes and latitudes, closed."""
    around = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    down = np.linspace(0.0, np.pi, steps)[1:-1]
    rings = np.stack(
        [np.outer(np.sin(down), np.cos(around)), np.outer(np.sin(down), np.sin(around)),
         np.outer(np.cos(down), np.ones(steps))], axis=2,
    ).reshape(-1, 3)  # fmt: skip
    vertices = np.concatenate([[[0.0, 0.0, 1.0]], rings, [[0.0, 0.0, -1.0]]])
    k, n = np.arange(steps), np.roll(np.arange(steps), -1)
    faces = [np.stack([0 * k, 1 + k, 1 + n], axis=1)]
    for ring in range(len(down) - 1):
        a, b, c, d = 1 + ring * steps + k, 1 + ring * steps + n, 1 + (ring + 1) * steps + k, 0
        d = 1 + (ring + 1) * steps + n
        faces += [np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)]
    last, low = len(vertices) - 1, 1 + (len(down) - 1) * steps
    faces.append(np.stack([0 * k + last, low + n, low + k], axis=1))
    vertices[:, 0] += centre
    return vertices.astype(np.float32), np.concatenate(faces).astype(np.int32)


def is_closed(faces: np.ndarray) -> bool:
    """Whether every directed edge has as many that run the other way."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    there = np.sort(ends[:, 0] << 32 | ends[:, 1])
    return bool((there == np.sort(ends[:, 1] << 32 | ends[:, 0])).all())


def volume(points: np.ndarray, faces: np.ndarray, step_mm: float) -> float:
    return float(np.linalg.det(step_mm * points.astype(float)[faces]).sum() / 6.0)


def test_all_triangles_are_shown_where_they_are_few() -> None:
    display = shown([ball(40)])
    ((points, faces),) = display.shells
    assert not display.simplified
    assert display.triangles == display.of == len(faces)
    assert is_closed(faces)
    # Half a step of 2/65535 each way on an area of 4 pi.
    assert volume(points, faces, display.step_mm) == pytest.approx(
        np.linalg.det(ball(40)[0].astype(float)[ball(40)[1]]).sum() / 6.0, abs=4e-4
    )
    assert display.moved_mm == pytest.approx(display.step_mm * 0.75**0.5)


def test_shells_with_fewer_triangles_are_closed_and_near() -> None:
    shells = [ball(120), ball(90, centre=2.5)]
    display = shown(shells, most=6000)
    assert display.simplified
    assert 2000 < display.triangles <= 6000
    for (points, faces), (vertices, old) in zip(display.shells, shells, strict=True):
        assert is_closed(faces)
        assert volume(points, faces, display.step_mm) == pytest.approx(
            np.linalg.det(vertices.astype(float)[old]).sum() / 6.0, rel=0.03
        )
        radius = np.linalg.norm(
            display.origin_mm + display.step_mm * points - vertices.mean(axis=0), axis=1
        )
        assert radius == pytest.approx(np.ones(len(points)), abs=0.02)
    assert 0.0 < display.moved_mm < 0.2


def test_a_shell_that_is_too_small_to_be_shown_hinders_nothing() -> None:
    vertices, faces = ball(120)
    speck = (2.0 + 1e-5 * vertices, faces)
    display = shown([(vertices, faces), speck], most=2000)
    large, none = (points for points, _ in display.shells)
    assert not len(none)
    grid, same = ScreenGrid.over([large, none]), ScreenGrid.over([large])
    assert grid.step_mm == same.step_mm
    assert (grid.origin_mm == same.origin_mm).all()


def test_neighbours_fit_after_they_were_simplified() -> None:
    """What two shells share is the same from either side, and the whole keeps its volume."""
    vertices, faces = ball(90)
    plan = planner.grade((20.0 * vertices, faces), from_="Tango", to="Vero", axis="x", bands=4)
    display = shown([(shell.vertices, shell.faces) for shell in plan.shells], most=5000)
    assert display.simplified
    total = 0.0
    for points, faces in display.shells:
        assert is_closed(faces)
        total += volume(points, faces, display.step_mm)
    corners = np.concatenate([points[faces] for points, faces in display.shells]).astype(np.int64)
    keys = np.sort(corners @ np.array([1 << 32, 1 << 16, 1]), axis=1)
    _, times = np.unique(keys, axis=0, return_counts=True)
    assert (times == 2).sum() > 50  # interfaces: each triangle once from either side
    assert times.max() == 2
    assert total == pytest.approx(plan.part.volume_mm3, rel=0.03)


def test_colours_that_look_alike_are_replaced() -> None:
    own = ("#FBD724", "#F68F44", "#38049A")
    assert colours_told_apart(own) == own
    scale = colours_told_apart(["#808080"] * 4)
    assert len({*scale, "#808080"}) == 5
    # Red and green that a deuteranope hardly tells apart, everyone else at once.
    assert "#C05030" not in colours_told_apart(["#C05030", "#8A7A00"])
    assert colours_told_apart(["#123456"] * 500) == ("#123456",) * 500  # no scale tells so many


def test_markdown_is_escaped() -> None:
    steps = "1. one **two** `<i>`\n   more\n2. *it*\n"
    html = to_html(f"# A <b>\n\n{steps}\n| a | b |\n| --- | --- |\n| 1 | 2 |\n")
    assert "<h3>A &lt;b&gt;</h3>" in html
    assert "<li>one <strong>two</strong> <code>&lt;i&gt;</code>\nmore</li>" in html
    assert "<li><em>it</em></li>" in html
    assert '<th scope="col">a</th>' in html
    assert to_html("[x](javascript:alert(1))").count("javascript") <= 1
    assert "<a" not in to_html("[x](javascript:alert(1))")
    assert to_html("2 * 3 * 4 and a_b") == "<p>2 * 3 * 4 and a_b</p>"


@pytest.mark.parametrize(
    "wish",
    [
        {"field": "radial: line=0 8 0 1 0 0, from=9, to=1"},  # a length that falls
        {"axis": "-x"},
        {"axis": "x", "profile": [(0, 1.0), (1, 1.0)]},  # one material
        {"axis": "x", "profile": [(0, 1e3), (1, 2e3)]},  # beyond the palette
        {"axis": "x", "profile": "grades"},
        {"field": "expression: 0.5 + 0.5*sin(x/9)"},
        {"axis": "z", "blend": "bands:2"},
        {"axis": "z", "blend": "mix"},
    ],
    ids=lambda wish: " ".join(map(str, wish.values()))[:30],
)
def test_every_kind_of_plan_has_a_page(samples: Path, wish: dict) -> None:
    ends = {} if isinstance(wish.get("profile"), list) else {"from_": "Tango", "to": "FLX9785"}
    plan = planner.grade(samples / "dogbone.stl", **ends, **wish, pitch_mm=2.0)
    page = planner.plan_page(plan).decode()
    assert "<svg" in page
    assert not re.search(r"\b(nan|inf)\b", page.split('id="geometry"')[0], re.IGNORECASE)


def test_a_region_has_the_number_of_its_file_and_of_the_legend(tmp_path) -> None:
    """From hard to soft, and there and back: the number counts materials from soft to hard."""
    rows = [(0, "Vero"), (0.5, "Tango"), (1, "FLX9795")]
    for name, wish in {"back": {"from_": "Vero", "to": "Tango"}, "both": {"profile": rows}}.items():
        plan = planner.grade(trimesh.creation.box((60.0, 10.0, 6.0)), axis="x", **wish)
        order = [shell.material for shell in plan.shells]
        for region in plan.regions:
            assert order[region.index - 1] == region.material
            assert f"__{region.index:02d}_{region.material}.stl" in region.file
        assert plan.regions[0].index == 10
        table = plan_table(plan)
        assert [row["#"] for row in table.rows] == [str(r.index) for r in plan.regions]
        folder = plan.write(tmp_path / name, page=planner.plan_page(plan))
        page = (folder / "plan.html").read_text(encoding="utf-8")
        legend = re.findall(r'class="number">(\d+)</span><span class="name">(\w+)<', page)
        assert [(int(number), name) for number, name in legend] == list(enumerate(order, 1))
        assert planner.check(folder).ok
