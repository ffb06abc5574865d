"""The picture of a page of results in the handbook: `python -m tests.viewing.browse_picture`, with Chromium installed."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from gantrytau import browse, simulate
from gantrytau_models import FourBar
from tests.viewing.browser import browsing, found

FILE = Path(__file__).parents[2] / "notebooks" / "figures" / "browse.webp"
FRAME = "document.querySelector('iframe')"


def main() -> None:
    """Draw two falls of a four-bar with the cursor at 0.6 s."""
    browser = found()
    if browser is None:
        raise SystemExit("found no Chromium or Chrome; apt install chromium")
    falls = [simulate(FourBar(crank=dict(phi=dict(start=phi))), stop=2.0) for phi in (1.0, 0.5)]
    page = browse(*falls, titles=["phi = 1 rad", "phi = 0.5 rad"], first=["crank.phi", "crank.w"])
    with tempfile.TemporaryDirectory() as folder, browsing(browser) as tab:
        tab.resize(1366, 720)
        tab.open(page.save(Path(folder) / "page.html"), element="body[data-ready]")
        tab.until(f"{FRAME}.dataset.ready === 'yes'")
        tab.run(
            "[...document.querySelectorAll('.row .name')].find(one => one.textContent === 'crank').click()"
        )
        tab.rest(4.0)
        tab.run("Panels.pin(0.6, 'a')")
        tab.rest(1.5)
        Image.fromarray(tab.picture().astype(np.uint8)).save(FILE, quality=85, method=6)
    print(f"{FILE}: {FILE.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
