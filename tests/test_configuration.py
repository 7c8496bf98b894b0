"""The configuration reference is that of the classes as they are."""

import dataclasses

import pytest

from jrcjax import reference
from jrcjax.channel import Channel
from jrcjax.hparams import Config, HParams
from jrcjax.params import EnvParams, Factor
from jrcjax.radar import Radar


def test_the_page_is_up_to_date():
    assert reference.PATH.read_text() == reference.reference(), "run `python -m jrcjax.reference`"


@pytest.mark.parametrize("kind", [Channel, Factor, Radar, HParams, Config])
def test_every_field_says_what_it_means(kind):
    meanings = reference.fields_of(kind)
    assert list(meanings) == [field.name for field in dataclasses.fields(kind)]
    assert all(meanings.values())


def test_a_meaning_is_the_docstring_under_the_field():
    assert reference.fields_of(HParams)["step_constant"].startswith("If positive, Q-learning's step size instead")
    assert reference.fields_of(EnvParams)["event_model"] == "[] index into EVENT_MODELS."
    assert reference.fields_of(EnvParams)["road"] == ""


def test_every_field_is_on_the_page_with_its_value():
    page = reference.reference()
    for kind in (Channel, Factor, Radar, HParams, Config):
        for field in dataclasses.fields(kind):
            assert f"| `{field.name}` |" in page
    assert "| `learning_rate` | float | 0.001 |" in page
    assert "| `event_probability` | float | 0.005, 0.1 | 0.005, 0.4 |" in page
    assert "| `hidden` | tuple[int, ...], static | 24, 24 |" in page
