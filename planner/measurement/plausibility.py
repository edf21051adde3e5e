"""Signs that a column is not what its heading says: wrong unit, swapped, unloaded."""

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.materials.rupture import BROKEN_SHARE

__all__ = ["check_agreement", "check_plausible", "check_rising"]

LARGEST_STRAIN = 30.0
"""Beyond any elastomer: the softest platinum silicones break at 12 to 20."""

LARGEST_STRESS_MPA = 500.0
"""Beyond any unreinforced polymer's nominal strength (about 150 MPa)."""

STIFF_STRESS_MPA = 20.0
"""What bears more and stretches to more than twice its length has to state its unit."""

LARGEST_UNSTATED_WORK_MPA = 50.0
"""Largest stress times strain of what need not state its unit: few rubbers come near."""

_REVERSAL_SHARE = 0.05
_EVEN = 0.05
_JITTER_SHARE = 0.02
"""Noise of an optically measured strain, as a share of its range."""

_SLIPS = (
    (100.0, "per cent given as fractions: write the unit '%'"),
    (0.01, "fractions marked as '%': correct the unit"),
    (1 / 0.00689475729, "psi given as MPa: write the unit 'psi'"),
    (0.00689475729, "MPa marked as psi: correct the unit"),
    (1000.0, "kPa given as MPa, or N as kN: correct the unit"),
    (0.001, "MPa marked as kPa, or N as kN: correct the unit"),
    (25.4, "a length in mm marked as inches, or the reverse: correct the unit"),
    (1 / 25.4, "a length in inches marked as mm, or the reverse: correct the unit"),
    (4.448222, "a load in N marked as lbf, or the reverse: correct the unit"),
    (1 / 4.448222, "a load in lbf marked as N, or the reverse: correct the unit"),
)


def check_plausible(
    strain: FloatArray, stress_MPa: FloatArray, *, unit_stated: bool, where: str
) -> None:
    """Refuse strains and stresses that no polymer reaches.

    A strain without unit counts as a fraction. It is refused where the specimen would stretch
    to more than twice its length under more than 20 MPa, which tells a rigid plastic's per
    cents, or so far that stress times strain exceeds 50 MPa.

    Raises
    ------
    FileError
        Strain or stress out of what is possible; the message names the likely slip.
    """
    largest, peak = float(strain.max()), float(stress_MPa.max())
    if largest > LARGEST_STRAIN:
        raise FileError(
            f"{where}: strain reaches {largest:.4g} ({100 * largest:.4g} %), more than any "
            f"polymer's ({LARGEST_STRAIN:g}); if it is in per cent, head the column 'strain (%)'"
        )
    strong = peak > STIFF_STRESS_MPA or peak * largest > LARGEST_UNSTATED_WORK_MPA
    if not unit_stated and largest > 1.0 and strong:
        raise FileError(
            f"{where}: strain reaches {largest:.4g} at {peak:.4g} MPa and its heading gives no "
            "unit; per cent is likely: head the column 'strain (%)', or 'strain (mm/mm)' if it "
            "is a fraction after all (and then check the unit of stress: psi?)"
        )
    if peak > LARGEST_STRESS_MPA:
        raise FileError(
            f"{where}: stress reaches {peak:.4g} MPa, more than any polymer's "
            f"({LARGEST_STRESS_MPA:g}); if it is in psi or kPa, say so in the heading"
        )


def check_agreement(stated: float, derived: float, *, what: str, where: str) -> tuple[str, ...]:
    """Compare a figure from one column with the same figure from others.

    Raises
    ------
    FileError
        They differ by the factor of a known slip of units (within 10 %).

    Returns
    -------
    notes
        One, where they differ by more than a third without a known reason.
    """
    if not (stated > 0.0 and derived > 0.0):
        return ()
    ratio = stated / derived
    for factor, advice in _SLIPS:
        if abs(ratio / factor - 1.0) < 0.1:
            raise FileError(f"{where}: {what}: {stated:.4g} against {derived:.4g}; {advice}")
    if not 0.75 < ratio < 4.0 / 3.0:
        return (f"{where}: {what}: {stated:.4g} against {derived:.4g}; check sizes and units",)
    return ()


def check_rising(strain: FloatArray, stress_MPa: FloatArray, *, where: str) -> None:
    """Refuse swapped columns and records that unload.

    The crosshead moves at a constant rate, so strain is the column that never falls back and
    has even steps; both standards (ASTM D412, D638) test so.

    Raises
    ------
    FileError
        Stress has even steps and strain uneven ones, or strain falls back and stress never does
        (swapped); or strain falls back by more than 5 % of its range before the peak, or behind
        it while the specimen still bears load (a cyclic test).
    """
    peak = int(np.argmax(stress_MPa)) + 1
    span = float(np.ptp(strain))
    if span <= 0.0:
        raise FileError(f"{where}: strain stands at {strain[0]:g} throughout; check the column")
    fallen = np.maximum.accumulate(strain) - strain
    if bool(np.all(np.diff(stress_MPa) >= 0.0)):
        # A strain measured optically jitters beside a smooth load: even steps tell it apart.
        even = _unevenness(stress_MPa) < _EVEN
        if float(fallen.max()) > (1e-3 if even else _JITTER_SHARE) * span:
            raise FileError(
                f"{where}: strain falls back and stress never does, as if the columns were "
                "swapped; check the headings"
            )
        if _unevenness(stress_MPa) < 0.01 and _unevenness(strain) > 0.2:
            raise FileError(
                f"{where}: stress has even steps and strain uneven ones, as if the columns were "
                "swapped (or the test was load-controlled, which is not understood here); check "
                "the headings"
            )
    if (fall := float(fallen[:peak].max())) > _REVERSAL_SHARE * span:
        raise FileError(
            f"{where}: strain falls back by {fall:.4g} before the peak load, as in a cyclic "
            "test; give the first loading alone, or say protocol 'cyclic' in specimens.csv"
        )
    bears = stress_MPa[peak:] > BROKEN_SHARE * stress_MPa[peak - 1]
    fall = float(np.max(fallen[peak:], where=bears, initial=0.0))
    if fall > _REVERSAL_SHARE * span:
        raise FileError(
            f"{where}: strain falls back by {fall:.4g} behind the peak load while the specimen "
            "still bears load, as in loading and unloading; give the loading alone, or say "
            "protocol 'cyclic' in specimens.csv"
        )


def _unevenness(values: FloatArray) -> float:
    steps = np.diff(values)
    mean = float(np.mean(steps))
    return float(np.std(steps)) / mean if mean > 0.0 else np.inf
