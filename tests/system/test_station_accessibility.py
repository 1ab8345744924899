"""The page of an e-stop station, checked by axe-core in a real browser: its names, roles and contrasts."""

from pathlib import Path
from typing import Any

import pytest

from tests.system.browser import Tab, needs_chromium
from tests.system.test_station_drive import takes
from tests.system.test_station_picture import watched

AXE = Path(__file__).parents[2] / ".axe" / "axe_playwright_python" / "axe.min.js"

pytestmark = [
    needs_chromium,
    pytest.mark.skipif(not AXE.exists(), reason="needs axe-core, which `make timed` fetches"),
    pytest.mark.timeout(180),
    pytest.mark.timed,  # Chromium uses the whole machine
]

SERIOUS = {"serious", "critical"}
RUN = """axe.run(document, { resultTypes: ["violations"] }).then((found) => found.violations.map((one) =>
    ({ id: one.id, impact: one.impact, nodes: one.nodes.map((node) => node.failureSummary + " " + node.html) })))"""


async def serious_violations(tab: Tab) -> list[dict[str, Any]]:
    found = await tab.evaluate(RUN)
    return [one for one in found if one["impact"] in SERIOUS]


async def show_in(tab: Tab, scheme: str) -> None:
    await tab.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    await tab.waits_for(f"matchMedia('(prefers-color-scheme: {scheme})').matches")


async def test_a_page_has_no_serious_violation_of_accessibility_in_light_and_dark(tmp_path: Path) -> None:
    """It watches, drives, and is pressed."""
    async with watched(tmp_path, teleop=False, drives=True) as (_, server, _, tab):
        await tab.evaluate(AXE.read_text(encoding="utf-8") + ";0")

        async def check(state: str) -> None:
            for scheme in ("light", "dark"):
                await show_in(tab, scheme)
                assert await serious_violations(tab) == [], (state, scheme)

        await check("watches")
        await takes(tab)
        await check("drives")
        await tab.is_heard()
        await tab.click(*await tab.middle_of("#stop-label"))
        await tab.waits_for("document.body.dataset.pressed === 'true'")
        await check("pressed")
        server.process.kill()
        await tab.shows("NOT HEARD", "No connection to the station's program: check that it runs.")
        await check("not heard")


async def test_axe_finds_a_button_without_a_name(tmp_path: Path) -> None:
    """The check itself can fail."""
    async with watched(tmp_path, teleop=False) as (_, _, _, tab):
        await tab.evaluate(AXE.read_text(encoding="utf-8") + ";0")
        await tab.evaluate("document.body.append(document.createElement('button'))")
        assert "button-name" in {one["id"] for one in await serious_violations(tab)}
