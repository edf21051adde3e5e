"""The sample parts are what their script makes, sound, and of the published sizes."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from benchmarks.audit import audit
from planner.formats.mesh_file import decode_stl


@pytest.mark.parametrize("name", ["dogbone", "dogbone-thesis", "finger", "gripper"])
def test_samples_are_what_their_script_makes(name: str, samples: Path) -> None:
    part = runpy.run_path(str(samples / "make_samples.py"))["parts"]()[name]
    found = audit(decode_stl((samples / f"{name}.stl").read_bytes(), name))
    assert found.sound
    # Double precision in the script, single in the file: 1e-7 of the extent a coordinate, which
    # a thin section of 4 mm in 115 mm magnifies by 30.
    assert found.volume_mm3 == pytest.approx(part.volume(), rel=3e-6)


def test_the_strain_is_what_its_script_makes(samples: Path) -> None:
    made = runpy.run_path(str(samples / "make_samples.py"))["finger_strain"]()
    assert (samples / "finger-strain.csv").read_text(encoding="utf-8") == made


def test_dogbone_is_type_iv(samples: Path) -> None:
    points = decode_stl((samples / "dogbone.stl").read_bytes(), "dogbone").reshape(-1, 3)
    # ASTM D638-14, Fig. 1, type IV: overall length 115, overall width 19, here 4 mm thick.
    # Single precision at 57 mm: 4e-6 mm.
    assert np.ptp(points, axis=0) == pytest.approx([115.0, 19.0, 4.0], abs=1e-5)
    narrow = points[np.abs(points[:, 0]) < 16.0]
    assert np.ptp(narrow[:, 1]) == pytest.approx(6.0, abs=1e-5)
