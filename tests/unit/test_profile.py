"""Profiles: what they are at the ends, where they cross a modulus, and what they refuse."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import ArgumentError, FileError
from planner.grading.profile import Profile, read_moduli
from planner.grading.wish import between

moduli = st.floats(0.01, 1e3)
shapes = st.sampled_from(["log", "linear", "smooth", "steps:7"])


@settings(deadline=None, derandomize=True)
@given(start=moduli, end=moduli, spec=shapes)
def test_begins_and_ends_at_the_materials(start: float, end: float, spec: str) -> None:
    profile = between(spec, start, end)
    # 1e-12: a few roundings of a power.
    assert float(profile.modulus_MPa(0.0)) == pytest.approx(start, rel=1e-12)
    assert float(profile.modulus_MPa(1.0)) == pytest.approx(end, rel=1e-12)


@settings(deadline=None, derandomize=True)
@given(start=moduli, end=moduli, spec=shapes)
def test_monotone(start: float, end: float, spec: str) -> None:
    values = between(spec, start, end).modulus_MPa(np.linspace(0.0, 1.0, 501))
    rising = np.diff(values) * np.sign(end - start)
    assert (rising >= -1e-12 * max(start, end)).all()


@settings(deadline=None, derandomize=True)
@given(
    start=moduli,
    ratio=st.floats(1.5, 1e4),
    share=st.floats(0.001, 0.999),
    spec=st.sampled_from(["log", "linear", "smooth"]),
    down=st.booleans(),
)
def test_crossing_is_where_the_target_is(
    start: float, ratio: float, share: float, spec: str, down: bool
) -> None:
    end = start * ratio
    wanted = start * ratio**share
    profile = between(spec, end, start) if down else between(spec, start, end)
    (u,) = profile.crossings(wanted)
    # The closed form's error: rounding (1e-16) magnified by the slope of ln E, at most
    # ln(1e4) * 1.5 for log and smooth, and by ratio for linear.
    assert float(profile.modulus_MPa(u)) == pytest.approx(wanted, rel=1e-10)


def test_smooth_matches_smoothstep() -> None:
    profile = between("smooth", 1.0, math.e)
    for t in (0.1, 0.25, 0.5, 0.9):
        assert math.log(float(profile.modulus_MPa(t))) == pytest.approx(
            3 * t**2 - 2 * t**3, rel=1e-12
        )


def test_steps_are_level_and_evenly_spaced_in_log() -> None:
    profile = between("steps:3", 1.0, 100.0)
    values = profile.modulus_MPa(np.array([0.0, 0.2, 0.34, 0.6, 0.67, 1.0]))
    assert values == pytest.approx([1, 1, 10, 10, 100, 100], rel=1e-12)
    assert profile.crossings(5.0) == (pytest.approx(1 / 3),)
    assert profile.interval_MPa(0.0, 1 / 3) == (pytest.approx(1.0), pytest.approx(1.0))


def test_interval_leaves_out_what_lies_beyond_a_jump() -> None:
    profile = Profile("jump", (0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 8.0, 9.0), "log")
    assert profile.interval_MPa(0.0, 0.5) == (pytest.approx(1.0), pytest.approx(2.0))
    assert profile.interval_MPa(0.5, 1.0) == (pytest.approx(8.0), pytest.approx(9.0))
    assert profile.crossings(4.0) == (0.5,)


@pytest.mark.parametrize("spec", ["lgo", "steps:1", "steps:x", "steps:", "cubic"])
def test_unknown_profiles_are_refused(spec: str) -> None:
    with pytest.raises(ArgumentError, match="`profile`"):
        between(spec, 1.0, 2.0)


def test_did_you_mean() -> None:
    with pytest.raises(ArgumentError, match="did you mean linear"):
        between("linaer", 1.0, 2.0)


def _resolve(name: str) -> str:
    return {"tango": "TangoPlus", "vero": "VeroWhitePlus"}[name.strip().casefold()]


MODULI = {"TangoPlus": 0.3, "VeroWhitePlus": 340.0}


def test_reads_moduli_and_materials(tmp_path) -> None:
    by_modulus = tmp_path / "wish.csv"
    by_modulus.write_text("position,modulus_MPa\n0,1\n0.5,2\n0.5,4\n1,8\n")
    profile = read_moduli(by_modulus, MODULI, _resolve)
    assert profile.moduli_MPa == (1.0, 2.0, 4.0, 8.0)
    by_material = tmp_path / "names.csv"
    by_material.write_text("position, material\n0, Tango\n1, vero\n")
    assert read_moduli(by_material, MODULI, _resolve).moduli_MPa == (0.3, 340.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the file is empty"),
        ("position\n0\n1\n", "modulus_MPa and material"),
        ("position,modulus_MPa,material\n0,1,Tango\n1,2,Vero\n", "one of"),
        ("position,modulus_MPa\n0,1\n", "from position 0 to position 1"),
        ("position,modulus_MPa\n0.1,1\n1,1\n", "from position 0 to position 1"),
        ("position,modulus_MPa\n0,1\n0.7,1\n0.6,1\n1,1\n", "line 4"),
        ("position,modulus_MPa\n0,1\n0.5,1\n0.5,2\n0.5,3\n1,1\n", "line 5.*three times"),
        ("position,modulus_MPa\n0,1\n1,-2\n", "line 3.*above 0"),
        ("position,modulus_MPa\n0,1\n1,nan\n", "line 3.*finite"),
        ("position,modulus_MPa\n0,1\n1,\n", "line 3.*finite"),
        ("position,modulus_MPa\n0,1\n1,two\n", "line 3.*'two'"),
        ("position,modulus_MPa\n0,1\n1.2,2\n", "line 3.*from 0 to 1"),
    ],
)
def test_bad_files_are_refused_with_the_line(tmp_path, text: str, reason: str) -> None:
    path = tmp_path / "wish.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=reason):
        read_moduli(path, MODULI, _resolve)


def test_missing_file(tmp_path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        read_moduli(tmp_path / "none.csv", MODULI, _resolve)
