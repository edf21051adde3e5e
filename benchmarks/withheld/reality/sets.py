"""What the sets differ in, beyond the forms of their effects.

A method is tuned on the development set. The validation set has another base law, other levels of
the conditions, another kind of scatter and other ranges: a change that helps the first and not the
second was learnt by heart. Whoever follows its misses tunes on it too, so that the final set
differs from both, and is only scored.
"""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from benchmarks.withheld.reality.base_law import Network
from benchmarks.withheld.reality.design import Levels
from benchmarks.withheld.reality.effects.form import Set
from benchmarks.withheld.reality.noise import Scatter

__all__ = ["SETS", "SetRules"]


@dataclass(frozen=True)
class SetRules:
    """One set's world.

    Attributes
    ----------
    scatter_range
        Of the specimens' coefficient of variation, drawn a campaign.
    calibration_range
        Of the standard deviation of a grade's true level about the palette's.
    """

    network: Network
    largest_misfit: float
    levels: Levels
    scatter_range: tuple[float, float]
    calibration_range: tuple[float, float]
    batch_share: float
    wander_rows: float
    smooth: bool

    def draw_scatter(self, rng: np.random.Generator, factor: float, freedom: int) -> Scatter:
        """Draw a campaign's scatter, times `factor`."""
        low, high = np.log(self.scatter_range)
        specimen = factor * float(np.exp(rng.uniform(low, high)))
        return Scatter(
            specimen=specimen,
            batch=self.batch_share * specimen,
            slope=0.4 * specimen,
            wander=0.15 * specimen,
            wander_rows=self.wander_rows,
            smooth=self.smooth,
            calibration=float(rng.uniform(*self.calibration_range)),
            tilt=0.006,
            sensor_N=factor * float(rng.uniform(0.004, 0.012)),
            quantum_N=0.005,
            freedom=freedom,
        )


SETS: MappingProxyType[Set, SetRules] = MappingProxyType(
    {
        "development": SetRules(
            network="eight-chain",
            largest_misfit=0.006,
            levels=Levels(
                strain_rate_factors=(1.0, 0.1, 10.0),
                temperatures_C=(23.0, 15.0, 33.0),
                soaks_h=(0.0, 4.0, 24.0),
                ages_days=(9.0, 40.0, 120.0),
            ),
            scatter_range=(0.02, 0.05),
            calibration_range=(0.02, 0.04),
            batch_share=0.3,
            wander_rows=15.0,
            smooth=False,
        ),
        "validation": SetRules(
            network="exponential",
            largest_misfit=0.008,
            levels=Levels(
                strain_rate_factors=(1.0, 0.05, 4.0),
                temperatures_C=(23.0, 18.0, 28.0, 35.0),
                soaks_h=(0.0, 6.0, 36.0),
                ages_days=(9.0, 5.0, 20.0, 90.0),
                sections_mm=((6.0, 3.0), (9.0, 2.0), (5.0, 5.0), (12.0, 2.5)),
                gauges_mm=(25.0, 30.0, 60.0),
            ),
            scatter_range=(0.02, 0.06),
            calibration_range=(0.02, 0.045),
            batch_share=0.35,
            wander_rows=12.0,
            smooth=True,
        ),
        "final": SetRules(
            network="gent",
            largest_misfit=0.01,
            levels=Levels(
                strain_rate_factors=(1.0, 0.02, 0.2, 5.0),
                temperatures_C=(23.0, 12.0, 30.0, 38.0),
                soaks_h=(0.0, 2.0, 12.0, 72.0),
                ages_days=(9.0, 3.0, 60.0, 200.0),
                sections_mm=((6.0, 3.0), (12.0, 3.0), (6.0, 1.6), (4.0, 2.4)),
                gauges_mm=(25.0, 33.0, 50.0),
            ),
            scatter_range=(0.015, 0.07),
            calibration_range=(0.015, 0.05),
            batch_share=0.4,
            wander_rows=9.0,
            smooth=True,
        ),
    }
)
