"""The page in a real browser: it asks nothing of the network, and every control works."""

import csv
import io
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

pytest.importorskip("playwright.sync_api")

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect, sync_playwright

from hbvm_bench.report.page import document
from hbvm_bench.report.write import write
from hbvm_bench.store.store import Store
from tests.hbvm_bench import made_up_run

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = os.environ.get("CHROMIUM") or next((path for name in NAMES if (path := shutil.which(name))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")

FAMILIES = {method.partition("(")[0] for method in made_up_run.METHODS}
"""The figure of the energy has a line of each."""

PATIENCE = 30_000  # milliseconds, on a machine with other work


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    target = tmp_path_factory.mktemp("report")
    write(document(made_up_run.sitnikov(Store(tmp_path_factory.mktemp("run")))), target)
    return target


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    target = tmp_path_factory.mktemp("large")
    texts = [f"pendulum(p={1 + number / 10})" for number in range(2)]
    write(document(made_up_run.write(Store(tmp_path_factory.mktemp("run")), texts, 200, missing=3)), target)
    return target


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM)
        yield opened
        opened.close()


@contextmanager
def opened(browser, folder, **options) -> Iterator[Page]:
    """Open a report; what it logs as an error, says in a window or asks of anybody fails the test."""
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: said.append(dialog.message))
    page.on("request", lambda request: said.append(f"asked for {request.url[:80]}"))
    url = (folder / "index.html").as_uri()
    page.goto(url)
    page.wait_for_selector("html[data-data=ready]", state="attached")
    yield page
    harmless = (f"asked for {url[:80]}", "asked for blob:", "asked for data:image/svg")  # nothing leaves
    left = [text for text in said if not text.startswith(harmless)]
    assert left == []
    context.close()


@pytest.fixture(scope="module")
def page(browser, folder):
    """Open the report once for the tests that each set what they look at: a page takes seconds to load."""
    with opened(browser, folder, reduced_motion="reduce") as page:
        yield page


def visible_rows(page):
    return page.locator("table.results tbody tr:not(.group):visible")


def wait_for_change(page, expression, before):
    """Wait until `expression` is no longer `before`; the page draws in its own time."""
    page.wait_for_function(f"before => ({expression}) !== before", arg=before)


def too_wide(page):
    """Return the windows that the page does not fit."""
    found = []
    for width in (360, 1280, 1920):
        page.set_viewport_size({"width": width, "height": 800})
        if page.evaluate("document.documentElement.scrollWidth") > width:
            found.append(width)
    page.set_viewport_size({"width": 1280, "height": 900})
    return found


def serious(page):
    """Return what axe finds in the light and in the dark."""
    found = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        found += [
            one for one in Axe().run(page).response["violations"] if one["impact"] in ("serious", "critical")
        ]
    return [(one["id"], one["nodes"][0]["html"][:200]) for one in found]


def test_the_page_is_small_and_no_wider_than_its_window_and_all_figures_come(page, folder, large):
    assert (folder / "index.html").stat().st_size <= 500_000
    assert (large / "index.html").stat().st_size <= 1_500_000
    assert too_wide(page) == []
    expect(page.locator("#energy .picture svg")).to_be_attached()
    figures = page.locator("figure").count()
    expect(page.locator("figure .picture svg")).to_have_count(figures)  # those unpacked by the script too


def test_hostile_names_do_nothing_in_a_browser(page):
    assert page.locator("script").count() == 2  # its data and its own


def test_sorting_and_filtering(page):
    assert visible_rows(page).count() == len(made_up_run.METHODS)
    page.get_by_role("button", name="energy", exact=True).click()
    head = page.locator("table.results th[aria-sort]")
    assert head.get_attribute("aria-sort") == "ascending"
    first = page.locator("tbody[data-group=on] tr:not(.group) td:nth-child(3)")
    up = [float(text.split()[0]) for text in first.all_inner_texts()]
    assert up == sorted(up)
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "descending"
    down = [float(text.split()[0]) for text in first.all_inner_texts()]
    assert down == sorted(up, reverse=True)

    page.fill("[name=words]", "hbvm k=18")
    expect(page.locator("#filter output")).to_have_text(f"1 of {len(made_up_run.METHODS)} cases")
    page.get_by_role("button", name="Clear").click()
    expect(visible_rows(page)).to_have_count(len(made_up_run.METHODS))
    page.uncheck("[name=group][value=ended]")
    expect(visible_rows(page)).to_have_count(len(made_up_run.METHODS) - 1)
    page.select_option("[name=library]", "scipy")
    expect(visible_rows(page)).to_have_count(1)
    page.get_by_role("button", name="Clear").click()


