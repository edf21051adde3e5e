"""Campaigns of a dozen or so specimens and their diagnoses, made once."""

import pytest

from planner.gap.campaign import Campaign
from planner.gap.diagnose import diagnose
from planner.gap.diagnosis import Diagnosis


@pytest.fixture(scope="session")
def rates(planned) -> Campaign:
    """Two materials at three rates, three of each in two batches: a plan."""
    return planned(3, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.085, 0.85, 8.5])


@pytest.fixture(scope="session")
def of_nothing(rates, imitated) -> Diagnosis:
    return diagnose(imitated(rates))


@pytest.fixture(scope="session")
def rate_campaign(rates, imitated) -> Campaign:
    return imitated(rates, "rate:rise=0.12,form=power-law")


@pytest.fixture(scope="session")
def of_rate(rate_campaign) -> Diagnosis:
    return diagnose(rate_campaign)
