"""The configuration reference is that of the classes as they are."""

import dataclasses

import pytest

from jrcjax.config import document
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.channel import Channel
from jrcjax.model.params import EnvParams, Factor
from jrcjax.radar import Radar


def test_the_page_is_up_to_date():
    assert document.PATH.read_text() == document.reference(), "run `python -m jrcjax.config.document`"


@pytest.mark.parametrize("kind", [Channel, Factor, Radar, HParams, Config])
def test_every_field_says_what_it_means(kind):
    meanings = document.fields_of(kind)
    assert list(meanings) == [field.name for field in dataclasses.fields(kind)]
    assert all(meanings.values())


def test_a_meaning_is_the_docstring_under_the_field():
    assert document.fields_of(HParams)["step_constant"].startswith("If positive, Q-learning's step size instead")
    assert (
        document.fields_of(EnvParams)["event_model"]
        == "Deviation A1: how the factors add up to the probability of an event."
    )
    assert document.fields_of(EnvParams)["road"] == ""


def test_every_field_is_on_the_page_with_its_value():
    page = document.reference()
    for kind in (Channel, Factor, Radar, HParams, Config):
        for field in dataclasses.fields(kind):
            assert f"| `{field.name}` |" in page
    assert "| `learning_rate` | float | 0.001 |" in page
    assert "| `event_probability` | float [J] | 0.005, 0.1 | 0.005, 0.4 | numbers, one per level, in [0, 1] |" in page
    assert "| `hidden` | tuple[int, ...], static | 24, 24 |" in page
