"""What every test of a setup would show: force on the load cell, strain of every slice."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.arrays import FloatArray
from planner.gap.forward.law_tables import LawTables
from planner.gap.forward.path_kernel import WORK_ROWS, follow_path
from planner.gap.forward.setup import RELAXATION_TIMES_s, Setup

__all__ = ["Prediction", "predict", "predict_all"]


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Of P tests of T steps and S slices.

    Attributes
    ----------
    force_N : (P, T)
        As the load cell shows it.
    strain : (T, S)
        Engineering strain of every slice, of its `Setup.length_mm`.
    """

    force_N: FloatArray
    strain: FloatArray


def predict(setup: Setup, laws: LawTables) -> Prediction:
    """Follow every test along its path.

    All values are finite for finite setups: where no equilibrium exists (more travel than the
    slices can take to strains of -0.6 to 4), strains stay at that end.
    """
    steps, slices = setup.time_s.shape[1], len(setup.coordinate)
    lower, upper, fraction = laws.bracket(setup.coordinate)
    used = np.flatnonzero(setup.relaxing.any(axis=0))
    force = np.empty(setup.time_s.shape)
    strain = np.empty((steps, slices))
    follow_path(
        np.asarray(setup.first_slice, dtype=np.int64),
        np.ascontiguousarray(setup.time_s, dtype=np.float64),
        setup.travel_mm * setup.travel_factor[:, None] - setup.lost_mm,
        np.stack([setup.slip_mm_N, setup.slip_from_N, setup.slip_power,
                  setup.compliance_mm_N, setup.compliance_power]),
        np.asarray(lower, dtype=np.int64),
        np.asarray(upper, dtype=np.int64),
        np.stack([setup.length_mm, setup.area_mm2, fraction, setup.log_factor, setup.log_tilt,
                  setup.softening, setup.set_share]),
        np.ascontiguousarray(setup.relaxing[:, used]),
        RELAXATION_TIMES_s[used],
        np.ascontiguousarray(setup.softening_table, dtype=np.float64),
        np.ascontiguousarray(setup.set_table, dtype=np.float64),
        laws.cubics,
        laws.strain_step,
        np.empty((WORK_ROWS, slices)),
        np.empty((slices, len(used))),
        np.empty((2, len(used))),
        force,
        strain,
    )  # fmt: skip
    return Prediction(setup.gain * force + setup.offset_N, strain)


def predict_all(setups: Iterable[Setup], laws: LawTables, *, workers: int = 2) -> list[Prediction]:
    """Predict several setups, in their order; threads change the time it takes and nothing else."""
    waiting = list(setups)
    if workers < 2 or len(waiting) < 2:
        return [predict(setup, laws) for setup in waiting]
    with ThreadPoolExecutor(min(workers, len(waiting))) as pool:
        return list(pool.map(partial(predict, laws=laws), waiting))
