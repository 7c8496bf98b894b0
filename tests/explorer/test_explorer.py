"""The explorer's answers, its server, and its page in a browser."""

import json
import threading
import urllib.error
import urllib.request

import pytest
from browser import CHROMIUM, Browser
from tiny import TEXT

from explorer import answers
from explorer.__main__ import Server
from explorer.training import Training
from jrcjax import exact
from jrcjax.config.toml import from_toml


@pytest.fixture(scope="module")
def server():
    server = Server(0)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def ask(server, path, asked, **headers):
    request = urllib.request.Request(server.address + path, json.dumps(asked).encode(), headers)
    return json.loads(urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=120).read())


def test_the_answer_is_that_of_the_solver(server):
    answer = ask(server, "toml", {"text": TEXT})
    params = from_toml(TEXT)
    best = exact.evaluate_policy(params, exact.optimal_policy(params))
    assert answer["optimum"]["reward"] == pytest.approx(float(best.reward), rel=1e-5)
    assert len(answer["actions"]) == len(answer["levels"]) == params.num_states
    paths = {field["path"] for field in answer["fields"]}
    assert {"reward_weights", "speed.event_probability", "radar.density", "event_model"} <= paths
    assert exact.evaluate_policy(from_toml(answer["toml"]), exact.optimal_policy(params)).reward == best.reward


@pytest.mark.parametrize("value", [1.5, None])
def test_a_bad_number_is_refused_with_its_field(server, value):
    description = answers.described(from_toml(TEXT))
    description["speed"]["event_probability"][1] = value
    with pytest.raises(urllib.error.HTTPError) as refused:
        ask(server, "solve", {"description": description})
    with refused.value as error:
        assert error.code == 400
        assert json.loads(error.read())["error"].startswith("speed.event_probability: ")


def test_pages_of_other_sites_are_not_answered(server):
    with pytest.raises(urllib.error.HTTPError) as refused:
        ask(server, "start", {"environment": "target"}, Origin="http://elsewhere.example")
    with refused.value as error:
        assert error.code == 403
    assert server.server_address[0] == "127.0.0.1"


def test_curves_come_while_agents_train():
    training = Training()
    training.start(from_toml(TEXT), ["q_learning"], seeds=2, episodes=4)
    training._thread.join()
    assert len(training.progress()["curves"]["q_learning"]) == 4
    with pytest.raises(ValueError, match="seeds: '0'; allowed: an int from 1 to 64"):
        training.start(from_toml(TEXT), ["q_learning"], seeds=0, episodes=4)


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs a Chromium")
def test_in_a_browser(server, tmp_path):
    browser = Browser(tmp_path)
    try:
        browser.call("Page.navigate", url=server.address)
        browser.wait("document.querySelector('#map button') !== null")
        before = browser.run("document.getElementById('reward').textContent")
        field = "document.querySelector('[aria-label=\"speed.event_probability 1 slider\"]')"
        browser.run(f"{field}.value = 0.9; {field}.dispatchEvent(new Event('input')); 1")
        browser.wait(f"document.getElementById('reward').textContent !== '{before}'")
        number = "document.querySelector('[aria-label=\"speed.event_probability 1\"]')"
        assert browser.run(f"{number}.value") == "0.9"
        browser.run(f"{number}.value = 7; {number}.dispatchEvent(new Event('input')); 1")
        place = "document.querySelector('[data-path=\"speed.event_probability\"] .bad').textContent"
        assert "allowed: numbers, one per level, in [0, 1]" in browser.wait(place)
        for width in (1280, 390):
            browser.resize(width, 900)
            assert browser.run("document.documentElement.scrollWidth") <= width
    finally:
        browser.close()
