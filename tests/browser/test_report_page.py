"""The report's page in a real browser: a tuning is chosen, its motion shown, nothing fetched."""

import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from gearlib.data.gathering import gather_resonance
from gearlib.pages.report import ends_from_rest, page
from gearlib.runs.sweeping import sweep
from tests.browser.chromium import browser, errors, everywhere, wait_for
from tests.paper import PAPER

assert browser  # a fixture

TUNINGS = np.linspace(0.6, 0.9, 31)
RUN = {"periods": 60, "record_periods": 10}
PAIRS = {
    "k1": PAPER.replace(material_damping=3953.7),
    "light": PAPER.replace(material_damping=400.0),
}


@pytest.fixture(scope="module")
def ends():
    pairs = {name: pair.as_dict() for name, pair in PAIRS.items()}
    return ends_from_rest.compute(pairs, TUNINGS, RUN | {"samples_per_period": 32}, 2)


@pytest.fixture(scope="module")
def sweeps():
    return {
        (name, way): sweep(pair, TUNINGS, direction=way, **RUN)
        for name, pair in PAIRS.items()
        for way in ("cold", "up", "down")
    }


@pytest.fixture(scope="module")
def address(sweeps, ends, tmp_path_factory):
    resonance = gather_resonance(
        [one.assign_coords(damping=name, direction=way) for (name, way), one in sweeps.items()]
    )
    path = tmp_path_factory.mktemp("page") / "index.html"
    path.write_text(page.build(resonance, ends), encoding="utf-8")
    return path.as_uri()


def seen(driver):
    """Return what the page shows: tuning, damping, named curves, phase plane, time course."""
    return driver.execute_script(
        """
        const [page] = Bokeh.documents;
        const model = name => page.get_model_by_name(name);
        const {plane, course, marks, shown} = model("choose").args;
        const visible = shown.flat().filter(model => model.visible);
        const points = ({data_source: {data}}) =>
            Array.from(data.x).map((x, i) => [x, data.y[i]]).filter(([_, y]) => isFinite(y));
        return {
            tuning: model("tuning").value,
            damping: model("damping").active,
            x: plane.data.x, y: plane.data.y, displacement: course.data.displacement,
            force: course.data.force, marks: marks.data.y,
            // Of each sweep: line and dots of the largest displacement, of the smallest, its name.
            curves: visible.flatMap((item, i) => item.label ? [[
                item.label.value, [...points(visible[i - 4]), ...points(visible[i - 3])]
            ]] : []),
        };
        """
    )


def pixels(driver):
    """Return what the canvases of the three small plots show."""
    return [canvas.screenshot_as_base64 for canvas in everywhere(driver, ".bk-Canvas")[1:]]


def agrees(found, ends, damping, tuning):
    orbit = ends.isel(damping=damping).sel(tuning=tuning, method="nearest")
    for axis, name in (("x", "displacement"), ("y", "velocity")):
        # The page holds single precision.
        np.testing.assert_array_equal(np.float32(found[axis][:-1]), orbit[name].values)
    np.testing.assert_array_equal(np.float32(found["force"]), orbit.dynamic_force.values)
    np.testing.assert_array_equal(np.float32(found["displacement"]), orbit.displacement.values)
    extrema = [orbit.displacement_max, orbit.displacement_min]
    np.testing.assert_array_equal(np.float32(found["marks"]), np.float32(extrema))


def curves_agree(found, sweeps, damping):
    words = {"from rest": "cold", "sweep up": "up", "sweep down": "down"}
    assert [label for label, _ in found["curves"]] == list(words)
    for label, points in found["curves"]:
        swept = sweeps[damping, words[label]]
        np.testing.assert_array_equal(
            np.float32(sorted(points)).T, np.float32([swept.tuning, swept.displacement_max])
        )


def test_choosing_shows_the_motion(browser, address, sweeps, ends):
    browser.get(address)
    wait_for(lambda: browser.execute_script("return window.Bokeh && Bokeh.documents.length == 1"))
    first = wait_for(lambda: len(seen(browser)["x"]) > 2 and seen(browser))
    agrees(first, ends, 0, first["tuning"])
    curves_agree(first, sweeps, "k1")
    before = pixels(browser)
    assert len(before) == 3

    # The slider by its keys.
    handle = wait_for(lambda: everywhere(browser, ".noUi-handle"))[0]
    handle.send_keys(Keys.ARROW_RIGHT * 3)
    second = wait_for(lambda: seen(browser)["x"] != first["x"] and seen(browser))
    assert second["tuning"] == pytest.approx(first["tuning"] + 0.03)
    agrees(second, ends, 0, second["tuning"])
    wait_for(lambda: all(a != b for a, b in zip(before, pixels(browser), strict=True)))

    # A click into the characteristic, left of its middle.
    canvas = everywhere(browser, ".bk-Canvas")[0]
    ActionChains(browser).move_to_element_with_offset(canvas, -300, 0).click().perform()
    third = wait_for(lambda: seen(browser)["tuning"] < 0.74 and seen(browser))
    agrees(third, ends, 0, third["tuning"])

    # Another damping.
    (button,) = [b for b in everywhere(browser, ".bk-btn") if b.text == "light"]
    button.click()
    fourth = wait_for(lambda: seen(browser)["damping"] == 1 and seen(browser))
    agrees(fourth, ends, 1, third["tuning"])
    curves_agree(fourth, sweeps, "light")
    (words,) = [e for e in everywhere(browser, ".bk-clearfix") if "motion from rest" in e.text]
    swept = sweeps["light", "cold"]
    rpm = float(swept.speed[0] / swept.tuning[0]) * third["tuning"]
    chosen = f"light, tuning {third['tuning']:.2f}, {rpm:.0f} rpm. The motion from rest"
    assert words.text.startswith(chosen)

    assert errors(browser) == []
    fetched = browser.execute_script(
        "return performance.getEntriesByType('resource').map(entry => entry.name)"
    )
    assert [name for name in fetched if not name.startswith("data:")] == []
