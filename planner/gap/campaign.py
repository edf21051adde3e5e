"""A campaign: the specimens that a lab printed from one palette, and what it measured."""

from dataclasses import dataclass

from planner.errors import FileError
from planner.gap.conditions import replicate_groups
from planner.gap.limitations import limitations_of
from planner.gap.specimen import Specimen
from planner.palette import Palette

__all__ = ["Campaign"]


@dataclass(frozen=True, slots=True)
class Campaign:
    """What a lab measured, ready to be compared with what the palette's laws predict.

    Attributes
    ----------
    printer
        Name of the printer.
    covariates
        Names of the columns beyond those that planner knows, in the file's order.
    notes
        The lab's own, from campaign.toml.
    remarks
        What was corrected, assumed or left out in making it; one sentence each.

    Raises
    ------
    FileError
        No specimen, or two of one id.
    """

    name: str
    printer: str
    palette: Palette
    specimens: tuple[Specimen, ...]
    covariates: tuple[str, ...] = ()
    notes: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.specimens:
            raise FileError(f"campaign {self.name}: no specimen with a curve; add some")
        ids = [s.id for s in self.specimens]
        double = next((i for i in ids if ids.count(i) > 1), None)
        if double is not None:
            raise FileError(f"campaign {self.name}: two specimens {double!r}; ids must differ")

    @property
    def limitations(self) -> tuple[str, ...]:
        """The remarks, and what the specimens cannot tell whatever is made of them."""
        return (*self.remarks, *limitations_of(self.specimens, self.palette))

    def specimen(self, id: str) -> Specimen:
        """Return a specimen by its id.

        Raises
        ------
        KeyError
            There is none of that id.
        """
        for specimen in self.specimens:
            if specimen.id == id:
                return specimen
        raise KeyError(id)

    def replicates(self) -> tuple[tuple[Specimen, ...], ...]:
        """Return the specimens grouped by condition, singles included."""
        groups = replicate_groups(self.specimens)
        return tuple(tuple(self.specimens[i] for i in group) for group in groups)
