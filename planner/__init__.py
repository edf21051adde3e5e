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
    from planner.errors import PlannerError
    from planner.fields.basic import Field
    from planner.gap.campaign import Campaign
    from planner.gap.campaign_folder import read_campaign, write_campaign
    from planner.gap.correct import Correction, correct
    from planner.gap.design import CampaignDesign, design_campaign
    from planner.gap.diagnose import diagnose
    from planner.gap.diagnosis import Diagnosis, read_diagnosis
    from planner.gap.standing import Standing, campaign_standing
    from planner.gap.virtual import synthesise_campaign
    from planner.grading.check import Certificate, Difference, check, diff
    from planner.grading.grade import grade
    from planner.grading.invert import Mixture, invert
    from planner.grading.profile import Profile, StiffnessScale, at_temperature, list_materials
    from planner.inverse_design.design import PartDesign, design
    from planner.materials.law_blocks import law_block
    from planner.materials.palette_study import (
        Characterisation,
        PaletteStudy,
        characterise,
        fit,
        fit_tables,
    )
    from planner.palette import Material, Palette, load_palette, write_palette
    from planner.plan import Plan, Region, read_plan
    from planner.printers import Printer, installed_printers, load_printer
    from planner.report.compare_page import compare_page
    from planner.report.gap_page import write_diagnosis
    from planner.report.loaded_part import part_page, part_volume
    from planner.report.material_figures import (
        characterisation_figure,
        fit_figure,
        materials_figure,
    )
    from planner.report.plan_page import plan_page, view
    from planner.report.simulation_figures import simulation_figure
    from planner.simulation.bar import Bar
    from planner.simulation.export import Export, ExportedMaterial, export
    from planner.simulation.loads import LoadCase
    from planner.simulation.part import PartSimulation, simulate_part
    from planner.simulation.simulate import Simulation, simulate, simulate_bar
    from planner.slices.slices import Layer, iterate_layers
    from planner.slices.write import SliceStack, write_slices
    from planner.testing import file_schema

__version__ = "0.1.0"

__all__ = [
    "Bar",
    "Campaign",
    "CampaignDesign",
    "Certificate",
    "Characterisation",
    "Correction",
    "Diagnosis",
    "Difference",
    "Export",
    "ExportedMaterial",
    "Field",
    "Layer",
    "LoadCase",
    "Material",
    "Mixture",
    "Palette",
    "PaletteStudy",
    "PartDesign",
    "PartSimulation",
    "Plan",
    "PlannerError",
    "Printer",
    "Profile",
    "Region",
    "Simulation",
    "SliceStack",
    "Standing",
    "StiffnessScale",
    "at_temperature",
    "campaign_standing",
    "characterisation_figure",
    "characterise",
    "check",
    "compare_page",
    "correct",
    "design",
    "design_campaign",
    "diagnose",
    "diff",
    "export",
    "file_schema",
    "fit",
    "fit_figure",
    "fit_tables",
    "grade",
    "installed_printers",
    "invert",
    "iterate_layers",
    "law_block",
    "list_materials",
    "load_palette",
    "load_printer",
    "materials_figure",
    "part_page",
    "part_volume",
    "plan_page",
    "read_campaign",
    "read_diagnosis",
    "read_plan",
    "simulate",
    "simulate_bar",
    "simulate_part",
    "simulation_figure",
    "synthesise_campaign",
    "view",
    "write_campaign",
    "write_diagnosis",
    "write_palette",
    "write_slices",
]

_MODULES = {
    "planner.errors": "PlannerError",
    "planner.fields.basic": "Field",
    "planner.gap.campaign": "Campaign",
    "planner.gap.campaign_folder": "read_campaign write_campaign",
    "planner.gap.correct": "Correction correct",
    "planner.gap.design": "CampaignDesign design_campaign",
    "planner.gap.diagnose": "diagnose",
    "planner.gap.diagnosis": "Diagnosis read_diagnosis",
    "planner.gap.standing": "Standing campaign_standing",
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
    "planner.report.compare_page": "compare_page",
    "planner.report.gap_page": "write_diagnosis",
    "planner.report.loaded_part": "part_page part_volume",
    "planner.report.material_figures": "characterisation_figure fit_figure materials_figure",
    "planner.report.plan_page": "plan_page view",
    "planner.report.simulation_figures": "simulation_figure",
    "planner.simulation.bar": "Bar",
    "planner.materials.law_blocks": "law_block",
    "planner.simulation.loads": "LoadCase",
    "planner.simulation.part": "PartSimulation simulate_part",
    "planner.simulation.export": "Export ExportedMaterial export",
    "planner.simulation.simulate": "Simulation simulate simulate_bar",
    "planner.slices.slices": "Layer iterate_layers",
    "planner.slices.write": "SliceStack write_slices",
    "planner.testing": "file_schema",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'planner' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