def test_the_results_fit_a_laptop_and_the_lesser_columns_come_on_demand(page):
    lesser = page.locator("table.results .minor:visible")
    expect(lesser).to_have_count(0)
    assert page.locator(".scroll.table").evaluate("e => e.scrollWidth - e.clientWidth") == 0
    page.check("[name=all]")
    expect(lesser).not_to_have_count(0)
    page.get_by_role("button", name="Clear").click()
    expect(lesser).to_have_count(0)


def test_the_theme_changes_pages_and_figures(page):
    ink = "getComputedStyle(document.querySelector('#energy .picture svg text')).fill"
    ground = "getComputedStyle(document.body).backgroundColor"
    before = page.evaluate(ground), page.evaluate(ink)
    page.click("#theme")
    wait_for_change(page, ground, before[0])
    wait_for_change(page, ink, before[1])


def test_the_numbers_are_in_a_table(page):
    page.locator("#energy details.numbers summary").click()
    # The table is made when `toggle` arrives, a task after the click.
    expect(page.locator("#energy details.numbers tbody tr")).to_have_count(len(FAMILIES))


def test_figures_and_their_numbers_are_saved_from_the_page_itself(page):
    def saved(selector):
        with page.expect_download() as download:
            page.locator(selector).click()
        return download.value.path().read_bytes()

    assert b"var(" not in (svg := saved("#energy [data-save=svg]"))
    assert svg.startswith(b"<svg")
    rows = list(csv.reader(io.StringIO(saved("#energy [data-save=numbers]").decode())))
    assert len(rows) == 1 + len(FAMILIES)
    assert len({len(row) for row in rows}) == 1


def test_the_keyboard_reaches_every_control(page):
    shown = (
        "[...document.querySelectorAll('button, a[href], input, select, summary, canvas')]"
        ".filter((e) => e.checkVisibility())"
    )
    wanted = page.evaluate(f"{shown}.length")
    page.evaluate("document.addEventListener('focusin', (e) => { e.target.dataset.reached = 'yes'; })")
    page.locator(".skip").focus()
    for _ in range(3 * wanted):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement === document.body"):
            break
    unreached = f"{shown}.filter((e) => !e.dataset.reached).map((e) => e.outerHTML.slice(0, 80))"
    assert page.evaluate(unreached) == []


def test_nothing_serious_is_found_by_axe(browser, folder):
    with opened(browser, folder, reduced_motion="reduce", bypass_csp=True) as page:
        page.locator("#energy details.numbers summary").click()
        expect(page.locator("#energy details.numbers tbody tr")).not_to_have_count(0)
        assert serious(page) == []


def test_a_large_campaign_stays_usable(browser, large):
    with opened(browser, large) as page:
        assert too_wide(page) == []
        rows = page.locator("table.results tbody tr:not(.group)")
        assert rows.count() == 400 - 3
        expect(page.locator(".missing").first).to_contain_text("3 of 400 cases have no result yet")
        page.fill("[name=words]", "taylor")
        page.select_option("[name=problem]", "2")
        expect(page.locator("#filter output")).to_contain_text("of 397 cases")
        shown = visible_rows(page).count()
        assert 0 < shown < 200
        page.get_by_role("button", name="time", exact=True).click()


def test_a_script_that_gets_into_the_page_does_not_run(browser, folder, tmp_path):
    attack = '<script>document.title = "hit"</script><img src="x" onerror="document.title = \'hit\'">'
    page_text = (folder / "index.html").read_text(encoding="utf-8")
    (tmp_path / "index.html").write_text(page_text.replace("<main>", f"<main>{attack}"), encoding="utf-8")
    context = browser.new_context()
    page = context.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    page.wait_for_selector("html[data-data=ready]", state="attached", timeout=PATIENCE)  # ours does
    assert page.title() != "hit"
    context.close()
