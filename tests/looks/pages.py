"""Pictures of the report, the certificate and the documentation, by an installed browser."""

import playwright.sync_api as playwright

import trueangle as ta
from trueangle.certificate.typesetting import certificate_pictures
from trueangle.reports.page import find_browser

__all__ = ["WIDTHS", "pages"]

#: Widths of a desk, a tablet and a phone, in pixels.
WIDTHS = (1280, 768, 390)

#: What the laboratory states in a certificate.
IDENTITY = """\
[certificate]
number = "2026-001"
item = "Robot joint"
serial = "A-17"
laboratory = "Laboratory of angles"
address = "Street 1\\n12345 Town"
date = 2026-11-23
language = "{language}"
[specification]
limit_arcsec = 120.0
decision_rule = "guard_band"
"""

_TOO_WIDE = "() => document.documentElement.scrollWidth - window.innerWidth"


def pages(folder, desk, docs):
    """Write the pictures; texts on what does not fit its window."""
    runs = ta.read_runs(desk / "runs.csv")
    wide = []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find_browser(), args=["--no-sandbox"])
        seen = {"report": desk / "report.html"}
        for name in ("index", "tutorial", "gallery", "howto/which-command"):
            seen[f"docs-{name.replace('/', '-')}"] = docs / f"{name}.html"
        for name, file in seen.items():
            for width in WIDTHS if file.exists() else ():
                for scheme in ("light", "dark"):
                    page = browser.new_page(
                        viewport={"width": width, "height": 900}, color_scheme=scheme
                    )
                    page.goto(file.as_uri())
                    if name == "report":
                        page.wait_for_selector("html[data-ready]", timeout=60_000)
                    page.screenshot(path=folder / f"{name}-{width}-{scheme}.png", full_page=True)
                    if page.evaluate(_TOO_WIDE) > 0:
                        wide.append(f"{name} at {width} pixels")
                    if width == WIDTHS[0] and scheme == "light":
                        page.pdf(path=folder / f"{name}.pdf", print_background=True)
                    page.close()
        browser.close()
    for language in ("en", "de"):
        identity = desk / f"identity-{language}.toml"
        identity.write_text(IDENTITY.format(language=language), encoding="utf-8")
        certified = ta.report(
            runs, gear_ratio=100.0, certificate=identity, model=desk / "joint.json"
        )
        certified.save(folder / f"certificate-{language}.pdf")
        for number, page in enumerate(certificate_pictures(certified.content), 1):
            (folder / f"certificate-{language}-{number}.png").write_bytes(page)
    return wide
