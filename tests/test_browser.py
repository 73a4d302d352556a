"""The pages in a real browser: clicks, keys, sliders, and numbers that its scripts compute.

Needs Chromium, chromedriver and the extra "test"; without them the tests are skipped, and say what
is missing.
"""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import regrasp_lp as rl
from regrasp_lp.friction import Cones
from regrasp_lp.linear_sets import LinearSets
from regrasp_lp.planning.reach import room
from regrasp_lp.planning.search import fewest_placements
from regrasp_lp.plotting.sight import visible_part
from regrasp_lp.polytopes import corners

NASTY = "</script><b onclick=alert(1)>\u2028 & \"'<!--"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
DESKTOP, PHONE = (1280, 800), (360, 640)


@dataclass
class Browser:
    """A headless browser with one page at a time."""

    driver: Any

    def open(self, page: str, folder: Path, size: tuple[int, int] = DESKTOP) -> None:
        """Show a page from a file of its own; animations do not wait for anybody."""
        file = folder / "page.html"
        file.write_text(page, encoding="utf-8")
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.get(file.as_uri())

    def run(self, code: str, *arguments: object) -> Any:
        return self.driver.execute_script(code, *arguments)

    def value(self, expression: str) -> Any:
        return self.run(f"return {expression}")

    def click(self, selector: str) -> None:
        self.driver.find_element("css selector", selector).click()

    def text(self, selector: str) -> str:
        return self.driver.find_element("css selector", selector).text

    def press(self, *keys: str) -> None:
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def wait(self, expression: str) -> None:
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self.driver, 10, poll_frequency=0.02).until(lambda _: self.value(expression))

    def media(self, **features: str) -> None:
        """Emulate what a user prefers."""
        chosen = [{"name": k.replace("_", "-"), "value": v} for k, v in features.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": chosen})

    def screenshot(self) -> np.ndarray:
        from matplotlib.image import imread

        data = self.driver.get_screenshot_as_base64()
        return imread(io.BytesIO(base64.b64decode(data)))

    def complaints(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser")]


@pytest.fixture(scope="session")
def started() -> Iterator[Browser]:
    browsers = [path for name in BROWSERS if (path := shutil.which(name))]
    driver_path = shutil.which("chromedriver")
    missing = [] if browsers else [f"browser ({' or '.join(BROWSERS)})"]
    missing += [] if driver_path else ["driver of it (chromedriver)"]
    try:
        from selenium import webdriver
    except ModuleNotFoundError:
        missing.append("selenium (the extra test)")
    if missing:
        pytest.skip(f"pages not tested in a browser: there is no {' and no '.join(missing)}")
    options = webdriver.ChromeOptions()
    options.binary_location = browsers[0]
    for argument in ("headless=new", "disable-gpu", "disable-dev-shm-usage", "hide-scrollbars"):
        options.add_argument(f"--{argument}")
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.add_argument("--no-sandbox")  # Chromium refuses to run as root in one
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(driver_path)
    driver = webdriver.Chrome(options=options, service=service)
    yield Browser(driver)
    driver.quit()


@pytest.fixture
def browser(started) -> Iterator[Browser]:
    """The browser; whatever a test does, no page may complain or ask for anything."""
    started.media()
    started.complaints()
    yield started
    assert started.complaints() == []
    assert started.value("performance.getEntriesByType('resource').map((e) => e.name)") == []


@pytest.fixture(scope="module")
def plan(workpieces) -> rl.Plan:
    start = rl.Grasp([(1, 2.0), (3, 36.0), (5, 39.0)])
    goal = rl.Grasp([(0, 34.0), (2, 0.6), (4, 19.8)])
    return rl.plan_regrasp(workpieces["l_bracket"], start, goal, 0.3)


@pytest.fixture(scope="module")
def bracket_graph(workpieces) -> rl.SwitchingGraph:
    return rl.build_switching_graph(workpieces["l_bracket"], 0.3)


@pytest.fixture(scope="module")
def chapter(stars) -> rl.SwitchingGraph:
    return rl.build_switching_graph(stars["star_25"], 0.17, sets="chapter")


# --- plans --------------------------------------------------------------------------------------


def test_going_through_a_plan(browser, plan, tmp_path):
    from selenium.webdriver.common.keys import Keys

    browser.media(prefers_reduced_motion="reduce")  # steps are taken at once
    browser.open(plan.to_html(), tmp_path)
    last = len(plan.steps)
    now = "regrasp.time"
    assert browser.value(now) == 0
    assert browser.text("#now").startswith("0. start: 1 on edge 1 at 2")
    browser.click("#next")
    assert browser.value(now) == 1
    browser.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert browser.value(now) == 2
    browser.press(Keys.END)
    assert browser.value(now) == last
    assert f"margin {plan.grasps[-1].margin:.4g}" in browser.text("#now")
    browser.press(Keys.HOME)
    assert browser.value(now) == 0
    browser.click("#last")
    browser.click("#previous")
    assert browser.value(now) == last - 1
    browser.click("#steps li:nth-child(4) button")
    assert browser.value(now) == 3
    current = browser.value("document.querySelector('#steps [aria-current=step]').textContent")
    assert "slide fingers 1 to edge 1 at" in current
    browser.run("document.querySelector('#time').focus()")
    browser.press(Keys.ARROW_RIGHT)  # the slider, too, goes step by step
    assert browser.value(now) == 4
    browser.click("#first")
    assert browser.value("document.querySelector('#time').value") == "0"


def test_playing_a_plan(browser, plan, tmp_path):
    from selenium.webdriver.common.keys import Keys

    browser.open(plan.to_html(), tmp_path)
    browser.run("const s = document.querySelector('#speed'); s.value = 4")
    browser.press(Keys.SPACE)
    browser.wait("regrasp.playing && regrasp.time % 1 > 0")  # in the middle of a step
    browser.press(Keys.SPACE)
    assert not browser.value("regrasp.playing")
    stopped = browser.value("regrasp.time")
    browser.click("#next")
    browser.wait(f"regrasp.time === {int(stopped) + 1}")
    browser.run(f"regrasp.go({len(plan.steps) - 1}); regrasp.play()")
    browser.wait(f"regrasp.time === {len(plan.steps)} && !regrasp.playing")
    label = browser.value("document.querySelector('#play').getAttribute('aria-label')")
    assert label == "Play"


def test_slider_and_chart(browser, plan, tmp_path):
    from selenium.webdriver import ActionChains

    browser.open(plan.to_html(), tmp_path)
    slider = browser.driver.find_element("css selector", "#time")
    ActionChains(browser.driver).click_and_hold(slider).move_by_offset(60, 0).release().perform()
    assert 5 < browser.value("regrasp.time") < len(plan.steps)
    chart = browser.driver.find_element("css selector", "#chart")
    ActionChains(browser.driver).move_to_element(chart).click().perform()
    assert browser.value("regrasp.time") == round(len(plan.steps) / 2)
    x = [browser.value(f"document.querySelector('#mark').getAttribute('x{n}')") for n in (1, 2)]
    assert float(x[0]) == pytest.approx(chart.rect["width"] / 2, rel=0.05)
    assert x[0] == x[1]
    assert f"least margin {plan.margin:.4g}" in chart.get_attribute("aria-label")


def test_every_instant_is_that_of_the_plan(browser, plan, tmp_path):
    browser.open(plan.to_html(), tmp_path)
    polygon = plan.polygon
    rng = np.random.default_rng(3)
    slides = [i for i, slide in enumerate(plan.slides) if slide is not None]
    assert slides
    for t in [i + s for i in slides for s in (0.0, *rng.uniform(size=3))]:
        code = "return [regrasp.sceneAt({0}), regrasp.marginAt({0}), regrasp.toleranceAt({0})]"
        scene, margin, tolerance = browser.run(code.format(t))
        i = int(t)
        before, after = (plan.grasps[n].contacts for n in (i, i + 1))
        contacts = {}
        for k, start in before.items():
            f = start.fraction + (t - i) * (after[k].fraction - start.fraction)
            contacts[k] = polygon.resolve_contact(rl.Contact.at_fraction(start.edge, f))
            assert scene["contacts"][str(k)][1] == pytest.approx(f)
        grasp = rl.Grasp([contacts[k] for k in plan.supports[i].fingers])
        size = 1e-7 * polygon.diameter
        assert margin == pytest.approx(rl.margin(polygon, grasp, plan.friction), abs=size)
        left = room(plan.touchable, plan.hand, contacts)
        expected = min(rl.tolerance(polygon, grasp, plan.friction), left)
        assert tolerance == pytest.approx(expected, abs=size)


def test_tolerance_under_limits(browser, plan, tmp_path):
    """Limits that hardly let the plan pass are what its tolerance comes from."""
    apart = [
        float(np.hypot(*(plan.polygon.point(one) - plan.polygon.point(other))))
        for held in plan.grasps
        for one, other in combinations(held.contacts.values(), 2)
    ]
    for limit in (
        {"max_span": max(apart) + 0.3},
        {"fingertip_separation": min(apart) - 0.3},
        {"edge_clearance": 0.15},
    ):
        limited = replace(plan, hand=rl.Hand(**limit))
        tighter = []
        browser.open(limited.to_html(), tmp_path)
        for i, least in enumerate(limited.slide_tolerances):
            if plan.slides[i] is not None:
                code = "Array.from({{length: 999}}, (_, n) => regrasp.toleranceAt({} + n / 999))"
                found = min(browser.value(code.format(i)))
                assert least - 1e-9 <= found <= least + 0.03
                tighter.append(least < plan.slide_tolerances[i])
        assert any(tighter)


def test_focus_points(browser, chapter, plan, tmp_path):
    """All points at which forces in the cones of the contacts can balance, and no others."""
    rng = np.random.default_rng(8)
    three = [s.witness for s in chapter.sets if len(s.edges) == 3]
    for polygon, friction, grasps in [
        (chapter.polygon, 0.17, [three[i] for i in rng.choice(len(three), 6, replace=False)]),
        (plan.polygon, 0.3, [g.grasp for g in plan.grasps if len(g.grasp) == 3]),
    ]:
        graph = rl.build_switching_graph(polygon, friction)
        start = graph.sets[0].witness
        browser.open(graph.plan(start, start).to_html(), tmp_path)
        for grasp in grasps:
            contacts = [[c.edge, c.fraction] for c in polygon.resolve(grasp)]
            regions = browser.run(
                """const scene = {support: [0, 1, 2], rays: {}, contacts: arguments[0]};
                const parts = regrasp.focusParts(regrasp.outline, scene);
                return regrasp.focusRegions(
                    parts.map((p) => ({...p, a: p.at, b: p.at})), regrasp.view.box, true)""",
                contacts,
            )
            low, high = polygon.bounds[:2], polygon.bounds[2:]
            q = rng.uniform(low, high, size=(400, 2))
            q = np.concatenate((q, [np.mean(ring, axis=0) for ring in regions] or q[:0]))
            seen = np.any([inside(q, np.array(ring)) for ring in regions] or [np.zeros(len(q))], 0)
            assert (seen == balanced(polygon, friction, contacts, q)).all()


def inside(q: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Whether points are in a convex polygon; some of its corners may coincide."""
    ring = ring[np.hypot(*(np.roll(ring, -1, axis=0) - ring).T) > 1e-9]
    ahead = np.roll(ring, -1, axis=0) - ring
    offset = q[:, None] - ring
    sides = ahead[:, 0] * offset[..., 1] - ahead[:, 1] * offset[..., 0]
    return (sides > 0).all(axis=1) | (sides < 0).all(axis=1)


def balanced(polygon: rl.Polygon, friction: float, contacts: list, q: np.ndarray) -> np.ndarray:
    """Whether forces through points, one in each friction cone, can balance each other."""
    cones = Cones.of(polygon, friction)
    forces, allowed = [], np.ones(len(q), dtype=bool)
    for edge, fraction in contacts:
        towards = q - polygon.points(edge, fraction)
        normal, tangent = polygon.normals[edge], polygon.tangents[edge]
        along, across = towards @ normal, towards @ tangent
        allowed &= np.abs(across) < cones.friction[edge] * np.abs(along)
        forces.append(np.sign(along)[:, None] * towards)
    turns = [a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] for a, b in pairwise((*forces, forces[0]))]
    return allowed & ((np.array(turns) > 0).all(axis=0) | (np.array(turns) < 0).all(axis=0))


def test_cones_end_where_material_does(browser, workpieces, tmp_path):
    polygon = workpieces["two_hole_plate"]
    graph = rl.build_switching_graph(polygon, 0.4)
    start = graph.sets[0].witness
    browser.open(graph.plan(start, start).to_html(), tmp_path)
    rng, cones = np.random.default_rng(2), Cones.of(polygon, 0.4)
    code = "return arguments[0].map(([at, rays]) => regrasp.visiblePart(regrasp.outline, at, rays))"
    edges = rng.integers(polygon.n_edges, size=30).tolist()
    apexes = [polygon.points(edge, f) for edge, f in zip(edges, rng.uniform(size=30), strict=True)]
    rays = [cones.unit_rays[[2 * edge, 2 * edge + 1]] for edge in edges]
    asked = [[at.tolist(), pair.tolist()] for at, pair in zip(apexes, rays, strict=True)]
    for at, pair, ring in zip(apexes, rays, browser.run(code, asked), strict=True):
        drawn, known = map(shapely.Polygon, (ring, visible_part(polygon, at, pair)))
        assert known.area > 0
        assert drawn.symmetric_difference(known).area < 1e-9 * polygon.diameter**2


def test_one_scroll_bar(browser, plan, chapter, tmp_path):
    """Either lists scroll, and the page is seen as a whole, or the page does."""
    lists = "['#account', '#detail', '#stage', '#map'].map((s) => document.querySelector(s))"
    nested = f"{lists}.filter((e) => e && getComputedStyle(e).overflowY === 'auto').length"
    whole = "document.documentElement.scrollHeight <= innerHeight"
    for page, act in (
        (plan.to_html(), "regrasp.go(3.5)"),
        (chapter.to_html(), "regrasp.select(3)"),
    ):
        for size in ((1280, 900), (1280, 650), (1280, 480), (700, 640)):
            browser.open(page, tmp_path, size)
            browser.run(act)
            assert browser.value(whole) == (browser.value(nested) == 1) == (size[1] in (900, 650))
            if browser.value(whole):
                last = "document.querySelector('#stage, #map').lastElementChild"
                ends = browser.value(
                    f"[{last}, {last}.parentElement].map((e) => e.getBoundingClientRect().bottom)"
                )
                assert ends[0] <= ends[1] + 1  # all of it is seen
        browser.open(page, tmp_path, (1280, 900))
        browser.run("document.querySelector('#text').open = true")
        assert browser.value(nested) == 0
    browser.open(plan.to_html(), tmp_path, (700, 640))  # as the documentation embeds it
    assert browser.value("document.querySelector('#curves').getBoundingClientRect().bottom") <= 640


def test_the_instant_in_words(browser, plan, tmp_path):
    browser.open(plan.to_html(), tmp_path)
    i = next(i for i, slide in enumerate(plan.slides) if slide is not None)
    browser.run(f"regrasp.go({i} + 0.37)")
    margin, tolerance = browser.value(
        f"[regrasp.marginAt({i} + 0.37), regrasp.toleranceAt({i} + 0.37)]"
    )
    assert f"now margin {margin:.4g}, tolerance {tolerance:.4g}" in browser.text("#now")
    assert f"given: {plan.chosen_margin:.4g} and {plan.chosen_tolerance:.4g}" in browser.text(
        "#facts"
    )


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_what_one_sees(browser, plan, chapter, size, tmp_path):
    for page, act in (
        (plan.to_html(), "regrasp.go(3.5)"),
        (chapter.to_html(), "regrasp.select(3)"),
    ):
        browser.open(page, tmp_path, size)
        browser.run(act)
        wide = browser.value("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]  # nothing is beyond the side
        picture = browser.screenshot()
        assert picture.shape[1] == size[0]
        assert len(np.unique(picture[::5, ::5, :3].reshape(-1, 3), axis=0)) > 50
        small = browser.run(
            """return [...document.querySelectorAll('button, select, input')].filter((e) => {
            const box = e.getBoundingClientRect();
            const height = e.type === 'checkbox' ? e.closest('label').offsetHeight : box.height;
            return box.width && height < 26;
            }).map((e) => e.outerHTML)"""
        )
        assert small == []
        unnamed = browser.run(
            """return [...document.querySelectorAll('button, select, input, canvas, svg[role]')]
            .filter((e) => !(e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')
                || e.closest('label') || e.textContent.trim())).map((e) => e.outerHTML)"""
        )
        assert unnamed == []


def test_fingers_do_not_cover_each_other(browser, plan, tmp_path):
    for size in (DESKTOP, PHONE):
        browser.open(plan.to_html(), tmp_path, size)
        for i in range(len(plan.grasps)):
            circles = browser.run(
                f"""regrasp.go({i}); return [...document.querySelectorAll('#picture circle.finger')]
                .map((c) => [c.cx.baseVal.value, c.cy.baseVal.value, c.r.baseVal.value])"""
            )
            numbers = browser.value(
                "[...document.querySelectorAll('#picture .number')].map((n) => n.textContent)"
            )
            assert set(map(int, numbers)) >= set(plan.grasps[i].contacts)
            for n, (x, y, r) in enumerate(circles):
                for a, b, s in circles[:n]:
                    assert np.hypot(x - a, y - b) >= r + s


def test_dark_and_print(browser, plan, tmp_path):
    browser.open(plan.to_html(), tmp_path)
    light = browser.screenshot()[..., :3].mean()
    browser.media(prefers_color_scheme="dark")
    assert browser.screenshot()[..., :3].mean() < 0.5 < light
    panels = "document.querySelectorAll('#filmstrip figure svg .material').length"
    assert browser.value(panels) == len(plan.grasps)
    pdf = browser.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert base64.b64decode(pdf["data"]).startswith(b"%PDF")
    for is_open in (False, True):  # what was folded away is so again
        browser.run(f"document.querySelector('#text').open = {str(is_open).lower()}")
        browser.run("dispatchEvent(new Event('beforeprint'))")
        assert browser.value("document.querySelector('#text').open") is True
        browser.run("dispatchEvent(new Event('afterprint'))")
        assert browser.value("document.querySelector('#text').open") is is_open


def test_names_are_texts(browser, workpieces, tmp_path):
    polygon = rl.Polygon(workpieces["rectangle"].exterior, name=NASTY)
    graph = rl.build_switching_graph(polygon, 0.3)
    witness = graph.sets[0].witness
    for page in (graph.plan(witness, witness).to_html(), graph.to_html()):
        browser.open(page, tmp_path)
        assert browser.value("document.querySelectorAll('b[onclick]').length") == 0
        assert NASTY in browser.value("document.querySelector('h1').textContent")
        assert NASTY in browser.value("document.title")


# --- graphs -------------------------------------------------------------------------------------


def test_clicking_in_a_graph(browser, bracket_graph, tmp_path):
    from selenium.webdriver import ActionChains

    browser.open(bracket_graph.to_html(), tmp_path)
    canvas = browser.driver.find_element("css selector", "#canvas")

    def click(index: int) -> None:
        x, y = browser.value(f"regrasp.onMap({index})")
        box = canvas.rect
        offset = round(x - box["width"] / 2), round(y - box["height"] / 2)
        ActionChains(browser.driver).move_to_element_with_offset(canvas, *offset).click().perform()

    click(5)
    grasp_set = bracket_graph.sets[5]
    assert browser.text("#chosen").endswith(f"on edges {', '.join(map(str, grasp_set.edges))}")
    assert f"margin {grasp_set.margin:.4g}" in browser.text("#now")
    emphasised = browser.value("document.querySelectorAll('#picture .edge').length")
    assert emphasised == len(set(grasp_set.edges))
    sliders = browser.value("document.querySelectorAll('#more input[type=range]').length")
    assert sliders == len(grasp_set.edges)
    click(20)
    assert browser.value("[regrasp.state.from, regrasp.state.to]") == [5, 20]
    steps = browser.value("document.querySelectorAll('#more ol button').length")
    assert steps == len(browser.value("regrasp.state.way.sets"))
    browser.click("#more ol li:last-child button")
    assert browser.value("document.querySelectorAll('#picture .moved').length") >= 1
    click(3)  # begins anew
    assert browser.value("[regrasp.state.from, regrasp.state.to]") == [3, None]
    click(3)
    assert browser.value("regrasp.state.from") is None


def test_keys_and_filters_of_a_graph(browser, chapter, tmp_path):
    from selenium.webdriver.common.keys import Keys

    browser.open(chapter.to_html(), tmp_path)
    browser.run("document.querySelector('#canvas').focus()")
    browser.press(Keys.ARROW_RIGHT, Keys.ENTER)
    first = browser.value("regrasp.state.from")
    browser.press(Keys.ARROW_DOWN, Keys.ENTER)
    assert browser.value("regrasp.state.to") not in (None, first)
    browser.press(Keys.ESCAPE)
    assert browser.value("regrasp.state.from") is None
    edge = chapter.sets[40].edges[0]
    browser.driver.find_element("css selector", "#on-edges").send_keys(str(edge))
    browser.click("[data-kind=parallel]")
    wanted = [s for s in chapter.sets if edge in s.edges and s.kind != "parallel"]
    assert browser.text("#shown") == f"{len(wanted)} sets of {len(chapter)}"
    browser.run(
        """const from = document.querySelector('#from'); from.value = 40;
        from.dispatchEvent(new Event('change'))"""
    )
    assert browser.text("#chosen").startswith("Set 40: ")


def test_numbers_of_sets(browser, bracket_graph, chapter, tmp_path):
    from selenium.webdriver import ActionChains

    def typed(**numbers: object) -> str:
        for name, number in numbers.items():
            browser.run(f"document.querySelector('#{name}').value = '{number}'")
        browser.run("document.querySelector('#to').dispatchEvent(new Event('change'))")
        return browser.text("#refused")

    browser.open(bracket_graph.to_html(), tmp_path)
    written = """const ask = CanvasRenderingContext2D.prototype, fill = ask.fillText, words = [];
        ask.fillText = function (...all) { words.push(String(all[0])); fill.apply(this, all); };
        const done = arguments[arguments.length - 1];
        document.querySelector('#switches').dispatchEvent(new Event('change'));
        const then = (call) => requestAnimationFrame(() => requestAnimationFrame(call));
        then(() => { ask.fillText = fill; done(words); })"""
    numbers = [str(i) for i in range(len(bracket_graph))]
    assert sorted(browser.driver.execute_async_script(written), key=int) == numbers
    assert typed(**{"from": 4}) == ""
    assert browser.value("regrasp.state.from") == 4
    assert typed(to=99) == f"There is no set 99: they are numbered from 0 to {len(numbers) - 1}."
    assert browser.value("document.querySelector('#to').value") == "99"
    assert browser.value("[regrasp.state.from, regrasp.state.to]") == [4, None]
    assert "same" in typed(to=4)
    assert typed(to=9) == ""
    assert browser.value("[regrasp.state.from, regrasp.state.to]") == [4, 9]
    assert "first" in typed(**{"from": ""})
    # edges have numbers as the box says
    browser.run("regrasp.select(null)")
    count = "document.querySelectorAll('#picture .edge-number').length"
    assert browser.value(count) == bracket_graph.polygon.n_edges
    browser.click("#show-edges")
    assert browser.value(count) == 0
    # of more points than can be read the one that is pointed at
    browser.open(chapter.to_html(), tmp_path)
    assert len(chapter) > 60
    assert browser.driver.execute_async_script(written) == []
    canvas = browser.driver.find_element("css selector", "#canvas")
    x, y = browser.value("regrasp.onMap(7)")
    offset = round(x - canvas.rect["width"] / 2), round(y - canvas.rect["height"] / 2)
    ActionChains(browser.driver).move_to_element_with_offset(canvas, *offset).perform()
    edges = ", ".join(map(str, chapter.sets[7].edges))
    browser.wait("regrasp.state.hovered === 7")
    assert browser.driver.execute_async_script(written) == [f"set 7: edges {edges}"]


@pytest.mark.parametrize("which", ["complete", "chapter", "three", "five", "limited"])
def test_paths_and_switches_are_those_of_the_graph(browser, stars, chapter, which, tmp_path):
    hand = {
        "three": rl.Hand(3),
        "five": rl.Hand(5),
        "limited": rl.Hand(edge_clearance=0.02, reachable={3: (0.05, 0.2)}),
    }.get(which, rl.Hand())
    graph = chapter if which == "chapter" else rl.build_switching_graph(stars["star_15"], 0.3, hand)
    browser.open(graph.to_html(), tmp_path)
    rng, n = np.random.default_rng(1), len(graph)
    pairs = rng.integers(n, size=(60, 2)).tolist()
    found = browser.run("return arguments[0].map(([i, j]) => regrasp.path(i, j))", pairs)
    contacts, margins = graph.sets.contacts, graph.sets.margins
    for (i, j), path in zip(pairs, found, strict=True):
        expected = fewest_placements(contacts, margins, graph.switches, hand, {i: 0}, {j: 0})
        assert (path and path["sets"]) == expected
        if expected:
            held = [graph.held(a, b) for a, b in pairwise(expected)]
            assert path["placements"] == contacts[expected[1:]].sum() - sum(held)
            assert path["margin"] == margins[expected].min()
    chosen = rng.integers(n, size=12).tolist()
    adjacent = browser.run("return arguments[0].map(regrasp.neighbors)", chosen)
    for i, near in zip(chosen, adjacent, strict=True):
        assert [j for j, _ in near] == graph.neighbors(i)
        assert [h for _, h in near] == [graph.held(i, j) for j, _ in near]
    joined = [(i, j) for i in chosen for j in graph.neighbors(i)[::9]]
    switches = browser.run("return arguments[0].map(([i, j]) => regrasp.switchOf(i, j))", joined)
    for (i, j), switch in zip(joined, switches, strict=True):
        for mine, grasp in zip(("leaving", "arriving"), graph.witness(i, j), strict=True):
            assert switch[mine] == pytest.approx(grasp.fractions.tolist(), abs=1e-5)


@pytest.mark.parametrize("which", ["bracket", "chapter", "limited"])
def test_intervals_of_pieces(browser, workpieces, bracket_graph, chapter, which, tmp_path):
    hand = rl.Hand(edge_clearance=2.0)
    limited = rl.build_switching_graph(workpieces["l_bracket"], 0.3, hand)
    graph = {"bracket": bracket_graph, "chapter": chapter, "limited": limited}[which]
    browser.open(graph.to_html(), tmp_path)
    rng = np.random.default_rng(5)
    for i in rng.choice(len(graph), min(len(graph), 10), replace=False).tolist():
        grasp_set, lengths = graph.sets[i], graph.polygon.edge_lengths[list(graph.sets[i].edges)]
        assert browser.value(f"regrasp.marginOf({i}, {grasp_set.witness.fractions.tolist()})") == (
            pytest.approx(grasp_set.margin, abs=1e-7 * graph.polygon.diameter)
        )
        code = f"return regrasp.piecesOf({i}).map((p) => regrasp.pieceIntervals({i}, p))"
        whole = browser.value(f"regrasp.setIntervals({i})")
        found = browser.run(code)
        assert len(found) == len(grasp_set.pieces)
        every = []
        for intervals, piece in zip(found, grasp_set.pieces, strict=True):
            (points,) = corners(without_scales(piece))
            if not len(points):
                continue  # thinner than corners are looked for
            ends = np.array(intervals) * lengths[:, None]
            size = 1e-6 * graph.polygon.diameter
            assert np.allclose(ends, np.stack((points.min(0), points.max(0)), 1), atol=size)
            every.append(ends / lengths[:, None])
        low, high = np.min(every, axis=0)[:, 0], np.max(every, axis=0)[:, 1]
        assert np.allclose(whole, np.stack((low, high), axis=1), atol=1e-6)


def without_scales(sets: LinearSets) -> LinearSets:
    """The sets as they are, whatever their margins are measured by."""
    return LinearSets(
        sets.names, sets.rows, np.ones(sets.scales.shape), sets.bounds, sets.lower, sets.upper
    )


def test_a_graph_without_sets(browser, workpieces, tmp_path):
    empty = rl.build_switching_graph(workpieces["wedge"], 0.3, min_margin=1e9)
    browser.open(empty.to_html(), tmp_path)
    assert browser.text("#facts").startswith("0 sets")


@pytest.mark.parametrize("limits", [{"max_span": 80.0}, {"only_place": [4]}])
def test_a_hand_that_ties_fingers_to_each_other(browser, workpieces, limits, tmp_path):
    graph = rl.build_switching_graph(workpieces["l_bracket"], 0.3, rl.Hand(**limits))
    browser.open(graph.to_html(), tmp_path)
    i = next(i for i in range(len(graph)) if graph.neighbors(i))
    j = graph.neighbors(i)[0]
    browser.run(f"regrasp.select({i}, null)")
    assert "limits that tie fingers to each other are not looked at" in browser.text("#now")
    browser.run(f"regrasp.select({i}, {j})")
    switch = json.loads(browser.value(f"JSON.stringify(regrasp.switchOf({i}, {j}))"))
    assert switch["leaving"] == pytest.approx(graph.sets[i].witness.fractions.tolist())
    assert switch["held"] == graph.held(i, j)
