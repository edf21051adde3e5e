"""A print-job mixture planner for multi-material jetting printers.

>>> import planner
>>> plan = planner.grade("finger.stl", from_="Tango", to="Vero", axis="x")  # doctest: +SKIP
>>> plan.write("finger-graded")  # doctest: +SKIP

Every command of the command line is a function here, with the same names and defaults;
docs/reference/python.md lists them. Names are imported on first use, so that ``import planner``
costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planner.errors import PlannerError as PlannerError
    from planner.fields.basic import Field as Field
    from planner.gap.campaign import Campaign as Campaign
    from planner.gap.campaign_folder import read_campaign as read_campaign
    from planner.gap.campaign_folder import write_campaign as write_campaign
    from planner.gap.correct import Correction as Correction
    from planner.gap.correct import correct as correct
    from planner.gap.design import CampaignDesign as CampaignDesign
    from planner.gap.design import design_campaign as design_campaign
    from planner.gap.diagnose import diagnose as diagnose
    from planner.gap.diagnosis import Diagnosis as Diagnosis
    from planner.gap.diagnosis import read_diagnosis as read_diagnosis
    from planner.gap.summary import Standing as Standing
    from planner.gap.summary import campaign_standing as campaign_standing
    from planner.gap.virtual import synthesise_campaign as synthesise_campaign
    from planner.grading.check import Certificate as Certificate
    from planner.grading.check import Difference as Difference
    from planner.grading.check import check as check
    from planner.grading.check import diff as diff
    from planner.grading.grade import grade as grade
    from planner.grading.invert import Mixture as Mixture
    from planner.grading.invert import invert as invert
    from planner.grading.profile import Profile as Profile
    from planner.grading.profile import StiffnessScale as StiffnessScale
    from planner.grading.profile import at_temperature as at_temperature
    from planner.grading.profile import list_materials as list_materials
    from planner.inverse_design.design import PartDesign as PartDesign
    from planner.inverse_design.design import design as design
    from planner.materials.law_blocks import law_block as law_block
    from planner.materials.palette_study import Characterisation as Characterisation
    from planner.materials.palette_study import PaletteStudy as PaletteStudy
    from planner.materials.palette_study import characterise as characterise
    from planner.materials.palette_study import fit as fit
    from planner.materials.palette_study import fit_tables as fit_tables
    from planner.palette import Material as Material
    from planner.palette import Palette as Palette
    from planner.palette import load_palette as load_palette
    from planner.palette import write_palette as write_palette
    from planner.plan import Plan as Plan
    from planner.plan import Region as Region
    from planner.plan import read_plan as read_plan
    from planner.printers import Printer as Printer
    from planner.printers import installed_printers as installed_printers
    from planner.printers import load_printer as load_printer
    from planner.report.gap_page import write_diagnosis as write_diagnosis
    from planner.report.loaded_part import part_page as part_page
    from planner.report.loaded_part import part_volume as part_volume
    from planner.report.material_figures import characterisation_figure as characterisation_figure
    from planner.report.material_figures import fit_figure as fit_figure
    from planner.report.material_figures import materials_figure as materials_figure
    from planner.report.plan_page import compare_page as compare_page
    from planner.report.plan_page import plan_page as plan_page
    from planner.report.plan_page import view as view
    from planner.report.simulation_figures import simulation_figure as simulation_figure
    from planner.simulation.bar import Bar as Bar
    from planner.simulation.export import Export as Export
    from planner.simulation.export import ExportedMaterial as ExportedMaterial
    from planner.simulation.export import export as export
    from planner.simulation.loads import LoadCase as LoadCase
    from planner.simulation.part import PartSimulation as PartSimulation
    from planner.simulation.part import simulate_part as simulate_part
    from planner.simulation.simulate import Simulation as Simulation
    from planner.simulation.simulate import simulate as simulate
    from planner.simulation.simulate import simulate_bar as simulate_bar
    from planner.slices import Layer as Layer
    from planner.slices import SliceStack as SliceStack
    from planner.slices import iterate_layers as iterate_layers
    from planner.slices import write_slices as write_slices
    from planner.testing import file_schema as file_schema

__version__ = "0.1.0"

_MODULES = {
    "planner.errors": "PlannerError",
    "planner.fields.basic": "Field",
    "planner.gap.campaign": "Campaign",
    "planner.gap.campaign_folder": "read_campaign write_campaign",
    "planner.gap.correct": "Correction correct",
    "planner.gap.design": "CampaignDesign design_campaign",
    "planner.gap.diagnose": "diagnose",
    "planner.gap.diagnosis": "Diagnosis read_diagnosis",
    "planner.gap.summary": "Standing campaign_standing",
    "planner.gap.virtual": "synthesise_campaign",
    "planner.grading.check": "Certificate Difference check diff",
    "planner.grading.grade": "grade",
    "planner.grading.invert": "Mixture invert",
    "planner.grading.profile": "Profile StiffnessScale at_temperature list_materials",
    "planner.inverse_design.design": "PartDesign design",
    "planner.materials.palette_study": "Characterisation PaletteStudy characterise fit fit_tables",
    "planner.palette": "Material Palette load_palette write_palette",
    "planner.plan": "Plan Region read_plan",
    "planner.printers": "Printer installed_printers load_printer",
    "planner.report.gap_page": "write_diagnosis",
    "planner.report.loaded_part": "part_page part_volume",
    "planner.report.material_figures": "characterisation_figure fit_figure materials_figure",
    "planner.report.plan_page": "compare_page plan_page view",
    "planner.report.simulation_figures": "simulation_figure",
    "planner.simulation.bar": "Bar",
    "planner.materials.law_blocks": "law_block",
    "planner.simulation.loads": "LoadCase",
    "planner.simulation.part": "PartSimulation simulate_part",
    "planner.simulation.export": "Export ExportedMaterial export",
    "planner.simulation.simulate": "Simulation simulate simulate_bar",
    "planner.slices": "Layer SliceStack iterate_layers write_slices",
    "planner.testing": "file_schema",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'planner' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
