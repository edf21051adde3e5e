"""Where samples and shared data lie; small campaigns by planner's own forward model."""

import contextlib
import fcntl
import functools
import gc
import itertools
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import EntryPoints, entry_points
from pathlib import Path
from typing import Any

if sys.dont_write_bytecode:  # hundreds of processes read what one has compiled
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False

# Where several processes share the processors, each computes on one; before numpy starts its own.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from planner.cli import round_alike

if "numpy" not in sys.modules:
    round_alike()

# pytest rewrites the assertions of a plugin's whole package, here of 40,000 lines in each worker.
with contextlib.suppress(AttributeError, StopIteration):
    finder: Any = next(one for one in sys.meta_path if hasattr(one, "mark_rewrite"))
    finder._must_rewrite.discard("planner")

import numpy as np
import pytest

import planner
from planner import compilation_cache
from planner.cli import run
from planner.gap.campaign import Campaign
from planner.gap.virtual import stated_effect, synthetic_campaign, virtual_specimen, virtual_strain
from planner.palette import Palette, load_palette
from planner.simulation.bar import ProfileDesign

compile_ahead = compilation_cache.compile_ahead
if "PYTEST_XDIST_WORKER" in os.environ:  # no processor is free to compile ahead in
    compilation_cache.compile_ahead = lambda *_: None

ROOT = Path(__file__).resolve().parents[1]
PALETTE = ROOT / "printers/connex3/palettes/connex3-tango-vero.toml"
USUAL: Mapping[str, Any] = {
    "width_mm": 6.0, "thickness_mm": 3.0, "gauge_mm": 25.0, "rate_mm_s": 0.85,
    "temperature_C": 23.0, "soak_h": 0.0, "age_days": 9.0, "orientation": "x",
    "protocol": "monotonic",
}  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Give workers of pytest-xdist whole files where possible: their fixtures are made once."""
    if config.getoption("numprocesses", None) and config.getoption("dist") == "load":
        config.option.dist = "worksteal"


SLOW = Path(os.environ.get("PLANNER_SLOW_TESTS", ROOT / "tests/slow.txt"))
"""Tests that were measured to take long, written by benchmarks/slow_tests.py."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what was measured to be slow."""
    slow = set(SLOW.read_text(encoding="utf-8").splitlines())
    for item in items:
        if item.nodeid in slow:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Search no garbage while tests are collected, an eighth of the time, nor ever among them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_unconfigure() -> None:
    """Let Python find all that is left when it ends."""
    gc.unfreeze()


SMALL_PICTURES = ("unit", "property", "sweep")
"""Folders of tests that write plans and look at no picture, but for test_picture."""


@pytest.fixture(scope="module", autouse=True)
def _small_pictures(request: pytest.FixtureRequest) -> Iterator[None]:
    """Draw small what lies beside each plan where no test looks at it: whole, it takes 0.2 s."""
    with pytest.MonkeyPatch.context() as patch:
        if request.path.parent.name in SMALL_PICTURES and request.path.stem != "test_picture":
            patch.setattr("planner.plan._PICTURE", (96, 64))
        yield


@pytest.fixture(scope="session", autouse=True)
def _printers_looked_for_once() -> Iterator[None]:
    """Read what all installed packages offer once a path: the tests ask two thousand times."""

    @functools.cache
    def offered(group: str, path: tuple[str, ...]) -> EntryPoints:
        return entry_points(group=group)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "planner.printers.entry_points", lambda group: offered(group, tuple(sys.path))
        )
        yield


Planned = Callable[..., Campaign]
Imitated = Callable[..., Campaign]


@pytest.fixture(scope="session")
def palette() -> Palette:
    return load_palette(PALETTE)


@pytest.fixture(scope="session")
def planned(palette: Palette) -> Planned:
    """A full factorial of the columns given as lists, each cell repeated."""

    def plan(
        replicates: int = 1, *, batches: int = 2, more: Sequence[Mapping[str, Any]] = (),
        covariates: tuple[str, ...] = (), camera: bool = False, **columns: Sequence[Any],
    ) -> Campaign:  # fmt: skip
        names = list(columns)
        rows: list[dict[str, Any]] = [
            {**USUAL, **dict(zip(names, cell, strict=True)), "batch": f"b{k % batches}"}
            for cell in (itertools.product(*columns.values()) if columns else ())
            for k in range(replicates)
        ]
        rows += [{**USUAL, "batch": "b0", **one} for one in more]
        strain = virtual_strain(palette, [r["material"] for r in rows if "material" in r])
        specimens = [
            virtual_specimen(palette, id=f"S{k:03d}", strain=strain, camera=camera, **row)
            for k, row in enumerate(rows)
        ]
        return Campaign("test", "connex3", palette, tuple(specimens), covariates)

    return plan


@pytest.fixture(scope="session")
def step_bar(palette: Palette) -> ProfileDesign:
    """A bar of two materials, half and half."""
    ends = [palette.resolve(name).coordinate for name in ("TangoPlus", "FLX9785")]
    return ProfileDesign("step", np.array([0.0, 16.0, 16.0, 32.0]), np.repeat(ends, 2))


@pytest.fixture(scope="session")
def imitated(palette: Palette) -> Imitated:
    """A plan as if measured with effects; the column that says so is taken off again."""

    def measured(plan: Campaign, *effects: str, seed: int = 1, scatter: float = 0.03) -> Campaign:
        stated = [stated_effect(text, palette) for text in effects]
        made = synthetic_campaign(plan, stated, np.random.default_rng(seed), scatter=scatter)
        specimens = tuple(
            replace(new, covariates=old.covariates)
            for old, new in zip(plan.specimens, made.specimens, strict=True)
        )
        return replace(made, specimens=specimens, covariates=plan.covariates)

    return measured


@pytest.fixture(scope="session")
def samples() -> Path:
    return ROOT / "samples"


@pytest.fixture(scope="session")
def dogbone_plan(samples: Path) -> planner.Plan:
    """From the softest to the hardest, along x."""
    return planner.grade(samples / "dogbone.stl", from_="Tango", to="Vero", axis="x")


@pytest.fixture(scope="session")
def finger_plan(samples: Path) -> planner.Plan:
    """From the softest to the hardest, along x."""
    return planner.grade(samples / "finger.stl", from_="Tango", to="Vero", axis="x")


@pytest.fixture(scope="session")
def warm_diagnosis(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Diagnose the bundled campaign, once for all workers: its folder, and beside what is printed.

    To be read only: others read it too.
    """
    place = tmp_path_factory.getbasetemp()
    place = place.parent if "PYTEST_XDIST_WORKER" in os.environ else place
    folder, printed = place / "warm-diagnosis", place / "warm-diagnosis.json"
    with (place / "warm-diagnosis.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            with printed.open("w", encoding="utf-8") as out, contextlib.redirect_stdout(out):
                words = ["gap", "diagnose", str(samples / "warm-lab"), "--json", "-o", str(folder)]
                assert run(words) == 1
    return folder


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real meshes and tests that do not come with the project; tests that need them skip."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the shared data is not there")
    return folder


@pytest.fixture(scope="session")
def follows_to_the_letter() -> Callable[[bytes], bool]:
    """Whether lib3mf takes a 3MF where it is strict: it raises what is wrong else."""
    import lib3mf

    def follows(data: bytes) -> bool:
        reader = lib3mf.get_wrapper().CreateModel().QueryReader("3mf")
        reader.SetStrictModeActive(True)
        reader.ReadFromBuffer(data)
        return bool(reader.GetWarningCount() == 0)

    return follows
